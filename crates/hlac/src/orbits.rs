//! The 18 orbits of the masks under the 48 symmetries of the cube.
//!
//! Rotating or mirroring a volume permutes its masks (up to the windows at its borders). Two masks are in one *orbit* if
//! some symmetry of the cube, followed by a translation, maps one to the other. The mean of a texture's moments over an
//! orbit is the same in all 48 orientations. So is their spread *within* an orbit, which measures how anisotropic the
//! texture is.
//!
//! Orbits are numbered in the order of their first masks, and are thereby sorted by number of cells. The numbers never
//! change: they may be stored.

use std::ops::Range;

use crate::{MASK_COUNT, MASKS};

/// The number of orbits.
pub const ORBIT_COUNT: usize = 18;

/// The orbit of each mask, in the order of [`MASKS`].
#[rustfmt::skip]
pub const ORBIT_OF: [u8; MASK_COUNT] = [
    0, 1, 2, 2, 3, 1, 2, 1, 2, 2, 3, 2, 3, 3, 4, 5, 6, 7, 8, 4, 9, 10, 7, 11, 12, 4, 10, 6, 6, 13, 14, 6, 4, 7, 8, 10,
    4, 7, 9, 11, 12, 13, 10, 13, 11, 15, 10, 16, 10, 13, 11, 16, 11, 17, 12, 4, 12, 8, 15, 8, 6, 12, 6, 4, 13, 12, 14,
    4, 12, 5, 10, 5, 6, 7, 10, 7, 11, 4, 8, 4, 9, 6, 10, 10, 8, 15, 10, 10, 16, 12, 12, 6, 14, 4, 4, 13, 4, 4, 13, 12,
    8, 4, 8, 5, 6, 7, 6, 5, 10, 7, 10, 4, 6, 6, 13, 7, 10, 10, 10, 15, 12, 8, 6, 5, 10, 6, 10, 6, 15, 13, 10, 7, 4,
    13, 4, 10, 10, 9, 10, 7, 11, 16, 4, 10, 7, 13, 10, 15, 13, 10, 11, 11, 16, 10, 7, 11, 6, 6, 13, 15, 4, 13, 7, 10,
    6, 12, 5, 8, 10, 13, 6, 6, 10, 10, 15, 7, 13, 10, 7, 11, 13, 11, 6, 15, 6, 6, 10, 15, 10, 16, 5, 10, 10, 16, 13,
    7, 10, 4, 10, 7, 13, 11, 13, 7, 10, 11, 4, 8, 7, 10, 9, 11, 16, 11, 17, 10, 13, 11, 15, 10, 16, 4, 13, 10, 7, 11,
    4, 7, 8, 10, 7, 10, 7, 10, 13, 13, 10, 10, 15, 11, 16, 11, 9, 11, 16, 11, 17, 11, 16, 11, 17,
];

/// All masks, as indices into [`MASKS`], orbit after orbit and ascending within one: [`range`] says where an orbit lies.
pub static BY_ORBIT: [u8; MASK_COUNT] = sort_by_orbit().0;

/// Where each orbit begins in [`BY_ORBIT`], and where the last one ends.
const BOUNDS: [usize; ORBIT_COUNT + 1] = sort_by_orbit().1;

const fn sort_by_orbit() -> ([u8; MASK_COUNT], [usize; ORBIT_COUNT + 1]) {
    let (mut masks, mut bounds) = ([0; MASK_COUNT], [0; ORBIT_COUNT + 1]);
    let (mut orbit, mut at) = (0, 0);
    while orbit < ORBIT_COUNT {
        let mut mask = 0;
        while mask < MASK_COUNT {
            if ORBIT_OF[mask] as usize == orbit {
                masks[at] = mask as u8;
                at += 1;
            }
            mask += 1;
        }
        orbit += 1;
        bounds[orbit] = at;
    }
    (masks, bounds)
}

/// Where the masks of an orbit lie in [`BY_ORBIT`]; empty for numbers from [`ORBIT_COUNT`] on.
pub fn range(orbit: usize) -> Range<usize> {
    match BOUNDS.get(orbit..) {
        Some(&[start, end, ..]) => start..end,
        _ => MASK_COUNT..MASK_COUNT,
    }
}

/// The masks of an orbit, as indices into [`MASKS`], ascending; empty for numbers from [`ORBIT_COUNT`] on.
pub fn members(orbit: usize) -> &'static [u8] {
    &BY_ORBIT[range(orbit)]
}

/// The 48 symmetries of the cube as permutations `p` of the masks: mask `m` becomes mask `p[m]`.
///
/// There is one for each order of the axes and each choice of their directions; the first is the identity.
pub fn symmetries() -> Vec<[u8; MASK_COUNT]> {
    const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let canonical = MASKS.map(|mask| pattern(mask.offsets()));
    let mut symmetries = Vec::with_capacity(48);
    for order in ORDERS {
        for mirrored in 0..8 {
            let image = |offset: [usize; 3]| {
                let along = |axis: usize| match mirrored >> axis & 1 {
                    0 => offset[order[axis]],
                    _ => 2 - offset[order[axis]],
                };
                [along(0), along(1), along(2)]
            };
            symmetries.push(std::array::from_fn(|mask| {
                let moved = pattern(MASKS[mask].offsets().map(image));
                // The masks are all the patterns that exist (tested in `masks`), so the image is one of them.
                canonical.iter().position(|&other| other == moved).unwrap_or(mask) as u8
            }));
        }
    }
    symmetries
}

/// A set of cells up to translation: bit `9 z + 3 y + x` for each cell, moved to the window's first corner.
fn pattern(offsets: impl Iterator<Item = [usize; 3]>) -> u32 {
    let offsets: Vec<_> = offsets.collect();
    let low = |axis: usize| offsets.iter().map(|offset| offset[axis]).min().unwrap_or(0);
    let low = [low(0), low(1), low(2)];
    offsets.iter().fold(0, |bits, o| bits | 1 << (9 * (o[0] - low[0]) + 3 * (o[1] - low[1]) + (o[2] - low[2])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_follows_from_the_symmetries() {
        let symmetries = symmetries();
        assert_eq!(symmetries.len(), 48);
        let mut orbit_of = [u8::MAX; MASK_COUNT];
        let mut next = 0;
        for mask in 0..MASK_COUNT {
            if orbit_of[mask] == u8::MAX {
                for symmetry in &symmetries {
                    orbit_of[usize::from(symmetry[mask])] = next;
                }
                next += 1;
            }
        }
        assert_eq!(usize::from(next), ORBIT_COUNT);
        assert_eq!(orbit_of, ORBIT_OF);
    }

    #[test]
    fn symmetries_are_permutations_that_preserve_the_number_of_cells() {
        for symmetry in symmetries() {
            let mut seen = symmetry;
            seen.sort_unstable();
            assert!(seen.iter().enumerate().all(|(at, &mask)| at == usize::from(mask)));
            assert!((0..MASK_COUNT).all(|m| MASKS[m].order() == MASKS[usize::from(symmetry[m])].order()));
        }
    }

    #[test]
    fn orbits_partition_the_masks_and_one_has_a_single_mask() {
        let sizes: Vec<usize> = (0..ORBIT_COUNT).map(|orbit| members(orbit).len()).collect();
        assert_eq!(sizes.iter().sum::<usize>(), MASK_COUNT);
        assert_eq!(sizes.iter().filter(|&&size| size > 1).count(), 17);
        for orbit in 0..ORBIT_COUNT {
            assert!(members(orbit).is_sorted());
            assert!(members(orbit).iter().all(|&mask| usize::from(ORBIT_OF[usize::from(mask)]) == orbit));
        }
        assert!(members(ORBIT_COUNT).is_empty() && members(usize::MAX).is_empty());
    }
}
