//! The plan as data: which pair serves which masks in which tile.
//!
//! A *tile* is what one pass over the voxels accumulates in registers. It multiplies a few *pairs* of cells (each named by
//! its two letters), then takes the *third* cells one by one, each with the pairs that make masks with it. A third of
//! `one` has the value 1 in every window: it completes the masks of order 2.
//!
//! The tables are written as macros, because a tile's loop must name its registers: `wide!(with)` hands the table of
//! the wide plan to the macro `with`. This file makes constants of them, [`super::tiles`] makes loops.

use crate::hlac::masks::{MASK_COUNT, MASKS};

/// One product that a tile accumulates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Term {
    /// The letter of the third cell, or `one`.
    pub(super) third: &'static str,
    /// The letters of the pair.
    pub(super) pair: &'static str,
    /// Whether a folding kernel folds it.
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
    /// The pairs that are multiplied.
    pub(super) pairs: &'static [&'static str],
    /// What they are multiplied with, in the order of the loop.
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

/// How many terms a plan has: all masks but that of one cell.
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

/// The index that stands for the third `one`: the one after the 27 cells.
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
            0: ab kv pw {
                c: fold ab; f: fold ab; k: fold ab, flat pw; n: fold ab, fold kv; l: fold ab, fold kv, flat pw;
                o: fold ab; t: fold kv, flat pw; z: fold kv; u: fold kv, flat pw; one: flat ab, fold kv;
            }
            1: ad km np {
                a: fold km, flat np; g: fold ad; b: fold ad; h: fold ad; p: flat ad, fold km; k: flat np;
                n: fold ad, fold km; q: fold ad, flat km; l: flat np; o: fold km; z: fold km; one: fold ad, fold km;
            }
            2: ae ak {
                d: fold ae, flat ak; g: flat ae; h: fold ae; c: fold ak; f: flat ak; k: fold ae; n: fold ae, fold ak;
                l: fold ae, fold ak; o: flat ak; t: fold ak; w: fold ak; u: fold ak; x: fold ak;
                one: fold ae, flat ak;
            }
            3: ae kv {
                a: fold kv; b: flat ae, fold kv; e: fold kv; c: fold ae, fold kv; f: fold ae, fold kv; i: flat ae;
                p: fold ae, flat kv; q: flat ae, flat kv; o: fold ae, fold kv; r: fold ae; x: fold kv;
            }
            4: aj sv sw {
                e: fold aj; m: fold aj; p: flat sv, fold sw; k: flat aj, fold sw; n: fold aj; q: flat sv, fold sw;
                l: fold sw; o: fold sw; r: fold sw; s: fold aj; v: flat aj; t: fold aj; w: flat aj; one: fold aj;
            }
            5: am ej mt {
                e: fold am, flat mt; h: fold am, flat mt; p: fold am; o: flat mt; s: fold am, fold ej;
                v: fold am, fold ej; t: fold am, fold ej; w: fold am, fold ej; z: flat mt; one: fold am, flat mt;
            }
            6: am an st {
                d: fold am; g: fold am, fold an; n: fold am, flat st; q: fold am, flat an; l: fold an, flat st;
                o: flat an, flat st; s: fold an; y: fold am, fold an; w: fold an; z: fold am, fold an;
            }
            7: an ns {
                e: fold ns; h: fold an, fold ns; c: flat an, fold ns; f: fold an; i: flat an, flat ns; o: fold ns;
                r: fold an, fold ns; u: fold an, fold ns; x: fold an; A: flat an, fold ns; one: flat an, fold ns;
            }
            8: bj ms {
                a: fold bj; d: fold ms; g: flat ms; b: flat ms; e: fold ms; h: flat ms; p: fold ms; n: fold ms;
                q: fold ms; s: flat bj; v: fold bj, fold ms; y: fold ms; t: fold bj, fold ms; w: fold bj, flat ms;
                z: fold ms; one: fold ms;
            }
            9: bm dj nt {
                a: flat bm, fold dj, flat nt; d: fold nt; g: fold nt; p: flat nt; s: fold dj;
                v: flat bm, fold dj, fold nt; y: fold bm; t: fold dj; w: fold bm, fold dj; z: fold bm;
            }
            10: dk km mw wy {
                k: flat wy; l: flat wy; s: fold km; v: fold km; y: fold km; t: fold dk, fold km; w: fold dk, fold km;
                u: fold dk, fold km, flat mw; x: flat dk, fold km;
            }
            11: ks ns nv {
                a: fold ks, flat nv; d: fold ks; b: fold ks, flat nv; e: fold ks; c: fold ks, flat nv;
                f: fold ks, flat ns; k: flat ns; l: fold ks; o: fold ks; v: fold ks; t: fold ks; u: fold ks;
                x: fold ks, flat ns; one: fold ks;
            }
            12: kv ns tv {
                d: flat kv, fold ns; g: fold ns; b: fold ns; p: fold ns, fold tv; q: fold ns, fold tv;
                l: fold ns, fold tv; o: flat tv; v: flat ns; y: flat kv, fold ns; w: flat kv, fold ns; z: fold ns;
            }
            13: lm lv ny {
                b: fold ny; c: fold ny; k: fold lm, fold ny; n: fold lm, flat lv; l: fold ny; t: fold lm, fold ny;
                w: flat lm, flat lv;
            }
            14: mt nu {
                d: fold mt, fold nu; g: flat mt, fold nu; b: flat mt; m: fold nu; p: flat mt, fold nu; n: fold mt;
                q: fold mt; v: fold mt, fold nu; y: flat mt, flat nu; w: fold mt; u: fold mt; x: fold mt;
            }
        }
    };
}
pub(super) use wide;

macro_rules! narrow {
    ($with:ident) => {
        $with! {
            0: ab lw {
                d: flat ab; e: flat ab; c: flat ab; f: flat ab; p: flat lw; k: flat ab; l: flat ab; o: flat ab;
                v: flat lw; y: flat lw; one: flat ab;
            }
            1: ad sv {
                g: flat ad; e: flat ad; h: flat ad; j: flat ad; p: flat ad, flat sv; n: flat ad, flat sv;
                q: flat ad, flat sv; one: flat ad;
            }
            2: ae {
                g: flat ae; h: flat ae; c: flat ae; f: flat ae; i: flat ae; j: flat ae; p: flat ae; q: flat ae;
                l: flat ae; o: flat ae; r: flat ae; one: flat ae;
            }
            3: aj dj {
                m: flat aj; k: flat aj; s: flat aj, flat dj; v: flat aj, flat dj; t: flat aj, flat dj;
                w: flat aj, flat dj; one: flat aj;
            }
            4: ak {
                e: flat ak; c: flat ak; f: flat ak; m: flat ak; l: flat ak; o: flat ak; v: flat ak; t: flat ak;
                w: flat ak; u: flat ak; x: flat ak; one: flat ak;
            }
            5: am {
                d: flat am; g: flat am; e: flat am; h: flat am; p: flat am; n: flat am; q: flat am; v: flat am;
                y: flat am; t: flat am; z: flat am; one: flat am;
            }
            6: an kn {
                a: flat kn; m: flat kn; p: flat an, flat kn; o: flat an; s: flat an, flat kn; v: flat kn; x: flat an;
                A: flat an; one: flat an;
            }
            7: an {
                g: flat an; b: flat an; e: flat an; h: flat an; c: flat an; f: flat an; i: flat an; j: flat an;
                q: flat an; r: flat an; y: flat an; w: flat an; z: flat an;
            }
            8: bj bm {
                a: flat bj, flat bm; s: flat bj, flat bm; v: flat bj, flat bm; y: flat bm; t: flat bj, flat bm;
                w: flat bj, flat bm; z: flat bm;
            }
            9: dk nt {
                a: flat dk, flat nt; d: flat nt; g: flat nt; m: flat nt; p: flat nt; v: flat dk; t: flat dk;
                w: flat dk; u: flat dk; x: flat dk;
            }
            10: ej kw pw {
                k: flat pw; s: flat ej, flat kw, flat pw; v: flat ej, flat kw; y: flat kw; t: flat ej, flat pw;
                w: flat ej; u: flat pw;
            }
            11: km {
                p: flat km; q: flat km; l: flat km; o: flat km; v: flat km; y: flat km; t: flat km; w: flat km;
                z: flat km; u: flat km; x: flat km; one: flat km;
            }
            12: ks {
                a: flat ks; d: flat ks; b: flat ks; e: flat ks; c: flat ks; f: flat ks; l: flat ks; o: flat ks;
                v: flat ks; u: flat ks; x: flat ks; one: flat ks;
            }
            13: kv {
                b: flat kv; e: flat kv; c: flat kv; f: flat kv; p: flat kv; q: flat kv; l: flat kv; o: flat kv;
                y: flat kv; z: flat kv; u: flat kv; x: flat kv; one: flat kv;
            }
            14: ln nu {
                a: flat ln, flat nu; d: flat nu; g: flat nu; m: flat ln, flat nu; p: flat ln, flat nu;
                s: flat ln, flat nu; y: flat nu;
            }
            15: ms {
                a: flat ms; d: flat ms; g: flat ms; e: flat ms; h: flat ms; p: flat ms; k: flat ms; q: flat ms;
                v: flat ms; y: flat ms; z: flat ms; one: flat ms;
            }
            16: mt {
                d: flat mt; g: flat mt; e: flat mt; h: flat mt; p: flat mt; q: flat mt; l: flat mt; o: flat mt;
                v: flat mt; y: flat mt; w: flat mt; z: flat mt; u: flat mt; x: flat mt; one: flat mt;
            }
            17: mw nv sw {
                a: flat mw, flat nv; b: flat nv; c: flat nv; m: flat sw; q: flat sw; l: flat mw, flat nv, flat sw;
                o: flat sw; r: flat sw; u: flat mw, flat nv;
            }
            18: ns st {
                c: flat ns; f: flat ns; m: flat ns, flat st; p: flat ns; k: flat st; l: flat st; o: flat ns, flat st;
                w: flat ns; z: flat ns; one: flat ns;
            }
            19: ns {
                d: flat ns; g: flat ns; b: flat ns; e: flat ns; h: flat ns; i: flat ns; q: flat ns; r: flat ns;
                y: flat ns; t: flat ns; x: flat ns; A: flat ns;
            }
            20: ny tv {
                b: flat ny; c: flat ny; p: flat tv; k: flat ny, flat tv; n: flat tv; q: flat tv; l: flat ny, flat tv;
                o: flat tv; t: flat ny;
            }
        }
    };
}
pub(super) use narrow;
