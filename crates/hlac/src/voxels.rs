//! [`Voxels`] and [`VoxelBuf`]: grey voxels with their shape, borrowed and owned.

use crate::{ExtractError, MaskSpacing};

/// Axis lengths (Z, Y, X), as numpy writes them: X is fastest in memory.
pub(crate) type Shape = [usize; 3];

/// The most windows that a volume may have: a product of three intensities is below 2^24, so a `u64` holds the sum of
/// 2^40 of them.
const MAX_WINDOWS: u64 = 1 << 40;

/// A borrowed grey volume: `u8` voxels with their shape (Z, Y, X), X fastest in memory.
///
/// This is what the functions of this crate take. Making one checks the shape once and copies nothing.
///
/// Invariants: every side has at least 3 voxels, so that a window fits; the slice holds exactly `Z * Y * X` voxels.
///
/// ```
/// use hlac::{ExtractError, Voxels};
///
/// let slice = vec![7; 4 * 5 * 6];
/// let voxels = Voxels::new(&slice, [4, 5, 6])?;
/// assert_eq!(voxels.shape(), [4, 5, 6]);
/// assert!(Voxels::new(&slice, [4, 5, 7]).is_err());
/// # Ok::<(), ExtractError>(())
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Voxels<'a> {
    voxels: &'a [u8],
    shape: Shape,
}

impl<'a> Voxels<'a> {
    /// The voxels of a volume of `shape` (Z, Y, X), X fastest.
    ///
    /// # Errors
    /// - [`ExtractError::TooSmall`] if a side is under 3.
    /// - [`ExtractError::TooLarge`] if the number of voxels overflows.
    /// - [`ExtractError::Length`] if the slice does not hold `Z * Y * X` voxels.
    pub fn new(voxels: &'a [u8], shape: [usize; 3]) -> Result<Self, ExtractError> {
        let expected = check_shape(shape, MaskSpacing::One)?;
        if voxels.len() != expected {
            return Err(ExtractError::Length { shape, expected, found: voxels.len() });
        }
        Ok(Self { voxels, shape })
    }

    /// Axis lengths (Z, Y, X).
    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// The voxels, X fastest.
    pub fn as_slice(&self) -> &'a [u8] {
        self.voxels
    }
}

impl std::fmt::Debug for Voxels<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Voxels").field("shape", &self.shape).finish_non_exhaustive()
    }
}

/// An owned grey volume, such as a [view](crate::View::apply) of another one; [`Voxels`] borrows it.
#[derive(Clone, PartialEq, Eq)]
pub struct VoxelBuf {
    voxels: Vec<u8>,
    shape: Shape,
}

impl VoxelBuf {
    /// Takes over the voxels of a volume of `shape` (Z, Y, X), X fastest.
    ///
    /// # Errors
    /// As for [`Voxels::new`].
    pub fn new(voxels: Vec<u8>, shape: [usize; 3]) -> Result<Self, ExtractError> {
        Voxels::new(&voxels, shape)?;
        Ok(Self { voxels, shape })
    }

    /// Axis lengths (Z, Y, X).
    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// The voxels, borrowed with their shape.
    pub fn as_voxels(&self) -> Voxels<'_> {
        Voxels { voxels: &self.voxels, shape: self.shape }
    }

    /// The voxels, X fastest.
    pub fn into_vec(self) -> Vec<u8> {
        self.voxels
    }
}

impl std::fmt::Debug for VoxelBuf {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VoxelBuf").field("shape", &self.shape).finish_non_exhaustive()
    }
}

/// Checks that a window of this spacing fits a volume, and that its voxels can be counted and its sums held; returns
/// the number of voxels.
pub(crate) fn check_shape(shape: Shape, spacing: MaskSpacing) -> Result<usize, ExtractError> {
    let needed = 2 * spacing.voxels() + 1;
    if shape.iter().any(|&side| side < needed) {
        return Err(ExtractError::TooSmall { shape, spacing: spacing.voxels(), needed });
    }
    let count = shape.iter().try_fold(1_usize, |count, &side| count.checked_mul(side));
    match count {
        Some(count) if spacing.windows(shape) <= MAX_WINDOWS => Ok(count),
        _ => Err(ExtractError::TooLarge { shape }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_that_do_not_fit_the_slice_are_rejected() {
        let slice = [0; 27];
        assert_eq!(Voxels::new(&slice, [3, 3, 3]).unwrap().as_slice().len(), 27);
        let error = Voxels::new(&slice, [3, 3, 4]).unwrap_err();
        assert_eq!(error, ExtractError::Length { shape: [3, 3, 4], expected: 36, found: 27 });
        let error = Voxels::new(&slice, [27, 1, 1]).unwrap_err();
        assert_eq!(error, ExtractError::TooSmall { shape: [27, 1, 1], spacing: 1, needed: 3 });
        for shape in [[usize::MAX; 3], [usize::MAX / 2, 3, 3], [1 << 20, 1 << 20, 1 << 10]] {
            assert_eq!(Voxels::new(&slice, shape).unwrap_err(), ExtractError::TooLarge { shape });
        }
    }
}
