//! The plans as data: which pair serves which masks in which tile.
//!
//! A *tile* is what one pass over the voxels accumulates in registers. It multiplies a few *pairs* of cells (each named by
//! its two letters), then takes the *third* cells one by one, each with the pairs that form masks with it. The third
//! `one` has the value 1 in every window: it completes the masks of two cells.
//!
//! The tables are macros, because a tile's loop must name its registers: `wide!(with)` passes the table of the wide plan
//! to the macro `with`. This file turns the tables into constants, and [`super::tiles`] turns them into loops.

use crate::masks::{MASK_COUNT, MASKS};

/// One product that a tile accumulates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Term {
    /// The letter of the third cell, or `one`.
    pub(super) third: &'static str,
    /// The letters of the pair.
    pub(super) pair: &'static str,
    /// Whether folding kernels fold this product.
    pub(super) folded: bool,
}

impl Term {
    /// The mask that the product belongs to, as an index into [`MASKS`], and its third cell.
    pub(super) const fn place(&self) -> (usize, usize) {
        let third = cell(self.third);
        let [a, b] = cells(self.pair);
        let wanted = (1 << a | 1 << b | 1 << third) & !(1 << ONE);
        let mut mask = 0;
        while CELLS[mask] != wanted {
            mask += 1;
        }
        (mask, third)
    }
}

/// The cells of the masks, as bits.
const CELLS: [u32; MASK_COUNT] = {
    let mut bits = [0; MASK_COUNT];
    let mut mask = 0;
    while mask < MASK_COUNT {
        let mut at = 0;
        while at < MASKS[mask].order() {
            bits[mask] |= 1 << MASKS[mask].cells()[at];
            at += 1;
        }
        mask += 1;
    }
    bits
};

/// The products that are accumulated together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tile {
    /// The pairs of the tile.
    pub(super) pairs: &'static [&'static str],
    /// The products with their thirds, in the order of the loop.
    pub(super) terms: &'static [Term],
}

impl Tile {
    /// The place of a product among the tile's.
    pub(super) const fn slot(&self, third: &str, pair: &str) -> usize {
        let mut slot = 0;
        while !(equal(self.terms[slot].third, third) && equal(self.terms[slot].pair, pair)) {
            slot += 1;
        }
        slot
    }

    /// The place of a pair among the tile's.
    pub(super) const fn pair(&self, pair: &str) -> usize {
        let mut at = 0;
        while !equal(self.pairs[at], pair) {
            at += 1;
        }
        at
    }

    /// Whether any product of the pair is folded.
    pub(super) const fn folds(&self, pair: &str) -> bool {
        let mut at = 0;
        while at < self.terms.len() {
            if self.terms[at].folded && equal(self.terms[at].pair, pair) {
                return true;
            }
            at += 1;
        }
        false
    }
}

/// The number of terms of a plan: one for each mask except that of one cell.
pub(super) const TERMS: usize = MASK_COUNT - 1;

/// The masks and thirds of a plan's terms, in the order of the tiles.
pub(super) const fn slots(tiles: &[Tile]) -> [(usize, usize); TERMS] {
    let mut slots = [(0, 0); TERMS];
    let (mut tile, mut at) = (0, 0);
    while tile < tiles.len() {
        let mut term = 0;
        while term < tiles[tile].terms.len() {
            slots[at] = tiles[tile].terms[term].place();
            at += 1;
            term += 1;
        }
        tile += 1;
    }
    slots
}

/// The index of the third `one`, which follows the 27 cells.
pub(super) const ONE: usize = 27;

/// The index `9 z + 3 y + x` of a cell by its letter, [`ONE`] for `one`.
pub(super) const fn cell(letter: &str) -> usize {
    match letter.as_bytes() {
        [b'A'] => 26,
        [letter] => (*letter - b'a') as usize,
        _ => ONE,
    }
}

/// The two cells of a pair.
pub(super) const fn cells(pair: &str) -> [usize; 2] {
    let (first, second) = pair.split_at(1);
    [cell(first), cell(second)]
}

pub(super) const fn equal(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    let mut at = 0;
    while at < a.len() && at < b.len() && a[at] == b[at] {
        at += 1;
    }
    at == a.len() && at == b.len()
}

macro_rules! table {
    ($($tile:literal: $($pair:ident)+ { $($third:ident: $($how:ident $with:ident),+;)+ })+) => {
        &[$(Tile {
            pairs: &[$(stringify!($pair)),+],
            terms: &[$($(Term {
                third: stringify!($third),
                pair: stringify!($with),
                folded: equal(stringify!($how), "fold"),
            }),+),+],
        }),+]
    };
}
pub(super) use table;
macro_rules! wide {
    ($with:ident) => {
        $with! {
            0: ab km np {
                c: flat ab; f: fold ab; j: fold ab; k: fold ab, flat np; n: fold ab, fold km; q: fold km;
                l: fold ab, fold km, flat np; o: fold ab, fold km; one: flat ab;
            }
            1: ad nt sw {
                d: flat nt; g: fold ad, flat nt; b: flat ad; h: fold ad; p: flat ad, flat nt, fold sw;
                k: fold ad, fold sw; n: fold ad, fold sw; q: fold ad, fold sw; o: fold sw; r: fold sw; one: fold ad;
            }
            2: ae ms mu {
                a: fold ms; d: fold ae, fold ms; g: fold ae, flat ms; f: fold ae; i: flat ae;
                n: fold ae, fold ms, flat mu; q: fold ae, fold ms; w: fold ms, flat mu; z: fold ms;
                one: flat ae, fold ms;
            }
            3: ae mt {
                b: flat ae, fold mt; e: flat mt; h: fold ae, fold mt; c: fold ae; m: fold ae; p: flat ae;
                k: fold ae, flat mt; n: fold mt; l: flat ae, fold mt; o: fold ae, fold mt; r: fold ae; one: fold mt;
            }
            4: aj ak {
                c: fold ak; f: fold ak; k: fold aj; n: flat ak; l: flat ak; o: fold ak; s: flat aj, fold ak;
                v: fold aj; t: fold aj, fold ak; w: fold aj, flat ak; u: flat ak; x: fold ak; one: fold aj, fold ak;
            }
            5: am dj {
                a: fold dj; d: fold am; g: flat am; h: fold am; j: fold am; p: fold am; q: flat am; s: fold dj;
                v: flat am, flat dj; y: fold am; t: fold am, fold dj; w: fold am, fold dj; z: flat am; one: fold am;
            }
            6: an km {
                a: fold km; m: flat an; p: fold an, flat km; v: fold an, flat km; y: fold an, fold km;
                w: fold an, flat km; z: fold km; u: fold km; x: fold an, fold km; A: fold an; one: fold an, flat km;
            }
            7: an ns st {
                h: fold an; c: fold an, fold ns; f: fold an, fold ns; i: fold an, flat ns; j: fold an;
                l: flat an, fold ns, flat st; o: flat an, fold ns, flat st; r: fold an, fold ns; t: fold an;
            }
            8: an mt nu {
                d: fold mt, fold nu; g: flat an, fold mt, fold nu; p: fold mt, flat nu; q: flat an, fold mt;
                y: fold mt, fold nu; w: fold mt; z: flat an, fold mt; u: flat an, fold mt; x: fold mt;
            }
            9: bj dk lw {
                m: fold lw; p: fold lw; s: flat bj, fold dk, fold lw; v: flat bj, fold dk, fold lw;
                t: flat bj, fold dk; w: flat bj, fold dk; u: fold dk; x: fold dk;
            }
            10: bm ej {
                a: fold bm, flat ej; s: fold bm, flat ej; v: fold bm, fold ej; y: fold bm; t: fold ej;
                w: flat bm, fold ej; z: fold bm;
            }
            11: ks mn nv {
                b: fold ks, fold nv; e: fold ks; c: fold ks, flat nv; f: fold ks; m: flat ks;
                l: fold ks, flat mn, fold nv; o: flat ks; t: flat ks, fold nv; u: fold ks, fold nv; x: fold ks;
                one: fold ks;
            }
            12: kv ns {
                a: fold kv, fold ns; d: fold ns; g: fold ns; k: fold ns; n: flat kv; q: flat kv, fold ns;
                z: fold kv, fold ns; u: fold kv, flat ns; x: flat kv, flat ns; A: fold ns; one: fold kv, fold ns;
            }
            13: kv ny pw {
                b: fold kv, fold ny; e: fold kv; c: fold kv, flat ny; f: fold kv; p: fold kv; k: fold ny, flat pw;
                l: fold kv, flat ny; o: fold kv; y: fold kv; t: fold kv, fold ny, flat pw; w: fold kv; u: flat pw;
            }
            14: ms ns {
                b: flat ns; e: fold ms, flat ns; h: fold ms, fold ns; p: fold ms, fold ns; v: flat ms;
                y: fold ms, fold ns; t: fold ms, fold ns;
            }
            15: sv tv wy {
                m: fold tv; p: fold sv, fold tv; k: fold sv, flat wy; n: flat sv; q: fold sv, fold tv;
                l: fold tv, flat wy; o: fold tv;
            }
        }
    };
}
pub(super) use wide;

#[cfg(any(test, target_arch = "x86_64"))]
macro_rules! narrow {
    ($with:ident) => {
        $with! {
            0: ab lw {
                d: flat ab; c: flat ab; f: flat ab; j: flat ab; p: flat lw; l: flat ab; o: flat ab; s: flat lw;
                v: flat lw; y: flat lw; one: flat ab;
            }
            1: ad kv {
                g: flat ad; h: flat ad; c: flat kv; f: flat kv; m: flat ad; p: flat ad, flat kv; q: flat ad, flat kv;
                one: flat ad, flat kv;
            }
            2: ae mt {
                b: flat ae, flat mt; h: flat ae, flat mt; f: flat ae; i: flat ae; p: flat mt; l: flat ae; r: flat ae;
                one: flat ae, flat mt;
            }
            3: ae an {
                d: flat ae; g: flat ae, flat an; c: flat ae, flat an; p: flat ae; k: flat ae; q: flat ae, flat an;
                o: flat ae; A: flat an;
            }
            4: aj mt {
                d: flat aj; m: flat aj; k: flat aj, flat mt; s: flat aj; v: flat aj; t: flat aj; w: flat aj, flat mt;
                x: flat mt; one: flat aj;
            }
            5: ak mt {
                a: flat mt; d: flat ak, flat mt; c: flat ak; q: flat mt; o: flat ak; t: flat ak; w: flat ak;
                u: flat ak, flat mt; one: flat ak;
            }
            6: ak ks {
                b: flat ak, flat ks; e: flat ks; c: flat ks; f: flat ak, flat ks; l: flat ak, flat ks; u: flat ks;
                x: flat ak, flat ks;
            }
            7: am tv {
                g: flat am; e: flat am; h: flat am; p: flat tv; n: flat am, flat tv; q: flat tv; l: flat tv;
                o: flat tv; v: flat am; one: flat am;
            }
            8: am sw {
                b: flat am; p: flat am, flat sw; q: flat am, flat sw; o: flat sw; r: flat sw; s: flat am; y: flat am;
                w: flat am; z: flat am;
            }
            9: an ks {
                a: flat ks; f: flat an; n: flat ks; o: flat an, flat ks; t: flat an, flat ks; w: flat an, flat ks;
                one: flat an, flat ks;
            }
            10: an dk {
                d: flat an; j: flat an; k: flat an; r: flat an; s: flat dk; v: flat an; t: flat dk; w: flat dk;
                u: flat dk; x: flat an, flat dk;
            }
            11: an st {
                b: flat an; e: flat an; h: flat an; i: flat an; p: flat an; l: flat an, flat st; o: flat st;
                y: flat an; z: flat an; u: flat an;
            }
            12: bj ns {
                b: flat ns; f: flat ns; m: flat ns; r: flat ns; s: flat bj; v: flat bj, flat ns; t: flat bj, flat ns;
                w: flat bj, flat ns;
            }
            13: bm nt sv {
                d: flat nt; g: flat nt; m: flat nt; p: flat nt, flat sv; q: flat sv; v: flat bm; y: flat bm;
                w: flat bm; z: flat bm;
            }
            14: dj ln nv {
                b: flat nv; c: flat nv; m: flat ln; s: flat dj, flat ln; v: flat dj, flat ln; y: flat ln; t: flat dj;
                w: flat dj;
            }
            15: ej km {
                a: flat ej, flat km; n: flat km; q: flat km; s: flat ej; v: flat ej, flat km; t: flat ej;
                w: flat ej, flat km; z: flat km;
            }
            16: gn ns {
                e: flat ns; c: flat ns; i: flat ns; q: flat ns; s: flat gn; z: flat ns; u: flat gn, flat ns;
                x: flat ns; A: flat ns; one: flat ns;
            }
            17: km np {
                p: flat km; k: flat np; l: flat km, flat np; o: flat km; s: flat km, flat np; u: flat km, flat np;
                x: flat km; one: flat km;
            }
            18: kv ns {
                a: flat kv, flat ns; d: flat kv, flat ns; h: flat ns; o: flat kv, flat ns; y: flat kv, flat ns;
                t: flat kv; x: flat kv;
            }
            19: kv ky {
                b: flat kv; e: flat kv; m: flat ky; n: flat kv, flat ky; l: flat kv; s: flat kv; w: flat kv, flat ky;
                z: flat kv; u: flat kv;
            }
            20: ms pw {
                d: flat ms; b: flat ms; p: flat ms; k: flat pw; q: flat ms; y: flat ms; t: flat ms, flat pw;
                z: flat ms; u: flat pw; one: flat ms;
            }
            21: ms mt {
                g: flat ms, flat mt; e: flat ms, flat mt; h: flat ms; l: flat mt; o: flat mt; v: flat ms, flat mt;
                y: flat mt; z: flat mt;
            }
            22: mw nu ny {
                d: flat nu; b: flat ny; c: flat ny; m: flat nu; l: flat mw; s: flat mw; v: flat nu; t: flat ny;
                u: flat mw, flat ny;
            }
        }
    };
}
#[cfg(any(test, target_arch = "x86_64"))]
pub(super) use narrow;
