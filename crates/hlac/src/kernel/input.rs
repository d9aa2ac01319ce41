//! [`Input`]: what one call of a kernel works on.

use std::ops::Range;

use crate::voxels::Shape;

/// Some successive window planes of a volume, and the voxels that they touch.
///
/// A volume may be one input, or several that are summed separately: by several threads, or because the volume does not
/// fit in memory. Sums are additive and the octants are those of the whole volume, so the results add up to the bit.
#[derive(Clone, Debug)]
pub(crate) struct Input<'a> {
    /// The whole volume's shape (Z, Y, X).
    pub(crate) shape: Shape,
    /// How far apart the cells of a window are, in voxels.
    pub(crate) spacing: usize,
    /// The window planes, as the Z of their first cells in the whole volume.
    pub(crate) windows: Range<usize>,
    /// The voxels of the planes `windows.start .. windows.end + 2 * spacing`.
    pub(crate) voxels: &'a [u8],
}

impl<'a> Input<'a> {
    /// All of a volume.
    ///
    /// # Panics
    /// If a side holds no window, or `voxels` does not have the length that the shape says.
    pub(crate) fn whole(shape: Shape, spacing: usize, voxels: &'a [u8]) -> Self {
        assert!(shape.iter().all(|&side| side > 2 * spacing), "no window fits {shape:?} at spacing {spacing}");
        assert_eq!(voxels.len(), shape.iter().product::<usize>(), "voxels of {shape:?}");
        Self { shape, spacing, windows: 0..shape[0] - 2 * spacing, voxels }
    }

    /// The number of windows of the whole volume along each axis.
    pub(crate) fn grid(&self) -> Shape {
        self.shape.map(|side| side - 2 * self.spacing)
    }

    /// The distance in `voxels` of neighbours along Z, Y and X.
    pub(crate) fn strides(&self) -> Shape {
        [self.shape[1] * self.shape[2], self.shape[2], 1]
    }

    /// The part of this input with `windows`, which must lie inside its own.
    pub(crate) fn part(&self, windows: Range<usize>) -> Input<'a> {
        let plane = self.strides()[0];
        let first = (windows.start - self.windows.start) * plane;
        let last = (windows.end - self.windows.start + 2 * self.spacing) * plane;
        Input { windows, voxels: &self.voxels[first..last], ..*self }
    }
}
