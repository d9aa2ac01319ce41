//! What can be wrong with a volume or with a file that should hold one.

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

use super::Shape;

/// Why voxels are no volume. The sentence says what was found, what was expected and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// The array does not have three axes (or three and a colour axis of length 3 or 4).
    #[error("the array has {} axes {found:?}, but a volume has three (Z, Y, X), or four with a last one of 3 colours: reshape it or stack slices", found.len())]
    Dimensions {
        /// The axis lengths as the file gives them.
        found: Vec<u64>,
    },
    /// An axis is shorter than the 3 voxels that one window needs.
    #[error("the volume is {} x {} x {} (Z, Y, X), but every side must have at least 3 voxels for the 3x3x3 window", shape[0], shape[1], shape[2])]
    TooSmall {
        /// The shape that was found.
        shape: Shape,
    },
    /// The header promises more voxels than the caller allows.
    #[error(
        "the header promises {voxels} voxels, more than the limit of {limit}: raise --max-voxels if the file is right"
    )]
    TooLarge {
        /// The number of voxels promised.
        voxels: u128,
        /// The limit in force.
        limit: u64,
    },
    /// Compressed samples would take more memory than the caller allows, and far more than the file has bytes.
    #[error(
        "the header promises samples of {bytes} bytes, far more than the compressed file holds and more than the limit of {limit}: raise --max-inflated if the file is right"
    )]
    Inflated {
        /// Bytes of the samples once unpacked.
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
    /// The file ends before its header's promise is met.
    #[error(
        "the data ends after {found} of the {expected} bytes that the header promises: the file is truncated, fetch or write it again"
    )]
    Truncated {
        /// Bytes the header promises.
        expected: u64,
        /// Bytes that are there.
        found: u64,
    },
    /// A sample is NaN or infinite.
    #[error("the sample at z {}, y {}, x {} is {value}, but samples must be finite: replace NaN and infinity first", position[0], position[1], position[2])]
    NotFinite {
        /// The first such sample.
        value: f64,
        /// Its place (Z, Y, X).
        position: Shape,
    },
    /// The file is of a known kind but uses a feature that is not read.
    #[error("{what} is not supported; supported: {supported}")]
    Unsupported {
        /// What was found.
        what: String,
        /// What would have been read.
        supported: String,
    },
    /// The file contradicts its own format.
    #[error("{found}, but {expected}")]
    Malformed {
        /// What was found, and where.
        found: String,
        /// What the format asks for, and what to do.
        expected: String,
    },
    /// A detached header names a data file outside its own folder.
    #[error(
        "the header names the data file {named}, which is outside the header's own folder: move the data beside the header"
    )]
    Outside {
        /// The path as the header writes it (escaped).
        named: String,
    },
    /// The data file that a detached header names cannot be reached.
    #[error("the header names the data file {named}, which cannot be opened: it belongs beside the header")]
    DataFile {
        /// The path as the header writes it (escaped).
        named: String,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// Neither content nor name tells the kind.
    #[error(
        "the kind of file is not known (it begins with {start}); known kinds: {known}; for bare samples give --raw-shape and --raw-type"
    )]
    UnknownKind {
        /// The first bytes, printable.
        start: String,
        /// The kinds that are read.
        known: &'static str,
    },
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
    #[error("{what} cannot be decoded: the file is damaged or not what its name says")]
    Decode {
        /// Which part, e.g. `page 3 of the TIFF`.
        what: String,
        /// The decoder's own words.
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
}

/// A path as it is shown to people and in JSON: bytes that are not UTF-8 and control characters are escaped.
pub fn display_path(path: &Path) -> String {
    let mut shown = String::new();
    for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
        for character in chunk.valid().chars() {
            if character.is_control() {
                shown.extend(character.escape_default());
            } else {
                shown.push(character);
            }
        }
        for byte in chunk.invalid() {
            shown.push_str(&format!("\\x{byte:02x}"));
        }
    }
    shown
}

/// A file that gave no volume: which one, and why.
#[derive(Debug)]
pub struct ReadError {
    /// The file or folder, as it was named by the caller.
    pub path: PathBuf,
    /// What was wrong with it.
    pub error: VolumeError,
}

impl fmt::Display for ReadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", display_path(&self.path), self.error)
    }
}

impl Error for ReadError {
    /// The causes *below* the sentence: the sentence of `error` is already part of the display.
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.error.source()
    }
}
