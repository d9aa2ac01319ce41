//! The loops of the plans: every tile of a plan over one block of packed voxels.
//!
//! One macro generates them from a plan's table. Every index in it is a constant, so that arrays become registers. The
//! code follows the order of the table, third by third, so that few registers are live at a time.

use super::block::Block;
use super::lanes::Lanes;
#[cfg(any(test, target_arch = "x86_64"))]
use super::plan::narrow;
use super::plan::{Term, Tile, cell, cells, equal, table, wide};

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

/// A value computed at compile time. It is an item of its own, because thousands of `const { }` blocks take the compiler a
/// minute.
macro_rules! constant {
    ($type:ty: $value:expr) => {{
        const VALUE: $type = $value;
        VALUE
    }};
}

/// The place of a term in its tile.
macro_rules! slot {
    ($tile:ident, $third:ident, $pair:ident) => {
        constant!(usize: $tile.slot(stringify!($third), stringify!($pair)))
    };
}

/// The place of a pair in its tile.
macro_rules! place {
    ($tile:ident, $pair:ident) => {
        constant!(usize: $tile.pair(stringify!($pair)))
    };
}

/// The products of a pair in a row.
macro_rules! product {
    ($row:ident, $pair:ident) => {
        $row.pair(constant!([usize; 2]: cells(stringify!($pair))))
    };
}

/// A third cell in a row.
macro_rules! third {
    ($row:ident, $third:ident) => {
        $row.third(constant!(usize: cell(stringify!($third))))
    };
}

/// Whether a term is marked as folded.
macro_rules! fold {
    ($how:ident) => {
        constant!(bool: equal(stringify!($how), "fold"))
    };
}

/// Generates [`Plan::pass`] from a plan's table.
macro_rules! passes {
    ($($tile:literal: $($pair:ident)+ { $($third:ident: $($how:ident $with:ident),+;)+ })+) => {
        #[inline(always)]
        unsafe fn pass<V: Lanes, const FOLD: bool>(block: &mut Block<'_, V>) {
            $({
                const TILE: Tile = TILES[$tile];
                const BASE: usize = base(TILES, $tile);
                // SAFETY: the caller promises that the CPU has the instructions of `V`.
                unsafe {
                    let mut sums = [V::zero(); TILE.terms.len()];
                    let mut squares = [V::zero(); TILE.pairs.len()];
                    if FOLD {
                        $($(if fold!($how) {
                            let products = block.third_products(constant!(usize: cell(stringify!($third))));
                            sums[slot!(TILE, $third, $with)] = products;
                        })+)+
                        for row in block.row_pairs() {
                            let next = row.next();
                            let mut even = [V::zero(); TILE.pairs.len()];
                            let mut odd = [V::zero(); TILE.pairs.len()];
                            $(
                                even[place!(TILE, $pair)] = product!(row, $pair);
                                odd[place!(TILE, $pair)] = product!(next, $pair);
                            )+
                            $({
                                let (third, other) = (third!(row, $third), third!(next, $third));
                                $({
                                    let sum = &mut sums[slot!(TILE, $third, $with)];
                                    let (even, odd) = (even[place!(TILE, $with)], odd[place!(TILE, $with)]);
                                    *sum = if fold!($how) {
                                        sum.multiply_add(even.add_words(other), odd.add_words(third))
                                    } else {
                                        sum.multiply_add(even, third).multiply_add(odd, other)
                                    };
                                })+
                            })+
                            $(if constant!(bool: TILE.folds(stringify!($pair))) {
                                let square = &mut squares[place!(TILE, $pair)];
                                *square = square.multiply_add(even[place!(TILE, $pair)], odd[place!(TILE, $pair)]);
                            })+
                        }
                    }
                    for row in block.single_rows() {
                        let mut pairs = [V::zero(); TILE.pairs.len()];
                        $(pairs[place!(TILE, $pair)] = product!(row, $pair);)+
                        $({
                            let third = third!(row, $third);
                            $({
                                let sum = &mut sums[slot!(TILE, $third, $with)];
                                *sum = sum.multiply_add(pairs[place!(TILE, $with)], third);
                            })+
                        })+
                    }
                    $($({
                        let sum = sums[slot!(TILE, $third, $with)];
                        let squares = if FOLD && fold!($how) { squares[place!(TILE, $with)] } else { V::zero() };
                        block.add_total(BASE + slot!(TILE, $third, $with), sum.subtract(squares));
                    })+)+
                }
            })+
        }
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
        // SAFETY: the caller promises that the CPU has the instructions of `V`.
        unsafe { pass::<V, FOLD>(block) }
    }
}

/// For CPUs with 16 registers.
#[cfg(any(test, target_arch = "x86_64"))]
pub(super) struct Narrow;

#[cfg(any(test, target_arch = "x86_64"))]
impl Plan for Narrow {
    const TILES: &'static [Tile] = narrow!(table);

    #[inline(always)]
    unsafe fn pass<V: Lanes, const FOLD: bool>(block: &mut Block<'_, V>) {
        const TILES: &[Tile] = Narrow::TILES;
        narrow!(passes);
        // SAFETY: the caller promises that the CPU has the instructions of `V`.
        unsafe { pass::<V, FOLD>(block) }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::plan::{ONE, slots};
    use super::*;
    use crate::{MASK_COUNT, MASKS};

    /// The registers that a tile keeps live: sums, products, and sums of folded pairs.
    fn registers(tile: &Tile, fold: bool) -> usize {
        let products = if fold { 2 } else { 1 } * tile.pairs.len();
        let squares = tile.pairs.iter().filter(|pair| fold && tile.folds(pair)).count();
        tile.terms.len() + products + squares
    }

    fn check(tiles: &[Tile], registers_of_the_cpu: usize, fold: bool) {
        let mut seen = BTreeSet::new();
        for (mask, third) in slots(tiles) {
            assert!(seen.insert(mask), "{} is there twice", MASKS[mask].letters());
            assert_eq!(third == ONE, MASKS[mask].order() == 2, "{}", MASKS[mask].letters());
        }
        assert_eq!(seen, (1..MASK_COUNT).collect(), "all masks except that of one cell");
        for tile in tiles {
            // At least two more: a third, and an intermediate sum.
            assert!(registers(tile, fold) + 2 <= registers_of_the_cpu, "{tile:?}");
            for term in tile.terms {
                assert!(tile.pairs.contains(&term.pair), "{term:?}");
            }
        }
    }

    #[test]
    fn the_wide_plan_has_every_mask_once_and_fits_32_registers() {
        check(Wide::TILES, 32, true);
    }

    #[test]
    fn the_narrow_plan_has_every_mask_once_and_fits_16_registers() {
        check(Narrow::TILES, 16, false);
    }
}
