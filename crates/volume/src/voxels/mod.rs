//! [`Volume`]: voxels in memory, and the distance between them.

mod shape;
mod shrink;
mod spacing;

use std::borrow::Cow;

use crate::VolumeError;

pub use shape::{MIN_SIDE, Shape};
pub use shrink::blocks;
pub use spacing::{LengthUnit, VoxelSpacing};

/// Voxels in memory: shape (Z, Y, X) with X fastest, one channel (grey) or three (RGB, interleaved), `u8`.
///
/// Invariants: every side has at least [`MIN_SIDE`] voxels; `voxels.len() == Z * Y * X * channels`.
#[derive(Clone, PartialEq, Eq)]
pub struct Volume {
    shape: Shape,
    channels: usize,
    voxels: Vec<u8>,
}

impl Volume {
    /// A volume of `channels` (1 or 3) interleaved channels.
    ///
    /// ```
    /// use hlacdb_volume::Volume;
    /// let volume = Volume::new([4, 5, 6], 1, vec![7; 4 * 5 * 6])?;
    /// assert_eq!(volume.shape(), [4, 5, 6]);
    /// # Ok::<(), hlacdb_volume::VolumeError>(())
    /// ```
    ///
    /// # Errors
    /// [`VolumeError::TooSmall`], [`VolumeError::Channels`] for other numbers of channels, [`VolumeError::Length`].
    pub fn new(shape: Shape, channels: usize, voxels: Vec<u8>) -> Result<Self, VolumeError> {
        if shape.iter().any(|&side| side < MIN_SIDE) {
            return Err(VolumeError::TooSmall { shape });
        }
        if channels != 1 && channels != 3 {
            return Err(VolumeError::Channels { found: channels as u64 });
        }
        let expected = shape.iter().map(|&side| side as u128).product::<u128>() * channels as u128;
        if expected != voxels.len() as u128 {
            return Err(VolumeError::Length { expected, found: voxels.len() as u64 });
        }
        Ok(Self { shape, channels, voxels })
    }

    /// A grey volume whose voxel at (z, y, x) is `f(z, y, x)`.
    ///
    /// # Errors
    /// [`VolumeError::TooSmall`].
    pub fn from_fn(shape: Shape, mut f: impl FnMut(usize, usize, usize) -> u8) -> Result<Self, VolumeError> {
        let mut voxels = Vec::with_capacity(shape.iter().product());
        for z in 0..shape[0] {
            for y in 0..shape[1] {
                voxels.extend((0..shape[2]).map(|x| f(z, y, x)));
            }
        }
        Self::new(shape, 1, voxels)
    }

    /// Axis lengths (Z, Y, X).
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// 1 (grey) or 3 (RGB).
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// The voxels, X fastest, channels interleaved; `Z * Y * X * channels` bytes.
    pub fn voxels(&self) -> &[u8] {
        &self.voxels
    }

    /// The voxels, by value.
    pub fn into_voxels(self) -> Vec<u8> {
        self.voxels
    }

    /// The grey levels of the volume: itself if it is grey, else its Rec. 709 luma in integers,
    /// `(2126 R + 7152 G + 722 B + 5000) / 10000`.
    pub fn luma(&self) -> Cow<'_, Volume> {
        if self.channels == 1 {
            return Cow::Borrowed(self);
        }
        Cow::Owned(Volume { shape: self.shape, channels: 1, voxels: luma(&self.voxels).collect() })
    }

    /// The block of the given shape whose first voxel is at `origin`; `None` if it does not lie inside the volume or a side
    /// is shorter than [`MIN_SIDE`].
    pub fn block(&self, origin: Shape, shape: Shape) -> Option<Volume> {
        for axis in 0..3 {
            if shape[axis] < MIN_SIDE || origin[axis].checked_add(shape[axis])? > self.shape[axis] {
                return None;
            }
        }
        let row = shape[2] * self.channels;
        let mut voxels = Vec::with_capacity(shape[0] * shape[1] * row);
        for z in origin[0]..origin[0] + shape[0] {
            for y in origin[1]..origin[1] + shape[1] {
                let start = ((z * self.shape[1] + y) * self.shape[2] + origin[2]) * self.channels;
                voxels.extend_from_slice(&self.voxels[start..start + row]);
            }
        }
        Some(Volume { shape, channels: self.channels, voxels })
    }

    /// The origins of the whole cubes of `side` voxels that the volume holds, in (Z, Y, X) order. Voxels left over at the
    /// far borders are in none of them.
    pub fn block_origins(&self, side: usize) -> impl Iterator<Item = Shape> + use<> {
        let [z, y, x] = self.shape.map(|length| length.checked_div(side).unwrap_or(0));
        (0..z).flat_map(move |z| (0..y).flat_map(move |y| (0..x).map(move |x| [z * side, y * side, x * side])))
    }

    /// The identity of the content: BLAKE3 over the shape (three `u64`), the channels (`u64`), all little-endian, and the
    /// voxels.
    pub fn content_hash(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        for length in self.shape.into_iter().chain([self.channels]) {
            hasher.update(&(length as u64).to_le_bytes());
        }
        hasher.update(&self.voxels);
        *hasher.finalize().as_bytes()
    }
}

/// The luma of interleaved colours, as [`Volume::luma`] defines it.
pub(crate) fn luma(colours: &[u8]) -> impl Iterator<Item = u8> {
    let weigh = |&[r, g, b]: &[u8; 3]| (2126 * u32::from(r) + 7152 * u32::from(g) + 722 * u32::from(b) + 5000) / 10_000;
    colours.as_chunks::<3>().0.iter().map(move |colour| weigh(colour) as u8)
}

impl std::fmt::Debug for Volume {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Volume").field("shape", &self.shape).field("channels", &self.channels).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_the_slice_that_numpy_takes() {
        let volume = Volume::from_fn([4, 5, 6], |z, y, x| (z * 36 + y * 6 + x) as u8).unwrap();
        let block = volume.block([1, 2, 3], [3, 3, 3]).unwrap();
        assert_eq!(block, Volume::from_fn([3, 3, 3], |z, y, x| ((z + 1) * 36 + (y + 2) * 6 + x + 3) as u8).unwrap());
        assert!(volume.block([2, 2, 3], [3, 3, 3]).is_none());
        assert!(volume.block([usize::MAX, 0, 0], [3, 3, 3]).is_none());
    }

    #[test]
    fn luma_is_rec_709_rounded() {
        let mut voxels = vec![255; 81];
        voxels[..3].copy_from_slice(&[255, 0, 0]);
        let luma = Volume::new([3, 3, 3], 3, voxels).unwrap();
        assert_eq!(luma.luma().voxels()[..2], [54, 255]);
    }

    #[test]
    fn shape_channels_and_voxels_enter_the_hash() {
        let hash = |shape, channels, voxels| Volume::new(shape, channels, voxels).unwrap().content_hash();
        let plain = hash([3, 4, 9], 1, vec![0; 108]);
        assert_ne!(plain, hash([4, 3, 9], 1, vec![0; 108]));
        assert_ne!(plain, hash([3, 4, 3], 3, vec![0; 108]));
    }
}
