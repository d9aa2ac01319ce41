//! [`Samples`]: what a reader has decoded, and how it becomes a [`Volume`].
//!
//! The voxels end up at the front of the allocation that held the samples, so the most memory a volume takes is what its
//! samples take.
//!
//! Invariant of what comes out: every sample was finite, `u8` samples are untouched, and the mapping that is returned
//! reproduces the levels.

use std::fmt;

use super::levels::{self, Scaling};
use super::{Intensity, Mapping, Shape, Volume, VolumeError};

/// The type of the samples in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SampleType {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 64 bits.
    I64,
    /// Floating point, 16 bits (IEEE 754 binary16).
    F16,
    /// Floating point, 32 bits.
    F32,
    /// Floating point, 64 bits.
    F64,
}

impl SampleType {
    /// Every type.
    pub const ALL: [Self; 11] = [
        Self::U8,
        Self::I8,
        Self::U16,
        Self::I16,
        Self::U32,
        Self::I32,
        Self::U64,
        Self::I64,
        Self::F16,
        Self::F32,
        Self::F64,
    ];

    /// The name, as Rust writes the type: `u8`, `i16`, `f32`, ...
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::F16 => "f16",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// The type of that [`name`](Self::name).
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|ty| ty.name() == name)
    }

    /// Bytes of one sample.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

impl fmt::Display for SampleType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Which byte of a sample comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Endian {
    /// The lowest.
    Little,
    /// The highest.
    Big,
}

impl Endian {
    /// The byte order of this machine.
    pub const NATIVE: Self = if cfg!(target_endian = "big") { Self::Big } else { Self::Little };
}

/// The number of voxels that these axis lengths promise, checked before memory is taken for them.
///
/// # Errors
/// [`VolumeError::TooLarge`] where it is over the limit.
pub(super) fn within_limit(lengths: [u128; 3], limit: u64) -> Result<u128, VolumeError> {
    let voxels = lengths.into_iter().fold(1_u128, u128::saturating_mul);
    if voxels > u128::from(limit) { Err(VolumeError::TooLarge { voxels, limit }) } else { Ok(voxels) }
}

/// Decoded samples: X fastest, channels interleaved.
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
    /// [`VolumeError::Length`] where the bytes do not fit shape and channels, [`VolumeError::NotFinite`] with the first
    /// bad voxel, [`VolumeError::Unsupported`] for other than 1, 3 or 4 channels, [`VolumeError::TooSmall`].
    pub fn into_volume(self, intensity: Intensity) -> Result<(Volume, Option<Mapping>), VolumeError> {
        self.into_volume_scaled(intensity, Scaling::IDENTITY)
    }

    /// As [`into_volume`](Self::into_volume), where the file's units are a linear map of the stored samples: a window is
    /// given and the mapping is recorded in units. (`u8` is taken as it is, scaled or not.)
    ///
    /// The window is taken back to stored samples and the levels are computed there, so that a positive scaling changes
    /// no level under [`Intensity::Full`] and [`Intensity::Auto`], not even by rounding; a negative one turns them round.
    ///
    /// # Errors
    /// As [`into_volume`](Self::into_volume).
    pub(super) fn into_volume_scaled(
        mut self,
        intensity: Intensity,
        scaling: Scaling,
    ) -> Result<(Volume, Option<Mapping>), VolumeError> {
        let kept = match self.channels {
            1 => 1,
            3 | 4 => 3,
            other => {
                return Err(VolumeError::Unsupported {
                    what: format!("a volume of {other} channels"),
                    supported: "1 channel (grey), 3 (RGB) or 4 (RGB and alpha)".into(),
                });
            }
        };
        let samples = self.shape.iter().map(|&side| side as u128).product::<u128>() * self.channels as u128;
        let expected = samples * self.ty.size() as u128;
        if expected != self.bytes.len() as u128 {
            return Err(VolumeError::Length { expected, found: self.bytes.len() as u64 });
        }
        if self.channels == 4 {
            drop_alpha(&mut self.bytes, self.ty);
        }
        let mapping = levels::write(&mut self.bytes, self.ty, self.endian, intensity, scaling);
        let mapping = mapping.map_err(|bad| not_finite(bad, self.shape, kept))?;
        self.bytes.shrink_to_fit();
        Ok((Volume::new(self.shape, kept, self.bytes)?, mapping))
    }
}

/// Moves the colours of RGBA samples together, in place.
pub(super) fn drop_alpha(bytes: &mut Vec<u8>, ty: SampleType) {
    let (from, to) = (4 * ty.size(), 3 * ty.size());
    let voxels = bytes.len() / from;
    for voxel in 0..voxels {
        bytes.copy_within(voxel * from..voxel * from + to, voxel * to);
    }
    bytes.truncate(voxels * to);
}

/// The error of a bad sample of a volume, by the voxel it belongs to.
pub(super) fn not_finite(bad: levels::NotFinite, shape: Shape, channels: usize) -> VolumeError {
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
    fn alpha_is_dropped_and_has_no_say_in_the_range() {
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
    fn what_is_no_volume_is_refused() {
        let refused = |samples: Samples| samples.into_volume(Intensity::Full).unwrap_err();
        assert!(matches!(refused(samples(2, &[0.0; 120])), VolumeError::Unsupported { .. }));
        assert!(matches!(refused(samples(1, &[0.0; 61])), VolumeError::Length { expected: 240, found: 244 }));
        let flat = Samples { shape: [2, 5, 6], ..samples(1, &[0.0; 60]) };
        assert!(matches!(refused(flat), VolumeError::TooSmall { shape: [2, 5, 6] }));
        let empty = Samples { shape: [0, 5, 6], bytes: Vec::new(), ..samples(1, &[]) };
        assert!(matches!(refused(empty), VolumeError::TooSmall { .. }));
    }

    #[test]
    fn types_are_found_by_name() {
        for ty in SampleType::ALL {
            assert_eq!(SampleType::from_name(ty.name()), Some(ty));
            assert!(ty.name().ends_with(&(8 * ty.size()).to_string()));
        }
    }
}
