//! [`Rotation`]: the 24 right-angle rotations of a cube.

use super::field::volume;
use crate::volume::Volume;

/// A right-angle rotation of a volume: a permutation of the axes, some of them reversed.
///
/// Reflections are excluded: the sign of the permutation times the signs of the axes is +1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rotation {
    /// Axis `i` of the rotated volume runs along axis `from[i]` of the original (0 = Z, 1 = Y, 2 = X).
    from: [u8; 3],
    /// Whether axis `i` of the rotated volume is reversed.
    reversed: [bool; 3],
}

impl Rotation {
    /// The rotation that changes nothing; the first of [`Rotation::ALL`].
    pub const IDENTITY: Self = Self { from: [0, 1, 2], reversed: [false; 3] };

    /// All 24 rotations. They are a group: [`Rotation::then`] composes them, and each has an [`Rotation::inverse`].
    pub const ALL: [Self; 24] = all();

    /// The rotated volume. The axes of its shape are permuted too.
    pub fn apply(&self, original: &Volume) -> Volume {
        if *self == Self::IDENTITY {
            return original.clone();
        }
        let (old, channels) = (original.shape(), original.channels());
        let strides = [old[1] * old[2], old[2], 1];
        let from = self.from.map(usize::from);
        let shape = from.map(|axis| old[axis]);
        // The offset that a position along one axis of the result has in the original, in voxels.
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

    /// This rotation followed by `next`.
    pub fn then(&self, next: Self) -> Self {
        let pick = |axis: u8| usize::from(axis);
        Self {
            from: next.from.map(|axis| self.from[pick(axis)]),
            reversed: [0, 1, 2].map(|i| next.reversed[i] != self.reversed[pick(next.from[i])]),
        }
    }

    /// The rotation that undoes this one.
    pub fn inverse(&self) -> Self {
        let mut inverse = Self::IDENTITY;
        for (axis, &from) in (0..).zip(&self.from) {
            inverse.from[usize::from(from)] = axis;
            inverse.reversed[usize::from(from)] = self.reversed[usize::from(axis)];
        }
        inverse
    }
}

/// The six permutations, even ones first, with the signs that keep the orientation.
const fn all() -> [Rotation; 24] {
    const FROM: [[u8; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]];
    let mut rotations = [Rotation::IDENTITY; 24];
    let (mut filled, mut permutation) = (0, 0);
    while permutation < 6 {
        let mut signs = 0_u32;
        while signs < 8 {
            // An even permutation needs an even number of reversed axes, an odd one an odd number.
            if (signs.count_ones() % 2 == 1) == (permutation >= 3) {
                let reversed = [signs & 1 != 0, signs & 2 != 0, signs & 4 != 0];
                rotations[filled] = Rotation { from: FROM[permutation], reversed };
                filled += 1;
            }
            signs += 1;
        }
        permutation += 1;
    }
    rotations
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    fn ramp() -> Volume {
        Volume::from_fn([3, 4, 5], |z, y, x| (z * 20 + y * 5 + x) as u8).unwrap()
    }

    #[test]
    fn rotations_are_a_group_of_24() {
        let all: HashSet<Rotation> = Rotation::ALL.into_iter().collect();
        assert_eq!(all.len(), 24);
        for a in Rotation::ALL {
            assert_eq!(a.inverse().apply(&a.apply(&ramp())), ramp());
            assert_eq!(a.then(a.inverse()), Rotation::IDENTITY);
            for b in Rotation::ALL {
                assert!(all.contains(&a.then(b)));
                assert_eq!(b.apply(&a.apply(&ramp())), a.then(b).apply(&ramp()));
            }
        }
    }

    #[test]
    fn no_rotation_is_a_reflection() {
        for rotation in Rotation::ALL {
            let mut matrix = [[0_i32; 3]; 3];
            for i in 0..3 {
                matrix[i][usize::from(rotation.from[i])] = if rotation.reversed[i] { -1 } else { 1 };
            }
            let [a, b, c] = matrix;
            let determinant = a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                + a[2] * (b[0] * c[1] - b[1] * c[0]);
            assert_eq!(determinant, 1, "{rotation:?}");
        }
    }

    #[test]
    fn rotation_about_z() {
        let rotation = Rotation { from: [0, 2, 1], reversed: [false, true, false] };
        assert!(Rotation::ALL.contains(&rotation));
        let rotated = rotation.apply(&ramp());
        assert_eq!(rotated.shape(), [3, 5, 4]);
        // Row 0 is the last column of the original's first slice.
        assert_eq!(rotated.voxels()[..4], [4, 9, 14, 19]);
    }

    #[test]
    fn channels_stay_together() {
        let colour = Volume::new([3, 3, 3], 3, (0..81).collect()).unwrap();
        for rotation in Rotation::ALL {
            assert!(rotation.apply(&colour).voxels().chunks_exact(3).all(|p| p[1] == p[0] + 1 && p[2] == p[0] + 2));
        }
    }
}
