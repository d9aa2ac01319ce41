//! Folders of slices: equal pictures in natural order of their names, `s9.png` before `s10.png`.
//!
//! The *slices* of a folder are its PNG, JPEG and TIFF files that are not hidden; they are the Z axis of the volume. TIFF
//! files count only if every one of the folder has a single page: where one has more, they are volumes of their own. Three
//! slices make a volume. All slices have the same size and sample type, whatever their file formats; nothing is scaled or
//! converted, and an error names the first slice that differs.
//!
//! Grey, grey with alpha, RGB and RGBA of 8 or 16 bits are read, the alpha dropped; palette PNG becomes RGB, PNG of 1, 2
//! or 4 bits becomes 8-bit grey. The intensity rule sees the samples of the whole folder.

mod slice;

use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use self::slice::{Slice, TIFF};
use super::plane_format::PlaneFormat;
use super::{Access, Format, FormatInfo, Head, VolumeHeader, VolumeReader, has_ending, tiff};
use crate::discovery::natural_cmp;
use crate::text::excerpt_name;
use crate::{MIN_SIDE, ReadOptions, VolumeError};

pub(super) struct Slices;

static INFO: FormatInfo = FormatInfo::new(
    "slices",
    "folder of slices",
    "A folder of at least three equal PNG, JPEG or single-page TIFF pictures in natural order of their names.",
)
.slices(&[".png", ".jpg", ".jpeg", ".tif", ".tiff"]);

/// The extensions of pictures that always have one page.
const PICTURES: &[&str] = &[".png", ".jpg", ".jpeg"];

impl Format for Slices {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    fn sniff(&self, head: &Head) -> bool {
        head.is_folder()
    }

    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        Ok(Box::new(SlicesReader::open(path, options)?))
    }

    fn folder_parts(&self, folder: &Path) -> io::Result<Vec<PathBuf>> {
        let slices = slices(folder)?;
        Ok(if slices.len() < MIN_SIDE { Vec::new() } else { slices })
    }
}

/// The slices of a folder in natural order; fewer than [`MIN_SIDE`] are no volume.
fn slices(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let (mut pictures, mut tiffs) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let hidden = path.file_name().is_none_or(|name| name.as_encoded_bytes().starts_with(b"."));
        let list = match () {
            () if hidden => continue,
            () if has_ending(&path, PICTURES) => &mut pictures,
            () if has_ending(&path, TIFF) => &mut tiffs,
            () => continue,
        };
        if path.is_file() {
            list.push(path);
        }
    }
    if tiffs.iter().all(|path| tiff::is_single_page(path)) {
        pictures.append(&mut tiffs);
    }
    pictures.sort_by(|a, b| natural_cmp(a.as_os_str(), b.as_os_str()));
    Ok(pictures)
}

/// Reads the slices of a folder one by one.
struct SlicesReader {
    header: VolumeHeader,
    paths: Vec<PathBuf>,
    /// The format of the first slice, which the others must have.
    format: PlaneFormat,
    /// Bytes of all files.
    length: u64,
}

impl SlicesReader {
    /// Lists the folder and reads the header of the first slice.
    fn open(folder: &Path, options: &ReadOptions) -> Result<Self, VolumeError> {
        let paths = slices(folder).map_err(|source| VolumeError::Io { doing: "listing the folder", source })?;
        let first = match paths.as_slice() {
            [first, ..] if paths.len() >= MIN_SIDE => first,
            _ => return Err(VolumeError::TooFewSlices { found: paths.len() }),
        };
        let format = Slice::open(first)?.format;
        format.within(paths.len() as u64, options.max_voxels)?;
        let length = paths.iter().filter_map(|path| Some(fs::metadata(path).ok()?.len())).sum();
        let header = VolumeHeader::new([paths.len(), format.height, format.width], format.channels, format.ty);
        Ok(Self { header, paths, format, length })
    }

    fn read_slice(&self, path: &Path, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        let slice = Slice::open(path)?;
        if slice.format != self.format {
            let first = self.paths.first().map_or_else(String::new, |first| excerpt_name(first));
            return Err(VolumeError::MixedSlices {
                slice: format!("the slice {}", excerpt_name(path)),
                found: slice.format.to_string(),
                first: format!("the first, {first},"),
                expected: self.format.to_string(),
            });
        }
        slice.decode(path, out)
    }
}

impl VolumeReader for SlicesReader {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn access(&self) -> Access {
        Access::Direct
    }

    fn compressed_bytes(&self) -> Option<u64> {
        Some(self.length)
    }

    fn read_planes(&mut self, planes: Range<usize>, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        for path in self.paths.get(planes).unwrap_or_default() {
            self.read_slice(path, out)?;
        }
        Ok(())
    }
}
