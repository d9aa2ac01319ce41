//! The slices of one volume, side by side: which of them, how large, and their pixels.

use std::fmt;

use super::Axis;
use crate::volume::Volume;

/// Pixels around every slice; neighbours share theirs.
const SEAM: u32 = 1;

/// Which slices of a volume are shown, and how.
pub(super) struct Mosaic {
    axis: Axis,
    /// Slices across the axis, and of these the ones that are shown.
    length: usize,
    count: usize,
    columns: u32,
    /// Voxels of a slice: rows, columns.
    voxels: [usize; 2],
    /// The side of the block of voxels that one pixel averages.
    shrink: usize,
    /// The side of the block of pixels that one voxel becomes. One of the two is 1.
    enlarge: u32,
}

impl Mosaic {
    /// At most `slices` slices in rows of at most `columns`, no side longer than `pixels`.
    pub(super) fn new(volume: &Volume, axis: Axis, slices: usize, columns: usize, pixels: u32) -> Self {
        let [z, y, x] = volume.shape();
        let (length, voxels) = match axis {
            Axis::Z => (z, [y, x]),
            Axis::Y => (y, [z, x]),
            Axis::X => (x, [z, y]),
        };
        let count = length.clamp(1, slices.max(1));
        let (longest, pixels) = (voxels[0].max(voxels[1]), pixels.max(1));
        let enlarge = u32::try_from(longest).map_or(1, |longest| (pixels / longest).max(1));
        // As many rows as needed, of lengths as equal as they can be.
        let columns = count.div_ceil(count.div_ceil(columns.max(1))) as u32;
        Self { axis, length, count, columns, voxels, shrink: longest.div_ceil(pixels as usize), enlarge }
    }

    /// Pixels of one slice: width, height.
    fn slice(&self) -> (u32, u32) {
        let side = |voxels: usize| voxels.div_ceil(self.shrink) as u32 * self.enlarge;
        (side(self.voxels[1]), side(self.voxels[0]))
    }

    /// Pixels of all: width, height.
    pub(super) fn size(&self) -> (u32, u32) {
        let (width, height) = self.slice();
        let rows = (self.count as u32).div_ceil(self.columns);
        let side = |count: u32, one: u32| count.saturating_mul(one.saturating_add(SEAM)).saturating_add(SEAM);
        (side(self.columns, width), side(rows, height))
    }

    /// Calls `pixel` with x, y and the colour of every pixel of every slice and, in the colour given, around it.
    pub(super) fn draw(&self, volume: &Volume, seam: [u8; 3], mut pixel: impl FnMut(u32, u32, [u8; 3])) {
        let (width, height) = self.slice();
        for number in 0..self.count {
            let (column, row) = (number as u32 % self.columns, number as u32 / self.columns);
            let (left, top) = (column * (width + SEAM), row * (height + SEAM));
            for y in 0..height + 2 * SEAM {
                for x in 0..width + 2 * SEAM {
                    pixel(left + x, top + y, seam);
                }
            }
            let (left, top) = (left + SEAM, top + SEAM);
            let place = self.place(number);
            for y in 0..height / self.enlarge {
                for x in 0..width / self.enlarge {
                    let colour = self.block(volume, place, y as usize, x as usize);
                    for dy in 0..self.enlarge {
                        for dx in 0..self.enlarge {
                            pixel(left + x * self.enlarge + dx, top + y * self.enlarge + dy, colour);
                        }
                    }
                }
            }
        }
    }

    /// Where on the axis the slice of that number is: spread evenly, the first at the start.
    fn place(&self, number: usize) -> usize {
        (number as u128 * self.length as u128 / self.count as u128) as usize
    }

    /// The mean colour of the voxels of one pixel, rounded; blocks at the far borders may be smaller.
    fn block(&self, volume: &Volume, place: usize, row: usize, column: usize) -> [u8; 3] {
        let range = |start: usize, end: usize| start * self.shrink..((start + 1) * self.shrink).min(end);
        let (mut sums, mut count) = ([0_u64; 3], 0);
        for row in range(row, self.voxels[0]) {
            for column in range(column, self.voxels[1]) {
                let colour = self.voxel(volume, place, row, column);
                sums = std::array::from_fn(|channel| sums[channel] + u64::from(colour[channel]));
                count += 1;
            }
        }
        sums.map(|sum| ((2 * sum + count) / (2 * count).max(1)) as u8)
    }

    fn voxel(&self, volume: &Volume, place: usize, row: usize, column: usize) -> [u8; 3] {
        let [z, y, x] = match self.axis {
            Axis::Z => [place, row, column],
            Axis::Y => [row, place, column],
            Axis::X => [row, column, place],
        };
        let [_, height, width] = volume.shape();
        let index = (z * height + y) * width + x;
        let voxels = volume.voxels();
        if volume.channels() == 1 { [voxels[index]; 3] } else { std::array::from_fn(|c| voxels[3 * index + c]) }
    }
}

impl fmt::Display for Mosaic {
    /// `64 of 256 slices across Z, shown at 1:4`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.count < self.length {
            write!(f, "{} of {} slices across {}", self.count, self.length, self.axis)?;
        } else {
            write!(f, "{} slices across {}", self.count, self.axis)?;
        }
        write!(f, ", shown at {}:{}", self.enlarge, self.shrink)
    }
}
