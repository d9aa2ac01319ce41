//! Means of boxes of voxels: smaller copies of a volume, and slices at any size.

use std::ops::Range;

use super::{MIN_SIDE, Volume};

impl Volume {
    /// The mean of every box of voxels that a Z, a Y and an X range span, rounded half up.
    ///
    /// `ranges` lists the ranges of each axis (Z, Y, X). The result has one pixel per combination, X fastest, channels
    /// interleaved: its shape is the number of ranges of each axis. Ranges may overlap and repeat; they are cut to the
    /// volume, and a box without voxels gives 0.
    ///
    /// ```
    /// use hlacdb_volume::Volume;
    /// let volume = Volume::from_fn([3, 3, 4], |z, _, x| (10 * z + x) as u8)?;
    /// // The slice at z = 2, halved along X.
    /// assert_eq!(volume.box_means([&[2..3], &[0..1, 1..2, 2..3], &[0..2, 2..4]]), [21, 23, 21, 23, 21, 23]);
    /// # Ok::<(), hlacdb_volume::VolumeError>(())
    /// ```
    pub fn box_means(&self, ranges: [&[Range<usize>]; 3]) -> Vec<u8> {
        let ([depth, height, width], channels) = (self.shape(), self.channels());
        let cut = |range: &Range<usize>, side: usize| range.start.min(side)..range.end.min(side);
        let [zs, ys, xs] = ranges;
        let xs: Vec<Range<usize>> = xs.iter().map(|x| cut(x, width)).collect();
        let mut means = Vec::with_capacity(zs.len() * ys.len() * xs.len() * channels);
        let mut sums = vec![0_u64; xs.len() * channels];
        for z in zs {
            let z = cut(z, depth);
            for y in ys {
                let y = cut(y, height);
                sums.fill(0);
                for row in z.clone().flat_map(|z| y.clone().map(move |y| z * height + y)) {
                    let row = &self.voxels()[row * width * channels..][..width * channels];
                    for (x, sum) in xs.iter().zip(sums.chunks_exact_mut(channels)) {
                        let voxels = row.get(x.start * channels..x.end * channels).unwrap_or_default();
                        for voxel in voxels.chunks_exact(channels) {
                            sum.iter_mut().zip(voxel).for_each(|(sum, &level)| *sum += u64::from(level));
                        }
                    }
                }
                let rows = z.len() * y.len();
                for (x, sum) in xs.iter().zip(sums.chunks_exact(channels)) {
                    let count = (rows * x.len()) as u64;
                    means.extend(sum.iter().map(|sum| ((2 * sum + count) / (2 * count).max(1)) as u8));
                }
            }
        }
        means
    }

    /// A copy with no side longer than `edge` (at least 8).
    ///
    /// Axes that are longer are averaged over whole blocks, by the least factor that suffices; axes that are short enough
    /// stay as they are, so proportions may change. Blocks at the far borders may be smaller. See
    /// [`Volume::box_means`] for the rounding.
    ///
    /// ```
    /// use hlacdb_volume::Volume;
    /// let volume = Volume::from_fn([64, 20, 8], |z, _, _| z as u8)?;
    /// let small = volume.shrunk_to(16);
    /// assert_eq!((small.shape(), small.voxels()[0]), ([16, 10, 8], 2));
    /// # Ok::<(), hlacdb_volume::VolumeError>(())
    /// ```
    #[must_use]
    pub fn shrunk_to(&self, edge: usize) -> Volume {
        // From 8 on, what remains of a side that is longer than the edge is never under the 3 voxels of a window.
        const { assert!(8 / 2 >= MIN_SIDE) };
        let edge = edge.max(8);
        let factors = self.shape().map(|side| side.div_ceil(edge));
        if factors == [1; 3] {
            return self.clone();
        }
        let blocks = [0, 1, 2].map(|axis| blocks(self.shape()[axis], factors[axis]));
        let [z, y, x] = &blocks;
        let voxels = self.box_means([z, y, x]);
        Volume::new([z.len(), y.len(), x.len()], self.channels(), voxels).unwrap_or_else(|_| self.clone())
    }
}

/// A side cut into blocks of `size` voxels (at least 1); the last one may be smaller.
pub fn blocks(side: usize, size: usize) -> Vec<Range<usize>> {
    let size = size.max(1);
    (0..side.div_ceil(size)).map(|at| at * size..((at + 1) * size).min(side)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_voxel_is_the_mean_of_its_block() {
        let volume = Volume::from_fn([9, 20, 33], |z, y, x| (z * 7 + y * 5 + x * 3) as u8).unwrap();
        let small = volume.shrunk_to(8);
        assert_eq!(small.shape(), [5, 7, 7]);
        for (at, &found) in small.voxels().iter().enumerate() {
            let (z, y, x) = (at / 49, at / 7 % 7, at % 7);
            let (mut sum, mut count) = (0, 0);
            for z in z * 2..(z * 2 + 2).min(9) {
                for y in y * 3..(y * 3 + 3).min(20) {
                    for x in x * 5..(x * 5 + 5).min(33) {
                        sum += u64::from((z * 7 + y * 5 + x * 3) as u8);
                        count += 1;
                    }
                }
            }
            assert_eq!(u64::from(found), (2 * sum + count) / (2 * count), "{z} {y} {x}");
        }
    }

    #[test]
    fn channels_are_averaged_apart_and_small_volumes_stay_as_they_are() {
        let voxels = [10, 20, 30].repeat(16 * 16 * 16);
        let volume = Volume::new([16; 3], 3, voxels).unwrap();
        let small = volume.shrunk_to(8);
        assert_eq!((small.shape(), small.channels()), ([8; 3], 3));
        assert_eq!(small.voxels(), [10, 20, 30].repeat(512));
        assert_eq!(volume.shrunk_to(16), volume);
    }

    #[test]
    fn ranges_are_cut_to_the_volume_and_may_repeat() {
        let volume = Volume::from_fn([3, 3, 3], |z, y, x| (9 * z + 3 * y + x) as u8).unwrap();
        assert_eq!(volume.box_means([&[1..2], &[0..1], &[0..1, 0..1, 2..9, 3..9, 7..8]]), [9, 9, 11, 0, 0]);
        assert_eq!(volume.box_means([&[0..3], &[0..3], &[0..3]]), [13]);
        assert!(volume.box_means([&[], &[0..1], &[0..1]]).is_empty());
    }
}
