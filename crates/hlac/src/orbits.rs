//! The 18 orbits of the masks under the 48 symmetries of the cube.
//!
//! Turning or mirroring a volume permutes its masks (up to the windows at its borders): two masks are in one *orbit*
//! when some symmetry of the cube, followed by a translation, takes one to the other. What is averaged over an orbit
//! does not depend on how a texture is turned; how much a texture's masks differ *within* an orbit is the strength of
//! its anisotropy, and does not depend on its direction either.
//!
//! Orbits are numbered by their first mask in the paper's order. The numbers enter stored statistics: they are frozen.

use std::ops::Range;
use std::sync::LazyLock;

use super::masks::{MASK_COUNT, MASKS};

/// How many orbits there are.
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

/// The masks of orbit `orbit`, as indices into [`MASKS`], ascending; empty for numbers from [`ORBIT_COUNT`] on.
pub fn members(orbit: usize) -> &'static [u8] {
    layout().ranges.get(orbit).map_or(&[], |range| &layout().by_orbit[range.clone()])
}

/// Masks sorted by orbit: where an orbit's masks lie, so that loops over an orbit run over neighbours.
pub struct Layout {
    /// All mask indices, orbit after orbit, ascending within one.
    pub by_orbit: [u8; MASK_COUNT],
    /// The part of `by_orbit` that each orbit has.
    pub ranges: [Range<usize>; ORBIT_COUNT],
}

/// The one [`Layout`].
pub fn layout() -> &'static Layout {
    static LAYOUT: LazyLock<Layout> = LazyLock::new(|| {
        let mut by_orbit: [u8; MASK_COUNT] = std::array::from_fn(|mask| mask as u8);
        by_orbit.sort_by_key(|&mask| (ORBIT_OF[usize::from(mask)], mask));
        let before = |orbit: usize| ORBIT_OF.iter().filter(|&&other| usize::from(other) < orbit).count();
        Layout { by_orbit, ranges: std::array::from_fn(|orbit| before(orbit)..before(orbit + 1)) }
    });
    &LAYOUT
}

/// The 48 symmetries of the cube as permutations of the masks: mask `m` becomes mask `p[m]`.
///
/// For each order of the axes and each choice of their directions; the first is the identity.
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
                // The masks are all the patterns there are (tested there), so that the image is one of them.
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
    fn the_table_is_what_the_symmetries_give() {
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
    fn symmetries_are_permutations_that_keep_the_order() {
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
        assert!((0..ORBIT_COUNT).all(|o| members(o).iter().all(|&m| usize::from(ORBIT_OF[usize::from(m)]) == o)));
        assert!(members(ORBIT_COUNT).is_empty());
    }
}
