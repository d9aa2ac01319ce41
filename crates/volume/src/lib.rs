//! Voxel volumes in memory, and readers for the files they come in.
//!
//! A [`Volume`] is a block of `u8` voxels of shape (Z, Y, X) with X fastest, and one channel (grey) or three (RGB,
//! interleaved). Every reader yields this layout, whatever the axis order of the file, so that one volume has the same
//! voxels in every format. Samples deeper than 8 bits become 256 levels by an [`Intensity`] rule, which is recorded.
//!
//! ```
//! use hlacdb_volume::{Intensity, ReadOptions, read};
//!
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("scan.npy");
//! # hlacdb_volume::npy::NpyWriter::create(&path, &[4, 5, 6])?.finish_with(&[7_u16; 120])?;
//! let options = ReadOptions::new().intensity(Intensity::Auto).max_voxels(1 << 30);
//! let (volume, source) = read(&path, &options)?;
//! assert_eq!((volume.shape(), source.format), ([4, 5, 6], "npy"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Where to look:
//! - [`read`] reads a file whole, [`SlabReader`] some Z-planes at a time, [`VolumeFile::read_block`] a box of it;
//! - [`discover`] finds the volumes of a folder, [`uploaded_volumes`] those among files that somebody sent;
//! - [`formats`] has the registry of formats and the traits behind which a format is written;
//! - [`npy`] reads and writes NumPy arrays of any rank.
//!
//! # Untrusted files
//! No file makes a reader panic or take more memory than its limits allow: what a header promises is checked before
//! memory is taken, and memory grows with the bytes that arrive. Text of a file that an error quotes is escaped and cut.
//!
//! # Features
//! Every format beyond NumPy arrays and headers of plain text or fixed size is a feature, on by default: `gzip` (gzip and
//! zlib data), `bzip2`, `npz`, `tiff`, `images` (PNG and JPEG slices), `vox`. The registry names formats that are compiled
//! out, so that the error for such a file can say so.

#![forbid(unsafe_code)]
#![cfg_attr(
    test,
    allow(
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::single_range_in_vec_init,
        reason = "a test that panics has failed, and a list of ranges may hold one"
    )
)]

mod discovery;
mod error;
pub mod formats;
mod hint;
mod layout;
pub mod npy;
mod options;
mod reading;
mod rescaling;
mod samples;
#[cfg(test)]
mod testing;
mod text;
mod voxels;

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub use discovery::{Discovery, discover, natural_cmp, uploaded_volumes};
pub use error::{ReadError, VolumeError};
pub use hint::Hint;
pub use options::{RawLayout, RawTypeError, ReadOptions};
pub use reading::{SlabReader, VolumeFile, VolumeSlab, VolumeSource, read};
pub use rescaling::{Calibration, Intensity, IntensityError, Mapping};
pub use samples::{Endian, SampleType, Samples};
pub use text::display_path;
pub use voxels::{LengthUnit, MIN_SIDE, Shape, Volume, VoxelSpacing, blocks};
