//! [`DataLayout`]: where and how the samples of a volume lie in a file.

use std::path::PathBuf;

use super::axes::Axes;
use crate::rescaling::Calibration;
use crate::{Endian, SampleType, VoxelSpacing};

/// Where and how samples lie in a file.
#[derive(Debug, Clone)]
pub(crate) struct DataLayout {
    /// The file that holds the samples.
    pub(crate) file: PathBuf,
    /// Where the (encoded) samples begin.
    pub(crate) start: Start,
    /// How they are encoded.
    pub(crate) encoding: Encoding,
    /// Decoded bytes before the first sample; 0 unless the encoding is compressed.
    pub(crate) skip: u64,
    /// The checksum of the decoded bytes, the skipped ones included, where the file stores one outside them.
    #[cfg(feature = "npz")]
    pub(crate) checksum: Option<Checksum>,
    /// Lengths and strides.
    pub(crate) axes: Axes,
    /// The type of the samples.
    pub(crate) samples: SampleType,
    /// Their byte order.
    pub(crate) endian: Endian,
    /// What the bytes of samples mean.
    pub(crate) meaning: Meaning,
    /// From stored samples to units.
    pub(crate) calibration: Calibration,
    /// The distance between voxels, where given.
    pub(crate) spacing: Option<VoxelSpacing>,
}

/// Where the samples begin in their file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Start {
    /// At this byte.
    At(u64),
    /// They are the last bytes of the file.
    FromEnd,
}

/// How samples are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// As they are in memory.
    Raw,
    /// One or more gzip members.
    Gzip,
    /// One zlib stream.
    Zlib,
    /// One or more bzip2 streams.
    Bzip2,
    /// So many bytes of a deflate stream.
    #[cfg(feature = "npz")]
    Deflate(u64),
    /// Numbers as text.
    Text,
    /// Bytes as pairs of hexadecimal digits.
    Hex,
}

impl Encoding {
    /// The encoded samples, as an error names them.
    pub(super) fn data(self) -> &'static str {
        match self {
            Self::Gzip => "the gzip data",
            Self::Zlib => "the zlib data",
            Self::Bzip2 => "the bzip2 data",
            #[cfg(feature = "npz")]
            Self::Deflate(_) => "the deflate data",
            Self::Raw | Self::Text | Self::Hex => "the data",
        }
    }

    /// Whether few bytes of the file may become many samples.
    pub(super) fn is_compressed(self) -> bool {
        !matches!(self, Self::Raw | Self::Text | Self::Hex)
    }
}

/// What the bytes of samples mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Meaning {
    /// Numbers.
    Numbers,
    /// Truth values of a byte each, which become 0 and 255.
    Truth,
    /// Unsigned numbers `v` that mean `max - v`.
    #[cfg(feature = "tiff")]
    Inverted,
}

impl DataLayout {
    /// A layout of raw samples that begin at a byte of the file; the other fields are set by the caller.
    pub(crate) fn raw(file: PathBuf, start: u64, axes: Axes, samples: SampleType, endian: Endian) -> Self {
        Self {
            file,
            start: Start::At(start),
            encoding: Encoding::Raw,
            skip: 0,
            #[cfg(feature = "npz")]
            checksum: None,
            axes,
            samples,
            endian,
            meaning: Meaning::Numbers,
            calibration: Calibration::IDENTITY,
            spacing: None,
        }
    }

    /// Bytes of all samples, decoded.
    pub(crate) fn bytes(&self) -> u64 {
        self.axes.count() * self.samples.size() as u64
    }
}

/// The CRC-32 that an archive stores for an entry.
#[cfg(feature = "npz")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Checksum {
    pub(crate) crc: u32,
    /// The number of bytes of the entry.
    pub(crate) bytes: u64,
    /// How many of them come before the samples.
    pub(crate) before: u64,
}
