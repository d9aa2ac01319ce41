//! What can be wrong with a volume or with a file that should hold one.

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

use crate::formats::FormatInfo;
use crate::text::{DecoderError, Listed, display_path};
use crate::{Hint, Shape};

/// Why there is no volume. The sentence says what was found and what was expected; [`hint`](Self::hint) says which kind
/// of remedy applies.
///
/// Text that is quoted from a file is escaped and cut, so that a sentence is one line of bounded length.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// The array does not have three axes (or three and a colour axis of length 3 or 4).
    #[error("the array has {} axes {}, but a volume has three (Z, Y, X), or four with a last one of 3 or 4 colours", found.len(), Listed(found))]
    Dimensions {
        /// The axis lengths as the file gives them.
        found: Vec<u64>,
    },
    /// A side is shorter than [`MIN_SIDE`](crate::MIN_SIDE) voxels.
    #[error("the volume is {} x {} x {} (Z, Y, X), but every side must have at least 3 voxels", shape[0], shape[1], shape[2])]
    TooSmall {
        /// The shape that was found.
        shape: Shape,
    },
    /// There would be more voxels than the caller allows.
    #[error("the volume would have {voxels} voxels, more than the limit of {limit}")]
    TooLarge {
        /// The number of voxels that the header or the layout gives.
        voxels: u128,
        /// The limit in force.
        limit: u64,
    },
    /// Compressed samples would take more memory than the caller allows, and far more than the file has bytes.
    #[error(
        "the samples would take {bytes} bytes, more than the limit of {limit} and more than 16 times the compressed file"
    )]
    Inflated {
        /// Bytes of the samples once decompressed.
        bytes: u128,
        /// The limit in force.
        limit: u64,
    },
    /// The number of voxel bytes does not fit the shape and channels.
    #[error("{found} voxel bytes were given, but shape and channels need {expected}")]
    Length {
        /// Bytes that the shape and channels need.
        expected: u128,
        /// Bytes that are there.
        found: u64,
    },
    /// The file ends before the last sample.
    #[error("the data ends after {found} of the {expected} bytes that it should have")]
    Truncated {
        /// Bytes that there should be.
        expected: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// A sample is NaN or infinite.
    #[error("the sample at z {}, y {}, x {} is {value}, but samples must be finite", position[0], position[1], position[2])]
    NotFinite {
        /// The first such sample.
        value: f64,
        /// Its place (Z, Y, X).
        position: Shape,
    },
    /// The voxels have another number of channels than 1, 3 or 4.
    #[error(
        "a volume of {found} channels is not supported; supported: 1 channel (grey), 3 (RGB) or 4 (RGB and alpha, which is dropped)"
    )]
    Channels {
        /// The number of channels.
        found: u64,
    },
    /// A box does not lie inside the volume.
    #[error(
        "the box of {} x {} x {} voxels at z {}, y {}, x {} does not lie in the volume of {} x {} x {} (Z, Y, X)",
        shape[0], shape[1], shape[2], origin[0], origin[1], origin[2], volume[0], volume[1], volume[2]
    )]
    OutsideVolume {
        /// The first voxel of the box.
        origin: Shape,
        /// The shape of the box.
        shape: Shape,
        /// The shape of the volume.
        volume: Shape,
    },
    /// The file is of a known format but uses a feature that is not read.
    #[error("{what} is not supported; supported: {supported}")]
    Unsupported {
        /// What was found.
        what: String,
        /// What would have been read.
        supported: String,
    },
    /// The file holds more than one volume.
    #[error("{what} is more than one volume, but one is read from a file")]
    SeveralVolumes {
        /// What was found, e.g. `a series of 20 volumes over time`.
        what: String,
    },
    /// A header whose samples are in several files.
    #[error("the data of the header are in several files, but one data file is read")]
    SeveralDataFiles,
    /// The file contradicts its own format.
    #[error("{found}, but {expected}")]
    Malformed {
        /// What was found, and where.
        found: String,
        /// What the format asks for.
        expected: String,
    },
    /// A slice differs from the first one of its volume.
    #[error("{slice} has {found}, but {first} has {expected}, and all slices of a volume are alike")]
    MixedSlices {
        /// The slice, e.g. `the slice s11.png`.
        slice: String,
        /// Its size and samples.
        found: String,
        /// The first slice.
        first: String,
        /// Its size and samples.
        expected: String,
    },
    /// A folder holds too few slices to be a volume.
    #[error(
        "the folder holds {found} slices, but a volume has at least 3 PNG, JPEG or single-page TIFF slices of one size"
    )]
    TooFewSlices {
        /// The number of slices.
        found: usize,
    },
    /// The offset of raw samples is beyond the end of the file.
    #[error("the file has {length} bytes, but its samples should begin at byte {offset}")]
    RawOffset {
        /// Bytes of the file.
        length: u64,
        /// The offset given.
        offset: u64,
    },
    /// Raw samples do not use up their file.
    #[error(
        "{left_over} bytes are left over after the samples, but shape {shape:?}, type {samples} and offset {offset} must use up all {length} bytes"
    )]
    RawLength {
        /// Bytes after the last sample.
        left_over: u64,
        /// Bytes of the file.
        length: u64,
        /// The shape given.
        shape: Shape,
        /// The type given.
        samples: crate::SampleType,
        /// The offset given.
        offset: u64,
    },
    /// A header names a data file outside its own folder.
    #[error("the header names the data file {named}, which is outside the header's own folder")]
    OutsideFolder {
        /// The path as the header writes it.
        named: String,
    },
    /// The data file of a header cannot be reached.
    #[error("the header names the data file {named}, which cannot be opened")]
    DataFile {
        /// The path as the header writes it.
        named: String,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// The other file of a pair is missing.
    #[error("there is no {missing} beside the file, but the format is a pair of files, NAME.hdr and NAME.img")]
    MissingHalf {
        /// The name of the file that is missing.
        missing: String,
    },
    /// Neither the content nor the name of the file is that of a format.
    #[error("the file format is not recognised: the file {}{}", begins(start), recognised_are(recognised))]
    UnknownFormat {
        /// The first bytes, escaped; empty where the file is.
        start: String,
        /// The titles of the formats that are recognised, as a sentence lists them; may be empty.
        recognised: String,
    },
    /// The format, or what the file uses of it, is not part of this build.
    #[error("{what} is not read by this build, which lacks the feature `{feature}`")]
    FeatureDisabled {
        /// The format, or the part of it.
        what: &'static str,
        /// The feature of the crate.
        feature: &'static str,
    },
    /// A folder, pipe or device in place of a file.
    #[error("this is a folder, pipe or device, but a regular file is needed")]
    NotAFile,
    /// The operating system refused.
    #[error("{doing} failed")]
    Io {
        /// What was being done, e.g. `reading the header`.
        doing: &'static str,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// A decoder refused the bytes.
    #[error("{what} cannot be decoded")]
    Decode {
        /// Which part, e.g. `page 3 of the TIFF`.
        what: String,
        /// The decoder's own words.
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
}

impl FormatInfo {
    /// The error of a format that is compiled out of this build.
    #[cfg_attr(all(feature = "npz", feature = "tiff", feature = "vox"), allow(dead_code))]
    pub(crate) fn disabled(&self) -> VolumeError {
        VolumeError::FeatureDisabled { what: self.title, feature: self.feature.unwrap_or_default() }
    }
}

/// What follows a sentence about an unknown format.
fn recognised_are(titles: &str) -> String {
    if titles.is_empty() { String::new() } else { format!("; recognised are {titles}") }
}

fn begins(start: &str) -> String {
    if start.is_empty() { "is empty".into() } else { format!("begins with \"{start}\"") }
}

impl VolumeError {
    /// The kind of remedy that applies; `None` where none is known.
    pub fn hint(&self) -> Option<Hint> {
        Some(match self {
            Self::Dimensions { .. } => Hint::ReshapeArray,
            Self::TooLarge { .. } => Hint::RaiseVoxelLimit,
            Self::Inflated { .. } => Hint::RaiseInflatedLimit,
            Self::Truncated { .. } | Self::Malformed { .. } | Self::Decode { .. } => Hint::ReplaceFile,
            Self::NotFinite { .. } => Hint::ReplaceNonFinite,
            Self::Channels { .. } | Self::Unsupported { .. } | Self::MixedSlices { .. } => Hint::ConvertFile,
            Self::SeveralVolumes { .. } => Hint::SplitVolumes,
            Self::SeveralDataFiles => Hint::JoinDataFiles,
            Self::TooFewSlices { .. } => Hint::NameFiles,
            Self::RawOffset { .. } | Self::RawLength { .. } => Hint::CheckRawLayout,
            Self::OutsideFolder { .. } | Self::DataFile { .. } | Self::MissingHalf { .. } => Hint::MoveDataBesideHeader,
            Self::UnknownFormat { .. } => Hint::GiveRawLayout,
            Self::FeatureDisabled { feature, .. } => Hint::EnableFeature(feature),
            Self::TooSmall { .. }
            | Self::Length { .. }
            | Self::OutsideVolume { .. }
            | Self::NotAFile
            | Self::Io { .. } => {
                return None;
            }
        })
    }

    /// An error of a decoder from another crate, its words bounded.
    pub(crate) fn decode(what: impl Into<String>, error: &dyn Error) -> Self {
        Self::Decode { what: what.into(), source: Box::new(DecoderError::new(error)) }
    }

    pub(crate) fn malformed(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Malformed { found: found.into(), expected: expected.into() }
    }
}

/// A file that gave no volume: which one, the format it was read as, and why.
#[derive(Debug)]
#[non_exhaustive]
pub struct ReadError {
    /// The file or folder, as the caller named it.
    pub path: PathBuf,
    /// The format that the file was taken for, where it was recognised.
    pub format: Option<&'static FormatInfo>,
    /// What was wrong with it.
    pub error: VolumeError,
}

impl ReadError {
    /// An error of a file whose format is not known.
    pub fn new(path: impl Into<PathBuf>, error: VolumeError) -> Self {
        Self { path: path.into(), format: None, error }
    }

    /// The same error with the format that the file was taken for.
    #[must_use]
    pub fn with_format(self, format: &'static FormatInfo) -> Self {
        Self { format: Some(format), ..self }
    }

    /// The same error under another path, as it is to be shown.
    #[must_use]
    pub fn with_path(self, path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), ..self }
    }

    /// The file or folder, as the caller named it.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The kind of remedy that applies; `None` where none is known.
    pub fn hint(&self) -> Option<Hint> {
        self.error.hint()
    }
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", display_path(&self.path))?;
        match self.format {
            // The build lacks the format: the sentence names it.
            Some(format) if format.available => write!(f, "read as {}: {}", format.title, self.error),
            _ => write!(f, "{}", self.error),
        }
    }
}

impl Error for ReadError {
    /// The causes *below* the sentence: the sentence of `error` is already part of the display.
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.error.source()
    }
}
