//! Smaller copies of volumes, for display.

use super::{MIN_SIDE, Volume};

impl Volume {
    /// The volume with no side longer than `edge` voxels (at least 8).
    ///
    /// A longer axis is averaged over blocks of the smallest length that brings it down to `edge`; means are rounded half
    /// up, and the blocks at the far borders may be shorter. Axes that are short enough are kept, so the proportions may
    /// change. Colours are averaged channel by channel.
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
        // With an edge of 8 or more, no side shrinks below MIN_SIDE.
        const { assert!(8 / 2 >= MIN_SIDE) };
        let edge = edge.max(8);
        let by = self.shape().map(|side| side.div_ceil(edge));
        if by == [1; 3] {
            return self.clone();
        }
        let (from, channels) = (self.shape(), self.channels());
        let shape = [0, 1, 2].map(|axis| from[axis].div_ceil(by[axis]));
        let range = |axis: usize, at: usize| at * by[axis]..((at + 1) * by[axis]).min(from[axis]);
        let mut voxels = Vec::with_capacity(shape.iter().product::<usize>() * channels);
        let mut sums = vec![0_u64; shape[2] * channels];
        for z in 0..shape[0] {
            for y in 0..shape[1] {
                sums.fill(0);
                for (z, y) in range(0, z).flat_map(|z| range(1, y).map(move |y| (z, y))) {
                    let start = (z * from[1] + y) * from[2] * channels;
                    let row = &self.voxels()[start..start + from[2] * channels];
                    for (block, sum) in row.chunks(by[2] * channels).zip(sums.chunks_exact_mut(channels)) {
                        for colour in block.chunks_exact(channels) {
                            sum.iter_mut().zip(colour).for_each(|(sum, &level)| *sum += u64::from(level));
                        }
                    }
                }
                let lines = range(0, z).len() * range(1, y).len();
                voxels.extend(sums.iter().enumerate().map(|(at, &sum)| {
                    let count = (lines * range(2, at / channels).len()) as u64;
                    ((2 * sum + count) / (2 * count)) as u8
                }));
            }
        }
        Volume::new(shape, channels, voxels).unwrap_or_else(|_| self.clone())
    }
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
    fn colours_stay_apart_and_small_volumes_stay_as_they_are() {
        let voxels = [10, 20, 30].repeat(16 * 16 * 16);
        let volume = Volume::new([16; 3], 3, voxels).unwrap();
        let small = volume.shrunk_to(8);
        assert_eq!((small.shape(), small.channels()), ([8; 3], 3));
        assert_eq!(small.voxels(), [10, 20, 30].repeat(512));
        assert_eq!(volume.shrunk_to(16), volume);
    }
}
