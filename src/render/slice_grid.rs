//! The slices of one volume side by side: which of them, how large, and where.

use std::fmt;
use std::ops::Range;

use super::SliceAxis;
use crate::volume::{Shape, Volume, blocks};

/// What a grid is asked for.
pub(super) struct GridRequest {
    /// The axis that slices are taken across.
    pub(super) axis: SliceAxis,
    /// The most slices; 0 counts as 1.
    pub(super) slices: usize,
    /// The most slices in a row; 0 counts as 1.
    pub(super) columns: usize,
    /// The longest side of a slice in pixels; 0 counts as 1.
    pub(super) pixels: u32,
    /// Pixels between neighbouring slices.
    pub(super) gap: usize,
    /// Pixels around the whole grid.
    pub(super) border: usize,
}

/// Slices in reading order, all of one size, spread evenly over the axis.
pub(super) struct SliceGrid {
    axis: SliceAxis,
    /// Slices across the axis, and how many of them are shown.
    length: usize,
    count: usize,
    columns: usize,
    /// Voxels of a slice: rows, columns.
    voxels: [usize; 2],
    scale: SliceScale,
    gap: usize,
    border: usize,
}

impl SliceGrid {
    pub(super) fn new(shape: Shape, request: &GridRequest) -> Self {
        let &GridRequest { axis, slices, columns, pixels, gap, border } = request;
        let (length, voxels) = (axis.slices(shape), axis.slice_shape(shape));
        let count = length.clamp(1, slices.max(1));
        let (columns, scale) = (columns.clamp(1, count), SliceScale::new(voxels, pixels));
        Self { axis, length, count, columns, voxels, scale, gap, border }
    }

    /// The same grid with rows of nearly equal length.
    pub(super) fn balanced(mut self) -> Self {
        self.columns = self.count.div_ceil(self.count.div_ceil(self.columns));
        self
    }

    /// How many slices are shown.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Width and height of one slice, in pixels.
    pub(super) fn slice_size(&self) -> (usize, usize) {
        (self.scale.pixels(self.voxels[1]), self.scale.pixels(self.voxels[0]))
    }

    /// Width and height of the grid, in pixels.
    pub(super) fn size(&self) -> (usize, usize) {
        let (width, height) = self.slice_size();
        let side = |count: usize, one: usize| {
            count.saturating_mul(one.saturating_add(self.gap)).saturating_add(2 * self.border).saturating_sub(self.gap)
        };
        (side(self.columns, width), side(self.count.div_ceil(self.columns), height))
    }

    /// Left and top of the slice `number`, in pixels.
    pub(super) fn position(&self, number: usize) -> (usize, usize) {
        let (width, height) = self.slice_size();
        let (column, row) = (number % self.columns, number / self.columns);
        (self.border + column * (width + self.gap), self.border + row * (height + self.gap))
    }

    /// The pixels of the slice `number`, row by row, with the volume's channels interleaved.
    pub(super) fn pixels(&self, volume: &Volume, number: usize) -> Vec<u8> {
        let index = (number as u128 * self.length as u128 / self.count as u128) as usize;
        self.scale.slice(volume, self.axis, index)
    }
}

impl fmt::Display for SliceGrid {
    /// `64 of 256 slices across Z, shown at 1:4`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count < self.length {
            write!(f, "{} of {} slices across {}", self.count, self.length, self.axis)?;
        } else {
            write!(f, "{} slices across {}", self.count, self.axis)?;
        }
        write!(f, ", shown at {}:{}", self.scale.enlarge, self.scale.shrink)
    }
}

/// How large a slice is drawn.
#[derive(Clone, Copy)]
pub(super) struct SliceScale {
    /// The side of the block of voxels that one pixel averages.
    shrink: usize,
    /// The side of the block of pixels that one voxel becomes. `shrink` or `enlarge` is 1.
    enlarge: usize,
}

impl SliceScale {
    /// The largest scale at which no side of a slice (rows, columns) is longer than `pixels` (0 counts as 1).
    pub(super) fn new(voxels: [usize; 2], pixels: u32) -> Self {
        let (longest, pixels) = (voxels[0].max(voxels[1]).max(1), pixels.max(1) as usize);
        Self { shrink: longest.div_ceil(pixels), enlarge: (pixels / longest).max(1) }
    }

    /// How many pixels a side of so many voxels becomes.
    pub(super) fn pixels(self, voxels: usize) -> usize {
        voxels.div_ceil(self.shrink).saturating_mul(self.enlarge)
    }

    /// The pixels of a slice at this scale, row by row, with the volume's channels interleaved.
    pub(super) fn slice(self, volume: &Volume, axis: SliceAxis, index: usize) -> Vec<u8> {
        let [rows, columns] = axis.slice_shape(volume.shape()).map(|side| self.ranges(side));
        slice_means(volume, axis, index, &rows, &columns)
    }

    /// The voxels that each pixel of a side shows.
    fn ranges(self, side: usize) -> Vec<Range<usize>> {
        blocks(side, self.shrink).into_iter().flat_map(|block| std::iter::repeat_n(block, self.enlarge)).collect()
    }
}

/// The means of boxes within one slice: one pixel for every pair of a range of rows and a range of columns.
pub(super) fn slice_means(
    volume: &Volume,
    axis: SliceAxis,
    index: usize,
    rows: &[Range<usize>],
    columns: &[Range<usize>],
) -> Vec<u8> {
    let one = index..index + 1;
    let slice = std::slice::from_ref(&one);
    volume.box_means(match axis {
        SliceAxis::Z => [slice, rows, columns],
        SliceAxis::Y => [rows, slice, columns],
        SliceAxis::X => [rows, columns, slice],
    })
}
