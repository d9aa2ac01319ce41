//! [`Hint`]: what would help against an error, for each front end to word in its own terms.

use std::fmt;

/// The kind of remedy that applies to an error.
///
/// Errors of this crate state facts. What to do about them depends on where the reader is used: a program names its flag,
/// a server the field of its form, a library the method of [`ReadOptions`](crate::ReadOptions). The display of a hint is
/// a remedy that names none of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Hint {
    /// Allow more voxels ([`ReadOptions::max_voxels`](crate::ReadOptions::max_voxels)), if the file is right.
    RaiseVoxelLimit,
    /// Allow more memory for compressed samples
    /// ([`ReadOptions::max_inflated`](crate::ReadOptions::max_inflated)), if the file is right.
    RaiseInflatedLimit,
    /// Describe samples without a header ([`ReadOptions::raw`](crate::ReadOptions::raw)).
    GiveRawLayout,
    /// Correct the description of samples without a header.
    CheckRawLayout,
    /// The file is truncated or damaged: fetch it or write it again.
    ReplaceFile,
    /// Convert the file to a form that is read.
    ConvertFile,
    /// Write each volume to a file of its own.
    SplitVolumes,
    /// Reshape the array or stack its slices.
    ReshapeArray,
    /// Replace NaN and infinity by numbers.
    ReplaceNonFinite,
    /// Put the header and its data file into one folder.
    MoveDataBesideHeader,
    /// Join the data files of a header.
    JoinDataFiles,
    /// Name the files of a folder one by one.
    NameFiles,
    /// Build with this feature of the crate.
    EnableFeature(&'static str),
}

impl fmt::Display for Hint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RaiseVoxelLimit => "raise the limit of voxels if the file is right",
            Self::RaiseInflatedLimit => "raise the limit of memory for compressed samples if the file is right",
            Self::GiveRawLayout => "give shape and type if the file holds samples without a header",
            Self::CheckRawLayout => "check the shape, the type and the offset of the samples",
            Self::ReplaceFile => "the file is truncated or damaged: fetch it or write it again",
            Self::ConvertFile => "convert the file to a form that is read",
            Self::SplitVolumes => "write each volume to a file of its own",
            Self::ReshapeArray => "reshape the array or stack its slices",
            Self::ReplaceNonFinite => "replace NaN and infinity first",
            Self::MoveDataBesideHeader => "put the header and its data file into one folder",
            Self::JoinDataFiles => "join the data files into one",
            Self::NameFiles => "name the files of a folder of volumes one by one",
            Self::EnableFeature(feature) => return write!(f, "build with the feature `{feature}`"),
        })
    }
}
