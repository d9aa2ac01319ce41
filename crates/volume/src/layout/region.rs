//! [`Region`]: a box of voxels as runs of samples in a file, and how they are brought into the order of a volume.

use super::Axes;
use crate::Shape;

/// One axis of a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Run {
    /// The number of samples.
    length: usize,
    /// The distance from one to the next in the file, in samples.
    from: usize,
    /// The distance from one to the next in the box.
    to: usize,
}

/// A box of voxels, or a part of one: its axes, the slowest of the file first, and where its first sample is.
#[derive(Debug, Clone)]
pub(super) struct Region {
    runs: Vec<Run>,
    /// The place of the first sample in the file, in samples.
    pub(super) from: usize,
    /// The place of the first sample in the box.
    to: usize,
}

/// A part whose samples span at most this many bytes of the file is read at once.
const SMALL: usize = 32 << 10;

/// A larger part is read at once if it spans at most this many bytes and is not sparse.
const LARGE: usize = 64 << 20;

/// A part is sparse if fewer than one in this many samples of its span belong to it.
const SPARSE: usize = 8;

impl Region {
    /// The box of `shape` voxels at `origin`, which must lie inside the volume.
    pub(super) fn new(axes: &Axes, origin: Shape, shape: Shape) -> Self {
        let lengths = [shape[0], shape[1], shape[2], axes.channels];
        let row = shape[2] * axes.channels;
        let to = [shape[1] * row, row, axes.channels, 1];
        let from = origin.iter().zip(axes.strides).map(|(&at, stride)| at * stride).sum();
        let mut runs: Vec<Run> = (0..4)
            .map(|axis| Run { length: lengths[axis], from: axes.strides[axis], to: to[axis] })
            .filter(|run| run.length > 1)
            .collect();
        runs.sort_by_key(|run| std::cmp::Reverse(run.from));
        let mut region = Self { runs, from, to: 0 };
        region.merge();
        region
    }

    /// Joins axes that are one run both in the file and in the box.
    fn merge(&mut self) {
        let mut merged: Vec<Run> = Vec::with_capacity(4);
        for inner in self.runs.drain(..) {
            match merged.last_mut() {
                Some(outer) if outer.from == inner.from * inner.length && outer.to == inner.to * inner.length => {
                    *outer = Run { length: outer.length * inner.length, ..inner };
                }
                _ => merged.push(inner),
            }
        }
        self.runs = merged;
    }

    /// Samples of the region.
    pub(super) fn count(&self) -> usize {
        self.runs.iter().map(|run| run.length).product()
    }

    /// Samples of the file from the first of the region to the last.
    pub(super) fn span(&self) -> usize {
        1 + self.runs.iter().map(|run| (run.length - 1) * run.from).sum::<usize>()
    }

    /// Whether the samples follow one another in the file, in the order of the box.
    pub(super) fn is_one_run(&self) -> bool {
        match self.runs[..] {
            [] => true,
            [run] => run.from == 1 && run.to == 1,
            _ => false,
        }
    }

    /// Calls `read` with parts of the region that are worth reading at once, in the order of the file.
    pub(super) fn parts<E>(&self, size: usize, read: &mut impl FnMut(&Self) -> Result<(), E>) -> Result<(), E> {
        let span = self.span().saturating_mul(size);
        let dense = span <= LARGE && self.span() <= self.count().saturating_mul(SPARSE);
        let slowest = self.runs.first().copied().filter(|_| span > SMALL && !dense);
        let Some(slowest) = slowest else { return read(self) };
        let half = slowest.length / 2;
        let half_of = |length, skipped| {
            let mut part = self.clone();
            part.from += skipped * slowest.from;
            part.to += skipped * slowest.to;
            if length > 1 {
                if let Some(run) = part.runs.first_mut() {
                    run.length = length;
                }
            } else {
                part.runs.remove(0);
            }
            part
        };
        half_of(half, 0).parts(size, read)?;
        half_of(slowest.length - half, half).parts(size, read)
    }

    /// Puts the samples of a part, each of `size` bytes, into their places in the box. `span` holds the bytes of the file
    /// from the first sample of the part to the last.
    pub(super) fn scatter(&self, size: usize, span: &[u8], target: &mut [u8]) {
        match size {
            1 => self.scatter_sized::<1>(span, target),
            2 => self.scatter_sized::<2>(span, target),
            4 => self.scatter_sized::<4>(span, target),
            _ => self.scatter_sized::<8>(span, target),
        }
    }

    fn scatter_sized<const N: usize>(&self, span: &[u8], target: &mut [u8]) {
        let (from, to) = (span.as_chunks::<N>().0, target.as_chunks_mut::<N>().0);
        let [a, b, c, d] = self.four_runs();
        for (i, j) in (0..a.length).flat_map(|i| (0..b.length).map(move |j| (i, j))) {
            let (from_start, to_start) = (i * a.from + j * b.from, self.to + i * a.to + j * b.to);
            if d.from == 1 && d.to == 1 {
                for k in 0..c.length {
                    let (from_row, to_row) = (from_start + k * c.from, to_start + k * c.to);
                    let row = from.get(from_row..from_row + d.length);
                    if let (Some(row), Some(place)) = (row, to.get_mut(to_row..to_row + d.length)) {
                        place.copy_from_slice(row);
                    }
                }
            } else {
                transpose(from, to, from_start, to_start, [c, d]);
            }
        }
    }

    /// The axes as four, the last one the fastest of the file and the one before it the fastest of the box.
    fn four_runs(&self) -> [Run; 4] {
        let mut runs = [Run { length: 1, from: 0, to: 0 }; 4];
        let padding = runs.len() - self.runs.len().min(4);
        for (place, run) in runs.iter_mut().skip(padding).zip(&self.runs) {
            *place = *run;
        }
        let nearest = (padding..4).min_by_key(|&axis| runs[axis].to).unwrap_or(3);
        if nearest < 2 {
            runs.swap(nearest, 2);
        }
        runs
    }
}

/// Copies samples along two axes, in tiles, so that neither the reads nor the writes of a tile are far apart.
fn transpose<const N: usize>(
    from: &[[u8; N]],
    to: &mut [[u8; N]],
    from_start: usize,
    to_start: usize,
    [outer, inner]: [Run; 2],
) {
    const TILE: usize = 32;
    let tiles = (0..inner.length).step_by(TILE).flat_map(|l| (0..outer.length).step_by(TILE).map(move |k| (l, k)));
    for (first_l, first_k) in tiles {
        for l in first_l..inner.length.min(first_l + TILE) {
            for k in first_k..outer.length.min(first_k + TILE) {
                let (at, place) =
                    (from_start + l * inner.from + k * outer.from, to_start + l * inner.to + k * outer.to);
                if let (Some(sample), Some(place)) = (from.get(at), to.get_mut(place)) {
                    *place = *sample;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{Axis, dense};
    use super::*;

    /// The bytes of a box, read part by part as a reader does.
    fn read(file: &[u8], axes: &Axes, size: usize, origin: Shape, shape: Shape) -> Vec<u8> {
        let region = Region::new(axes, origin, shape);
        let mut target = vec![0; region.count() * size];
        let mut last = 0;
        let parts = region.parts::<()>(size, &mut |part| {
            assert!(part.from >= last, "parts come in the order of the file");
            last = part.from;
            let bytes = &file[part.from * size..][..part.span() * size];
            part.scatter(size, bytes, &mut target);
            Ok(())
        });
        parts.unwrap();
        target
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(128))]
        /// Whatever the order of the axes in the file, the samples of a box end up where their voxel is.
        #[test]
        fn any_order_of_axes_becomes_that_of_a_volume(
            order in Just(vec![0_usize, 1, 2, 3]).prop_shuffle(),
            shape in prop::array::uniform3(3_usize..40),
            corners in prop::array::uniform6(any::<prop::sample::Index>()),
            colour in any::<bool>(),
            size in prop::sample::select(vec![1_usize, 2, 4, 8]),
        ) {
            let channels = if colour { 3 } else { 1 };
            let lengths = [shape[0], shape[1], shape[2], channels];
            let stored = dense(order.iter().map(|&axis| lengths[axis] as u64));
            let mut found = vec![Axis { length: 0, stride: 0 }; 4];
            order.iter().zip(&stored).for_each(|(&axis, &is)| found[axis] = is);
            let axes = Axes::of_array(if colour { &found } else { &found[..3] }, u64::MAX).unwrap();
            // Each sample holds its own place in the file.
            let count = lengths.iter().product::<usize>();
            let file: Vec<u8> = (0..count as u64).flat_map(|place| place.to_le_bytes()[..size].to_vec()).collect();
            let pair = |axis: usize| {
                let (a, b) = (corners[axis].index(shape[axis]), corners[axis + 3].index(shape[axis]));
                (a.min(b), a.max(b) + 1)
            };
            let [(z0, z1), (y0, y1), (x0, x1)] = [pair(0), pair(1), pair(2)];
            for (origin, part) in [([0; 3], shape), ([z0, y0, x0], [z1 - z0, y1 - y0, x1 - x0])] {
                let bytes = read(&file, &axes, size, origin, part);
                for (index, sample) in bytes.chunks(size).enumerate() {
                    let [_, height, width] = part;
                    let position = [
                        origin[0] + index / channels / width / height,
                        origin[1] + index / channels / width % height,
                        origin[2] + index / channels % width,
                        index % channels,
                    ];
                    let place: u128 = position.iter().zip(&found).map(|(&at, axis)| at as u128 * axis.stride).sum();
                    prop_assert_eq!(sample, &(place as u64).to_le_bytes()[..size]);
                }
            }
        }
    }

    #[test]
    fn a_box_of_a_large_file_is_read_in_small_parts() {
        // A file of 2000 x 2000 x 2000 samples in the order of a volume, and in the order of Fortran.
        for strides in [[4_000_000, 2000, 1], [1, 2000, 4_000_000]] {
            let found = strides.map(|stride| Axis { length: 2000, stride });
            let axes = Axes::of_array(&found, u64::MAX).unwrap();
            let region = Region::new(&axes, [1000, 500, 1900], [64; 3]);
            let (mut parts, mut samples, mut bytes) = (0, 0, 0);
            let all = region.parts::<()>(2, &mut |part| {
                (parts, samples, bytes) = (parts + 1, samples + part.count(), bytes + 2 * part.span());
                Ok(())
            });
            assert!(all.is_ok() && samples == 64 * 64 * 64);
            assert!(parts <= 64 * 64 && bytes <= 64 * 64 * SMALL, "{parts} parts of {bytes} bytes");
        }
        let found = [4_000_000, 2000, 1].map(|stride| Axis { length: 2000, stride });
        let axes = Axes::of_array(&found, u64::MAX).unwrap();
        assert!(Region::new(&axes, [7, 0, 0], [5, 2000, 2000]).is_one_run(), "planes are one run");
        assert!(!Region::new(&axes, [7, 0, 0], [5, 2000, 1999]).is_one_run());
    }
}
