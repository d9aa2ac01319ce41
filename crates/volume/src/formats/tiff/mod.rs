//! TIFF files of several pages: every page is a slice, in the order of the file.
//!
//! The `tiff` crate decodes strips and tiles. It believes what a directory says, so every directory is checked here
//! before (`page.rs`): sizes, types and the number of strips are sound, the number of voxels is within the limit, and the
//! file has enough bytes for what it promises.
//!
//! Read are grey, RGB and RGBA pages (the alpha is dropped), channels interleaved or in planes, 8 to 64-bit integers and
//! 16 to 64-bit floating-point numbers, single bits as 0 and 255, either byte order, BigTIFF, uncompressed or compressed
//! by deflate, LZW or PackBits. Where the format leaves room:
//! - pages where 0 is white are inverted (`max - v`), so that bright is large; only unsigned samples have a white;
//! - thumbnails and masks among the pages are skipped;
//! - palettes, CMYK, YCbCr and JPEG are refused: their numbers are not intensities, or not the ones that were measured;
//! - the orientation tag is ignored, as by every program that takes a page for an array.
//!
//! The description of the first page is used if it is ImageJ's (`imagej.rs`), which may promise further planes behind a
//! single page, or a microscope's (`ome.rs`). Both give the distance between voxels, and say whether the pages are
//! channels or time points instead of slices, which no volume can hold.
//!
//! Format: <https://www.itu.int/itudoc/itu-t/com16/tiff-fx/docs/tiff6.pdf>

mod directory;
mod imagej;
#[cfg(feature = "tiff")]
mod ome;
#[cfg(feature = "tiff")]
mod page;
#[cfg(feature = "tiff")]
mod reader;
#[cfg(feature = "tiff")]
mod stack;
#[cfg(feature = "tiff")]
#[cfg(test)]
mod tests;

use std::io::BufReader;
use std::path::Path;

use self::directory::{DESCRIPTION, TiffHeader, Walker};
use self::imagej::Description;
use super::{Format, FormatInfo, Head, VolumeReader};
use crate::layout::open_file;
use crate::{ReadOptions, VolumeError};

#[cfg(feature = "tiff")]
pub(super) use self::reader::SinglePage;

pub(super) struct Tiff;

static INFO: FormatInfo = FormatInfo::new(
    "tiff",
    "TIFF",
    "A TIFF or BigTIFF of several equal pages of grey, RGB or RGBA samples, ImageJ stacks and OME-TIFF among them.",
)
.extensions(&[".tif", ".tiff"])
.compressions(&["deflate", "LZW", "PackBits"])
.feature("tiff", cfg!(feature = "tiff"));

impl Format for Tiff {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    fn sniff(&self, head: &Head) -> bool {
        TiffHeader::sniff(head.bytes())
    }

    #[cfg(feature = "tiff")]
    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        reader::open(path, options)
    }

    #[cfg(not(feature = "tiff"))]
    fn open(&self, _: &Path, _: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        Err(INFO.disabled())
    }
}

/// Whether a file is a TIFF of one page and may be a slice. Only its first directory is read.
pub(super) fn is_single_page(path: &Path) -> bool {
    let single = || -> Result<bool, VolumeError> {
        let mut reader = BufReader::new(open_file(path)?);
        let mut walker = Walker::new(&mut reader)?;
        let Some(directory) = walker.next_directory()? else { return Ok(false) };
        let text = walker.text(&directory, DESCRIPTION)?.unwrap_or_default();
        Ok(!walker.more() && Description::parse(&text).is_none_or(|text| text.images == 1))
    };
    single().unwrap_or(false)
}
