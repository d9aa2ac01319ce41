//! The formats: what can be read, and the traits behind which a format is written.
//!
//! [`registry`] is the only list of formats. Reading, discovery of folders, uploads, help texts and servers take
//! names and extensions from it. To add a format, write a module with a [`Format`] and a [`VolumeReader`], and add one line to the
//! registry. Whole reads, slabs, boxes, intensity rules and limits are written once, above the traits.
//!
//! ```
//! use hlacdb_volume::formats;
//! let nifti = formats::find("nifti").map(|format| format.info());
//! assert!(nifti.is_some_and(|info| info.extensions.contains(&".nii.gz")));
//! ```

mod head;
mod info;
mod metaimage;
mod nifti;
mod npy;
mod npz;
mod nrrd;
mod plane_format;
mod raw;
mod registry;
mod slices;
mod tiff;
mod vox;

use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::rescaling::Calibration;
use crate::{ReadOptions, SampleType, Shape, VolumeError, VoxelSpacing};

pub use head::Head;
pub use info::FormatInfo;
pub(crate) use info::has_ending;
pub(crate) use registry::identify;
pub use registry::{find, infos, registry};

/// A file format: how its files are recognised, and how one is opened.
pub trait Format: Send + Sync {
    /// Its name, its extensions and what is read of it.
    fn info(&self) -> &'static FormatInfo;

    /// Whether a file or folder is of this format by its content. Content goes before names.
    fn sniff(&self, head: &Head) -> bool;

    /// Opens a file or folder and reads its header, but no samples.
    ///
    /// # Errors
    /// [`VolumeError`] if the header is damaged, uses a feature that is not read, or promises more than the limits of
    /// `options` allow. Nothing that a header promises may be allocated before it is checked.
    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError>;

    /// The files of a folder that make up one volume, if the folder itself is one of this format; else none.
    ///
    /// # Errors
    /// If the folder cannot be listed.
    fn folder_parts(&self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        let _ = folder;
        Ok(Vec::new())
    }
}

/// An open file: its header, and access to its samples.
///
/// Samples come little-endian, X fastest, channels interleaved (an alpha included), whatever the order of the file.
pub trait VolumeReader: Send {
    /// What the header says.
    fn header(&self) -> &VolumeHeader;

    /// What it costs to read a part.
    fn access(&self) -> Access;

    /// The size of the file in bytes if its samples are compressed, so that they may take much more memory than the file
    /// has bytes; `None` if they are not.
    fn compressed_bytes(&self) -> Option<u64> {
        None
    }

    /// Appends the samples of some Z-planes, which must be planes of the volume, to `out`. Planes may be read in any
    /// order and more than once.
    ///
    /// # Errors
    /// [`VolumeError`] if the file is truncated or damaged, or the system refuses. `out` then holds any part of the
    /// samples.
    fn read_planes(&mut self, planes: Range<usize>, out: &mut Vec<u8>) -> Result<(), VolumeError>;

    /// Appends the samples of the box of `shape` voxels (Z, Y, X) at `origin`, which must lie inside the volume, to `out`.
    ///
    /// By default, its planes are read one by one.
    ///
    /// # Errors
    /// As [`read_planes`](Self::read_planes).
    fn read_block(&mut self, origin: Shape, shape: Shape, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        let header = *self.header();
        let voxel = header.voxel_bytes();
        let (mut plane, row) = (Vec::new(), header.shape[2] * voxel);
        for z in origin[0]..origin[0] + shape[0] {
            plane.clear();
            self.read_planes(z..z + 1, &mut plane)?;
            for y in origin[1]..origin[1] + shape[1] {
                let start = y * row + origin[2] * voxel;
                out.extend_from_slice(plane.get(start..start + shape[2] * voxel).unwrap_or_default());
            }
        }
        Ok(())
    }
}

/// What it costs to read a part of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Access {
    /// Any planes cost about their own bytes.
    Direct,
    /// Planes in the order of Z cost their own bytes; going back starts at the first plane again.
    Sequential,
    /// Any planes may cost as much as the whole file: samples are not in the order of Z, or are decoded all at once.
    Whole,
}

/// What a header says of a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct VolumeHeader {
    /// Axis lengths (Z, Y, X).
    pub shape: Shape,
    /// Samples per voxel: 1 (grey), 3 (RGB) or 4 (RGB and an alpha that is dropped).
    pub channels: usize,
    /// The type of the samples.
    pub samples: SampleType,
    /// From stored samples to the units of the file.
    pub calibration: Calibration,
    /// The distance between voxels; `None` if the file does not give one.
    pub spacing: Option<VoxelSpacing>,
}

impl VolumeHeader {
    /// A header without calibration and spacing.
    pub fn new(shape: Shape, channels: usize, samples: SampleType) -> Self {
        Self { shape, channels, samples, calibration: Calibration::IDENTITY, spacing: None }
    }

    /// Bytes of the samples of one voxel.
    pub fn voxel_bytes(&self) -> usize {
        self.channels * self.samples.size()
    }

    /// Bytes of the samples of one Z-plane.
    pub fn plane_bytes(&self) -> u64 {
        self.shape[1] as u64 * self.shape[2] as u64 * self.voxel_bytes() as u64
    }

    /// Bytes of all samples.
    pub fn bytes(&self) -> u64 {
        self.plane_bytes().saturating_mul(self.shape[0] as u64)
    }
}
