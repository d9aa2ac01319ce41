//! [`Turn`]: the 24 ways to turn a cube onto itself.

use super::field::volume;
use crate::volume::Volume;

/// A right-angle turn of a volume: where each axis of the result comes from, and which of them run backwards.
///
/// Only proper turns, no mirror images: the sign of the permutation times the signs of the axes is +1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Turn {
    /// Axis `i` of the turned volume runs along axis `from[i]` of the original (0 = Z, 1 = Y, 2 = X).
    from: [u8; 3],
    /// Whether axis `i` of the turned volume runs backwards.
    reversed: [bool; 3],
}

impl Turn {
    /// The turn that leaves everything where it is; the first of [`Turn::ALL`].
    pub const NONE: Self = Self { from: [0, 1, 2], reversed: [false; 3] };

    /// All 24: a group (closed under [`Turn::then`], each with its [`Turn::inverse`]).
    pub const ALL: [Self; 24] = all();

    /// The turned volume; a volume that is no cube changes its shape accordingly.
    pub fn apply(&self, original: &Volume) -> Volume {
        if *self == Self::NONE {
            return original.clone();
        }
        let (old, channels) = (original.shape(), original.channels());
        let strides = [old[1] * old[2], old[2], 1];
        let from = self.from.map(usize::from);
        let shape = from.map(|axis| old[axis]);
        // Offset of the voxel at a position of one axis of the result, in voxels of the original.
        let offset =
            |axis: usize, at: usize| strides[from[axis]] * if self.reversed[axis] { shape[axis] - 1 - at } else { at };
        let columns: Vec<usize> = (0..shape[2]).map(|x| offset(2, x)).collect();
        let mut voxels = Vec::with_capacity(original.voxels().len());
        for z in 0..shape[0] {
            for y in 0..shape[1] {
                let row = offset(0, z) + offset(1, y);
                for column in &columns {
                    voxels.extend_from_slice(&original.voxels()[(row + column) * channels..][..channels]);
                }
            }
        }
        volume(shape, channels, voxels)
    }

    /// This turn, then `next`.
    pub fn then(&self, next: Self) -> Self {
        let pick = |axis: u8| usize::from(axis);
        Self {
            from: next.from.map(|axis| self.from[pick(axis)]),
            reversed: [0, 1, 2].map(|i| next.reversed[i] != self.reversed[pick(next.from[i])]),
        }
    }

    /// The turn that undoes this one.
    pub fn inverse(&self) -> Self {
        let mut inverse = Self::NONE;
        for (axis, &from) in (0..).zip(&self.from) {
            inverse.from[usize::from(from)] = axis;
            inverse.reversed[usize::from(from)] = self.reversed[usize::from(axis)];
        }
        inverse
    }
}

/// The six permutations, even ones first, with the signs that keep the hand.
const fn all() -> [Turn; 24] {
    const FROM: [[u8; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let mut turns = [Turn::NONE; 24];
    let (mut filled, mut permutation) = (0, 0);
    while permutation < 6 {
        let mut signs = 0_u32;
        while signs < 8 {
            // An even permutation needs an even number of reversed axes, an odd one an odd number.
            if (signs.count_ones() % 2 == 1) == (permutation >= 3) {
                let reversed = [signs & 1 != 0, signs & 2 != 0, signs & 4 != 0];
                turns[filled] = Turn { from: FROM[permutation], reversed };
                filled += 1;
            }
            signs += 1;
        }
        permutation += 1;
    }
    turns
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    fn ramp() -> Volume {
        Volume::from_fn([3, 4, 5], |z, y, x| (z * 20 + y * 5 + x) as u8).unwrap()
    }

    #[test]
    fn they_are_a_group_of_24_that_acts_on_volumes() {
        let all: HashSet<Turn> = Turn::ALL.into_iter().collect();
        assert_eq!(all.len(), 24);
        for a in Turn::ALL {
            assert_eq!(a.inverse().apply(&a.apply(&ramp())), ramp());
            assert_eq!(a.then(a.inverse()), Turn::NONE);
            for b in Turn::ALL {
                assert!(all.contains(&a.then(b)));
                assert_eq!(b.apply(&a.apply(&ramp())), a.then(b).apply(&ramp()));
            }
        }
    }

    #[test]
    fn no_turn_is_a_mirror_image() {
        for turn in Turn::ALL {
            let mut matrix = [[0_i32; 3]; 3];
            for i in 0..3 {
                matrix[i][usize::from(turn.from[i])] = if turn.reversed[i] { -1 } else { 1 };
            }
            let [a, b, c] = matrix;
            let determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                + a[2] * (b[0] * c[1] - b[1] * c[0]);
            assert_eq!(determinant, 1, "{turn:?}");
        }
    }

    #[test]
    fn a_turn_about_z_does_what_it_says() {
        let turn = Turn { from: [0, 2, 1], reversed: [false, true, false] };
        assert!(Turn::ALL.contains(&turn));
        let turned = turn.apply(&ramp());
        assert_eq!(turned.shape(), [3, 5, 4]);
        // Row 0 is the last column of the original's first slice.
        assert_eq!(turned.voxels()[..4], [4, 9, 14, 19]);
    }

    #[test]
    fn colours_stay_together() {
        let colour = Volume::new([3, 3, 3], 3, (0..81).collect()).unwrap();
        for turn in Turn::ALL {
            assert!(turn.apply(&colour).voxels().chunks_exact(3).all(|p| p[1] == p[0] + 1 && p[2] == p[0] + 2));
        }
    }
}
