//! What is known of where a volume came from, and what the caller may say beforehand.

use std::fmt;

use super::{Endian, Intensity, Mapping, SampleType, Shape};

/// The kind of file, or other origin, of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FileKind {
    /// A numpy array (`.npy`).
    Npy,
    /// A numpy archive that holds one volume (`.npz`).
    Npz,
    /// NRRD, attached or detached (`.nrrd`, `.nhdr`).
    Nrrd,
    /// MetaImage, attached or detached (`.mha`, `.mhd`).
    MetaImage,
    /// NIfTI-1 or NIfTI-2, one file or a pair (`.nii`, `.nii.gz`, `.hdr` and `.img`).
    Nifti,
    /// A TIFF of several pages (`.tif`, `.tiff`).
    Tiff,
    /// A folder of equal pictures, one a slice.
    Slices,
    /// A MagicaVoxel model (`.vox`).
    Vox,
    /// Bare samples, described by a [`RawLayout`].
    Raw,
    /// Made by a recipe.
    Synthetic,
    /// Given by the calling program.
    Memory,
}

impl FileKind {
    /// Every kind.
    pub const ALL: [Self; 11] = [
        Self::Npy,
        Self::Npz,
        Self::Nrrd,
        Self::MetaImage,
        Self::Nifti,
        Self::Tiff,
        Self::Slices,
        Self::Vox,
        Self::Raw,
        Self::Synthetic,
        Self::Memory,
    ];

    /// The name by which records and output call the kind: lower case, stable.
    pub fn name(self) -> &'static str {
        match self {
            Self::Npy => "npy",
            Self::Npz => "npz",
            Self::Nrrd => "nrrd",
            Self::MetaImage => "metaimage",
            Self::Nifti => "nifti",
            Self::Tiff => "tiff",
            Self::Slices => "slices",
            Self::Vox => "vox",
            Self::Raw => "raw",
            Self::Synthetic => "synthetic",
            Self::Memory => "memory",
        }
    }

    /// The kind of that [`name`](Self::name).
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Where a volume came from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// The kind of file.
    pub kind: FileKind,
    /// The samples in the file. Truth values are `u8` (0 and 255).
    pub samples: SampleType,
    /// How the samples became 256 levels; `None` where they were taken as they are.
    pub mapping: Option<Mapping>,
    /// The distance between voxels along (Z, Y, X) in the file's own unit; `None` where it gives none.
    pub spacing: Option<[f64; 3]>,
}

impl Source {
    /// Of a volume that a recipe made.
    pub const SYNTHETIC: Self =
        Self { kind: FileKind::Synthetic, samples: SampleType::U8, mapping: None, spacing: None };
}

/// How bare samples lie in a file: X fastest, one channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawLayout {
    /// Axis lengths (Z, Y, X).
    pub shape: Shape,
    /// The type of the samples.
    pub samples: SampleType,
    /// Their byte order.
    pub endian: Endian,
    /// Bytes before the first sample.
    pub offset: u64,
}

/// A text that names no type of bare samples.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{found}` is no sample type: write one of u8, i8, u16, i16, u32, i32, u64, i64, f16, f32, f64, with `le` or `be` after it (u16be; without, le is meant)"
)]
pub struct RawTypeError {
    /// The text.
    pub found: String,
}

impl RawLayout {
    /// The type and byte order that a text such as `u8`, `u16`, `u16le` or `f32be` names; little-endian where it
    /// says nothing.
    ///
    /// # Errors
    /// [`RawTypeError`] for any other text.
    pub fn parse_type(text: &str) -> Result<(SampleType, Endian), RawTypeError> {
        let (name, endian) = match (text.strip_suffix("le"), text.strip_suffix("be")) {
            (Some(name), _) => (name, Endian::Little),
            (_, Some(name)) => (name, Endian::Big),
            _ => (text, Endian::Little),
        };
        let ty = SampleType::from_name(name).ok_or_else(|| RawTypeError { found: text.into() })?;
        Ok((ty, endian))
    }
}

/// What the caller says before a file is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReadOptions {
    /// How deep samples become 256 levels.
    pub intensity: Intensity,
    /// The most voxels a header may promise; checked before memory is taken.
    pub max_voxels: u64,
    /// The most bytes that the samples of a compressed file may take in memory, where the file is read whole and they are
    /// more than 16 times as many as it has itself; checked before memory is taken. What is not compressed takes no more
    /// than the file has, and ordinary scans shrink to no less than a sixteenth: this is for files made to exhaust the
    /// machine, and for very empty ones.
    pub max_inflated: u64,
    /// The layout of files that are nothing but samples; `None`: such files are of unknown kind.
    pub raw: Option<RawLayout>,
}

impl ReadOptions {
    /// The default of [`max_voxels`](Self::max_voxels): 2^32.
    pub const MAX_VOXELS: u64 = 1 << 32;
    /// The default of [`max_inflated`](Self::max_inflated): 2^32 bytes.
    pub const MAX_INFLATED: u64 = 1 << 32;
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            intensity: Intensity::default(),
            max_voxels: Self::MAX_VOXELS,
            max_inflated: Self::MAX_INFLATED,
            raw: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_and_types_are_found_by_name() {
        for kind in FileKind::ALL {
            assert_eq!(FileKind::from_name(kind.name()), Some(kind));
        }
        assert_eq!(FileKind::from_name("hdf5"), None);
        assert_eq!(RawLayout::parse_type("u8"), Ok((SampleType::U8, Endian::Little)));
        assert_eq!(RawLayout::parse_type("i16be"), Ok((SampleType::I16, Endian::Big)));
        assert_eq!(RawLayout::parse_type("f64le"), Ok((SampleType::F64, Endian::Little)));
        for text in ["", "le", "u12", "U8", "float", "u16lebe"] {
            assert!(RawLayout::parse_type(text).is_err(), "{text}");
        }
    }
}
