//! [`Samples`]: decoded samples, and how they become a [`Volume`].
//!
//! The voxels end up at the front of the allocation that held the samples, so a volume takes no more memory than its
//! samples. Every sample of a volume was finite, and samples of `u8` are unchanged.

mod types;

use crate::rescaling::{self, Calibration};
use crate::{Intensity, Mapping, Shape, Volume, VolumeError};

pub(crate) use types::make_little;
pub use types::{Endian, SampleType};

/// Checks that axes of these lengths hold no more voxels than the limit, before memory is taken for them.
///
/// # Errors
/// [`VolumeError::TooLarge`].
pub(crate) fn within_limit(lengths: [u128; 3], limit: u64) -> Result<(), VolumeError> {
    let voxels = lengths.into_iter().fold(1_u128, u128::saturating_mul);
    if voxels > u128::from(limit) { Err(VolumeError::TooLarge { voxels, limit }) } else { Ok(()) }
}

/// The samples of a volume in memory: X fastest, channels interleaved.
///
/// ```
/// use hlacdb_volume::{Endian, Intensity, SampleType, Samples};
/// let bytes = (0..60_u16).flat_map(u16::to_le_bytes).collect();
/// let samples = Samples { shape: [3, 4, 5], channels: 1, ty: SampleType::U16, endian: Endian::Little, bytes };
/// let (volume, mapping) = samples.into_volume(Intensity::Full)?;
/// assert_eq!((volume.voxels()[59], mapping.map(|mapping| mapping.hi)), (255, Some(59.0)));
/// # Ok::<(), hlacdb_volume::VolumeError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Samples {
    /// Axis lengths (Z, Y, X).
    pub shape: Shape,
    /// Samples per voxel: 1 (grey), 3 (RGB) or 4 (RGB and an alpha that is dropped).
    pub channels: usize,
    /// The type of each sample.
    pub ty: SampleType,
    /// The byte order of each sample.
    pub endian: Endian,
    /// `Z * Y * X * channels * ty.size()` bytes.
    pub bytes: Vec<u8>,
}

impl Samples {
    /// The volume of these samples, and how they became 256 levels (`None` for `u8`, which is taken as it is).
    ///
    /// # Errors
    /// [`VolumeError::Length`] if the bytes do not fit shape and channels, [`VolumeError::NotFinite`] with the first
    /// bad voxel, [`VolumeError::Channels`] for other than 1, 3 or 4 channels, [`VolumeError::TooSmall`].
    pub fn into_volume(self, intensity: Intensity) -> Result<(Volume, Option<Mapping>), VolumeError> {
        self.into_volume_calibrated(intensity, Calibration::IDENTITY)
    }

    /// As [`into_volume`](Self::into_volume), with a linear map from stored samples to the units in which a window is
    /// given and the mapping is recorded. (`u8` is taken as it is, whatever the calibration.)
    ///
    /// The levels are computed from stored samples, so a positive slope changes no level under [`Intensity::Full`] and
    /// [`Intensity::Auto`], not even by rounding. A negative slope inverts them.
    ///
    /// # Errors
    /// As [`into_volume`](Self::into_volume).
    pub fn into_volume_calibrated(
        mut self,
        intensity: Intensity,
        calibration: Calibration,
    ) -> Result<(Volume, Option<Mapping>), VolumeError> {
        let colours = kept_channels(self.channels)?;
        let samples = self.shape.iter().map(|&side| side as u128).product::<u128>() * self.channels as u128;
        let expected = samples * self.ty.size() as u128;
        if expected != self.bytes.len() as u128 {
            return Err(VolumeError::Length { expected, found: self.bytes.len() as u64 });
        }
        if self.channels == 4 {
            drop_alpha(&mut self.bytes, self.ty);
        }
        let mapping = rescaling::rescale(&mut self.bytes, self.ty, self.endian, intensity, calibration);
        let mapping = mapping.map_err(|bad| not_finite(bad, self.shape, colours))?;
        self.bytes.shrink_to_fit();
        Ok((Volume::new(self.shape, colours, self.bytes)?, mapping))
    }
}

/// The channels that a volume keeps of its samples: an alpha is dropped.
///
/// # Errors
/// [`VolumeError::Channels`] for other than 1, 3 or 4.
pub(crate) fn kept_channels(channels: usize) -> Result<usize, VolumeError> {
    match channels {
        1 => Ok(1),
        3 | 4 => Ok(3),
        other => Err(VolumeError::Channels { found: other as u64 }),
    }
}

/// Removes the alpha of RGBA samples, in place.
pub(crate) fn drop_alpha(bytes: &mut Vec<u8>, ty: SampleType) {
    let (from, to) = (4 * ty.size(), 3 * ty.size());
    let voxels = bytes.len() / from;
    for voxel in 0..voxels {
        bytes.copy_within(voxel * from..voxel * from + to, voxel * to);
    }
    bytes.truncate(voxels * to);
}

/// The error of a sample that is not finite, by the voxel it belongs to.
pub(crate) fn not_finite(bad: rescaling::NotFinite, shape: Shape, channels: usize) -> VolumeError {
    let voxel = (bad.index / channels as u64) as usize;
    let [_, height, width] = shape;
    VolumeError::NotFinite {
        value: bad.value,
        position: [voxel / width / height, voxel / width % height, voxel % width],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::encode;

    fn samples(channels: usize, values: &[f64]) -> Samples {
        let bytes = encode(values, SampleType::F32, Endian::Little);
        Samples { shape: [3, 4, 5], channels, ty: SampleType::F32, endian: Endian::Little, bytes }
    }

    #[test]
    fn alpha_is_dropped_and_does_not_enter_the_range() {
        // Colours 0, 1, 2, ..., 179; every alpha far outside, one of them not even a number.
        let colours = |voxel: usize| [3 * voxel, 3 * voxel + 1, 3 * voxel + 2].map(|colour| colour as f64);
        let alpha = |voxel| if voxel == 7 { f64::NAN } else { 1e6 };
        let rgba: Vec<f64> = (0..60).flat_map(|voxel| colours(voxel).into_iter().chain([alpha(voxel)])).collect();
        let rgb: Vec<f64> = (0..60).flat_map(colours).collect();
        let (volume, mapping) = samples(4, &rgba).into_volume(Intensity::Full).unwrap();
        assert_eq!((volume.clone(), mapping), samples(3, &rgb).into_volume(Intensity::Full).unwrap());
        assert_eq!((volume.channels(), mapping.unwrap().hi), (3, 179.0));
    }

    #[test]
    fn a_bad_sample_is_named_by_its_voxel() {
        for (channels, index, expected) in [(1, 59, [2, 3, 4]), (1, 23, [1, 0, 3]), (3, 3 * 23 + 2, [1, 0, 3])] {
            let mut values = vec![1.0; 60 * channels];
            values[index] = f64::NEG_INFINITY;
            let error = samples(channels, &values).into_volume(Intensity::Full).unwrap_err();
            let VolumeError::NotFinite { position, value } = error else { panic!("{error}") };
            assert_eq!((position, value), (expected, f64::NEG_INFINITY));
        }
    }

    #[test]
    fn samples_that_are_no_volume_are_refused() {
        let refused = |samples: Samples| samples.into_volume(Intensity::Full).unwrap_err();
        assert!(matches!(refused(samples(2, &[0.0; 120])), VolumeError::Channels { found: 2 }));
        assert!(matches!(refused(samples(1, &[0.0; 61])), VolumeError::Length { expected: 240, found: 244 }));
        let flat = Samples { shape: [2, 5, 6], ..samples(1, &[0.0; 60]) };
        assert!(matches!(refused(flat), VolumeError::TooSmall { shape: [2, 5, 6] }));
        let empty = Samples { shape: [0, 5, 6], bytes: Vec::new(), ..samples(1, &[]) };
        assert!(matches!(refused(empty), VolumeError::TooSmall { .. }));
    }
}
