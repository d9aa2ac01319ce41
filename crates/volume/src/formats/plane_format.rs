//! [`PlaneFormat`]: what the slices of a volume have in common, as pages of a file or as pictures in a folder.

use std::fmt;

use crate::samples::within_limit;
use crate::{SampleType, VolumeError};

/// No compression that is read (deflate, LZW, PackBits, JPEG) makes more bytes of one than this.
#[cfg(any(feature = "images", feature = "tiff"))]
const MOST_EXPANSION: u64 = 4096;

/// Size and samples of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct PlaneFormat {
    pub(crate) height: usize,
    pub(crate) width: usize,
    /// 1 (grey), 3 (RGB) or 4 (RGBA).
    pub(crate) channels: usize,
    pub(crate) ty: SampleType,
}

impl PlaneFormat {
    /// Pixels of one slice.
    #[cfg(feature = "tiff")]
    pub(crate) fn pixels(&self) -> u128 {
        self.height as u128 * self.width as u128
    }

    /// Bytes of one slice.
    #[cfg(feature = "tiff")]
    pub(crate) fn bytes(&self) -> u128 {
        self.pixels() * self.channels as u128 * self.ty.size() as u128
    }

    /// Checks that this many slices have no more voxels than the limit.
    pub(crate) fn within(&self, slices: u64, limit: u64) -> Result<(), VolumeError> {
        within_limit([slices.into(), self.height as u128, self.width as u128], limit)
    }
}

impl fmt::Display for PlaneFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.channels {
            1 => "grey",
            3 => "RGB",
            _ => "RGBA",
        };
        write!(f, "{} x {} pixels of {kind} {}", self.height, self.width, self.ty)
    }
}

/// Checks, before memory is taken, that a file of `length` bytes can hold `promised` bytes of samples.
#[cfg(any(feature = "images", feature = "tiff"))]
pub(crate) fn check_credible(promised: u128, compressed: bool, length: u64) -> Result<(), VolumeError> {
    let most = if compressed { u128::from(length) * u128::from(MOST_EXPANSION) } else { u128::from(length) };
    if promised > most {
        return Err(VolumeError::Truncated { expected: u64::try_from(promised).unwrap_or(u64::MAX), found: length });
    }
    Ok(())
}
