//! What the slices of a volume have in common, be they pages of one file or pictures in a folder.

use std::fmt;

use super::samples::within_limit;
use super::{SampleType, VolumeError};

/// No packing that is read (deflate, LZW, PackBits, JPEG) makes more of a byte than this.
const MOST_EXPANSION: u64 = 4096;

/// Size and samples of a slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Format {
    pub(super) height: usize,
    pub(super) width: usize,
    /// 1 (grey), 3 (RGB) or 4 (RGBA).
    pub(super) channels: usize,
    pub(super) ty: SampleType,
}

impl Format {
    /// Pixels of one slice.
    pub(super) fn pixels(&self) -> u128 {
        self.height as u128 * self.width as u128
    }

    /// Bytes of one slice.
    pub(super) fn bytes(&self) -> u128 {
        self.pixels() * self.channels as u128 * self.ty.size() as u128
    }

    /// Checks that `slices` of this format have no more voxels than the limit.
    pub(super) fn within(&self, slices: u64, limit: u64) -> Result<(), VolumeError> {
        within_limit([slices.into(), self.height as u128, self.width as u128], limit).map(drop)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.channels {
            1 => "grey",
            3 => "RGB",
            _ => "RGBA",
        };
        write!(f, "{} x {} pixels of {kind} {}", self.height, self.width, self.ty)
    }
}

/// Checks, before memory is taken, that a file of `length` bytes can hold `promised` bytes once unpacked.
pub(super) fn credible(promised: u128, packed: bool, length: u64) -> Result<(), VolumeError> {
    let most = if packed { u128::from(length) * u128::from(MOST_EXPANSION) } else { u128::from(length) };
    if promised > most {
        return Err(VolumeError::Truncated { expected: u64::try_from(promised).unwrap_or(u64::MAX), found: length });
    }
    Ok(())
}
