//! The loops of the plans: every tile of a plan over one packed block.

use super::block::Block;
use super::lanes::Lanes;
use super::plan::{Term, Tile, cell, cells, equal, narrow, table, wide};

/// A plan and its loops.
pub(super) trait Plan {
    /// The tiles.
    const TILES: &'static [Tile];

    /// Adds a block's products to its totals: those of the `i`-th term, counted through the tiles, to the `i`-th total.
    ///
    /// # Safety
    /// The CPU must have the instructions of `V`.
    unsafe fn pass<V: Lanes, const FOLD: bool>(block: &mut Block<'_, V>);
}

/// The number of terms before a tile.
const fn base(tiles: &[Tile], tile: usize) -> usize {
    let (mut terms, mut at) = (0, 0);
    while at < tile {
        terms += tiles[at].terms.len();
        at += 1;
    }
    terms
}

/// Makes the loops of a plan of its table. Every index is a constant, so that arrays become registers.
macro_rules! passes {
    ($($tile:literal: $($pair:ident)+ { $($third:ident: $($how:ident $with:ident),+;)+ })+) => {
        #[inline(always)]
        unsafe fn pass<V: Lanes, const FOLD: bool>(block: &mut Block<'_, V>) {
            $({
                const TILE: Tile = TILES[$tile];
                const BASE: usize = base(TILES, $tile);
                // SAFETY: the caller promises the instructions.
                unsafe {
                    let mut sums = [V::zero(); TILE.terms.len()];
                    let mut squares = [V::zero(); TILE.pairs.len()];
                    if FOLD {
                        $($(if fold!($how) {
                            sums[constant!(usize: TILE.slot(stringify!($third), stringify!($with)))] =
                                block.third_products(constant!(usize: cell(stringify!($third))));
                        })+)+
                    }
                    if FOLD {
                        for row in block.pairs() {
                            let next = row.next();
                            let (mut even, mut odd) = ([V::zero(); TILE.pairs.len()], [V::zero(); TILE.pairs.len()]);
                            $(
                                even[constant!(usize: TILE.pair(stringify!($pair)))] = row.pair(constant!([usize; 2]: cells(stringify!($pair))));
                                odd[constant!(usize: TILE.pair(stringify!($pair)))] = next.pair(constant!([usize; 2]: cells(stringify!($pair))));
                            )+
                            $({
                                let third = row.third(constant!(usize: cell(stringify!($third))));
                                let other = next.third(constant!(usize: cell(stringify!($third))));
                                $({
                                    let sum = &mut sums[constant!(usize: TILE.slot(stringify!($third), stringify!($with)))];
                                    let even = even[constant!(usize: TILE.pair(stringify!($with)))];
                                    let odd = odd[constant!(usize: TILE.pair(stringify!($with)))];
                                    *sum = if fold!($how) {
                                        sum.multiply_add(even.add_words(other), odd.add_words(third))
                                    } else {
                                        sum.multiply_add(even, third).multiply_add(odd, other)
                                    };
                                })+
                            })+
                            $(if constant!(bool: TILE.folds(stringify!($pair))) {
                                const PAIR: usize = TILE.pair(stringify!($pair));
                                squares[PAIR] = squares[PAIR].multiply_add(even[PAIR], odd[PAIR]);
                            })+
                        }
                    }
                    for row in block.singles() {
                        let mut pairs = [V::zero(); TILE.pairs.len()];
                        $(
                            pairs[constant!(usize: TILE.pair(stringify!($pair)))] = row.pair(constant!([usize; 2]: cells(stringify!($pair))));
                        )+
                        $({
                            let third = row.third(constant!(usize: cell(stringify!($third))));
                            $({
                                let sum = &mut sums[constant!(usize: TILE.slot(stringify!($third), stringify!($with)))];
                                *sum = sum.multiply_add(pairs[constant!(usize: TILE.pair(stringify!($with)))], third);
                            })+
                        })+
                    }
                    $($({
                        const SLOT: usize = TILE.slot(stringify!($third), stringify!($with));
                        let sum = if FOLD && fold!($how) {
                            sums[SLOT].subtract(squares[constant!(usize: TILE.pair(stringify!($with)))])
                        } else {
                            sums[SLOT]
                        };
                        block.add_total(BASE + SLOT, sum);
                    })+)+
                }
            })+
        }
    };
}

/// A value that is computed while compiling. (An item by itself; `const { }` blocks make the compiler take a minute.)
macro_rules! constant {
    ($type:ty: $value:expr) => {{
        const VALUE: $type = $value;
        VALUE
    }};
}

/// Whether a term's word says that it is folded.
macro_rules! fold {
    ($how:ident) => {
        constant!(bool: equal(stringify!($how), "fold"))
    };
}

/// For CPUs with 32 registers.
pub(super) struct Wide;

impl Plan for Wide {
    const TILES: &'static [Tile] = wide!(table);

    #[inline(always)]
    unsafe fn pass<V: Lanes, const FOLD: bool>(block: &mut Block<'_, V>) {
        const TILES: &[Tile] = Wide::TILES;
        wide!(passes);
        // SAFETY: the caller promises the instructions.
        unsafe { pass::<V, FOLD>(block) }
    }
}

/// For CPUs with 16 registers.
pub(super) struct Narrow;

impl Plan for Narrow {
    const TILES: &'static [Tile] = narrow!(table);

    #[inline(always)]
    unsafe fn pass<V: Lanes, const FOLD: bool>(block: &mut Block<'_, V>) {
        const TILES: &[Tile] = Narrow::TILES;
        narrow!(passes);
        // SAFETY: the caller promises the instructions.
        unsafe { pass::<V, FOLD>(block) }
    }
}
