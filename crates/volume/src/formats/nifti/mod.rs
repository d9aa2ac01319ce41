//! NIfTI-1 and NIfTI-2: one file (`.nii`, `.nii.gz`) or a pair (`.hdr` and `.img`, each possibly with `.gz`), in either
//! byte order. The older Analyze 7.5 pair, which has the same header without a magic, is read as well.
//!
//! The axes stay as stored: (i, j, k) with i fastest becomes (Z, Y, X) = (k, j, i). Neither qform nor sform is applied, as
//! a texture has no anatomical orientation. The calibration `scl_slope * v + scl_inter` is applied if the slope is finite
//! and not 0: it decides what an intensity window means, and a negative slope inverts the levels. Samples of `u8` are
//! taken as they are. The calibration fields of Analyze mean other things and are ignored. Series over time are refused.
//!
//! Format: <https://nifti.nimh.nih.gov>

mod header;
#[cfg(test)]
mod tests;

use std::io::Read;
use std::path::{Path, PathBuf};

use self::header::{Form, NiftiHeader, SIZE_2, cut_short};
use super::{Format, FormatInfo, Head, VolumeReader};
use crate::layout::{self, DataLayout, Encoding, Start, open_file};
use crate::text::{excerpt_bytes, excerpt_name};
use crate::{ReadOptions, VolumeError};

pub(super) struct Nifti;

static INFO: FormatInfo = FormatInfo::new(
    "nifti",
    "NIfTI",
    "NIfTI-1, NIfTI-2 and Analyze 7.5, in one file or as a pair of header and image; plain or gzip.",
)
.extensions(&[".nii", ".nii.gz", ".hdr", ".hdr.gz"])
.aliases(&[".img", ".img.gz"])
.detached(&[".hdr"], &[".img"])
.compressions(&["gzip"]);

const GZIP: &[u8] = &[0x1f, 0x8b];

impl Format for Nifti {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    /// Compressed or not. An Analyze header has no magic and is recognised by its name.
    fn sniff(&self, head: &Head) -> bool {
        let head = head.bytes();
        #[cfg(feature = "gzip")]
        let decompressed = if head.starts_with(GZIP) { layout::gzip_start(head, SIZE_2 as u64) } else { Vec::new() };
        #[cfg(feature = "gzip")]
        let head = if head.starts_with(GZIP) { &decompressed } else { head };
        matches!(Form::of(head), Some((form, _)) if form != Form::Analyze)
    }

    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        layout(path, options)?.open()
    }
}

/// Where the samples of a NIfTI file or pair lie.
fn layout(path: &Path, options: &ReadOptions) -> Result<DataLayout, VolumeError> {
    let header_path = header_of(path)?;
    let bytes = header_bytes(&header_path)?;
    if let Some(size) = cut_short(&bytes) {
        let found = format!("the file ends after {} bytes, within its header of {size}", bytes.len());
        return Err(VolumeError::malformed(found, "samples should follow the header"));
    }
    let header = NiftiHeader::parse(&bytes).ok_or_else(|| {
        let start = excerpt_bytes(bytes.get(..bytes.len().min(8)).unwrap_or_default());
        VolumeError::malformed(
            format!("the header begins with \"{start}\""),
            "a NIfTI header begins with its size, 348 or 540, and has the magic n+1, ni1, n+2 or ni2",
        )
    })?;
    let samples = header.samples()?;
    let axes = header.axes(options)?;
    let offset = header.offset()?;
    let file = if header.form.is_pair() { image_of(&header_path)? } else { header_path };
    let compressed = begins_with_gzip(&file)?;
    Ok(DataLayout {
        start: Start::At(if compressed { 0 } else { offset }),
        encoding: if compressed { Encoding::Gzip } else { Encoding::Raw },
        skip: if compressed { offset } else { 0 },
        calibration: header.calibration.unwrap_or_default(),
        spacing: header.spacing(),
        ..DataLayout::raw(file, 0, axes, samples, header.endian)
    })
}

/// The first bytes of a header file, decompressed; fewer where it is shorter.
fn header_bytes(path: &Path) -> Result<Vec<u8>, VolumeError> {
    if begins_with_gzip(path)? {
        return decompressed_header(path);
    }
    let mut bytes = Vec::new();
    open_file(path)?.take(SIZE_2 as u64).read_to_end(&mut bytes).map_err(reading)?;
    Ok(bytes)
}

#[cfg(feature = "gzip")]
fn decompressed_header(path: &Path) -> Result<Vec<u8>, VolumeError> {
    let mut bytes = Vec::new();
    let stream = flate2::bufread::GzDecoder::new(std::io::BufReader::new(open_file(path)?));
    let read = stream.take(SIZE_2 as u64).read_to_end(&mut bytes);
    read.map_err(|source| VolumeError::decode("the compressed header", &source))?;
    Ok(bytes)
}

#[cfg(not(feature = "gzip"))]
fn decompressed_header(_: &Path) -> Result<Vec<u8>, VolumeError> {
    Err(VolumeError::FeatureDisabled { what: "gzip data", feature: "gzip" })
}

fn begins_with_gzip(path: &Path) -> Result<bool, VolumeError> {
    let mut start = Vec::new();
    open_file(path)?.take(GZIP.len() as u64).read_to_end(&mut start).map_err(reading)?;
    Ok(start == GZIP)
}

fn reading(source: std::io::Error) -> VolumeError {
    VolumeError::Io { doing: "reading the header", source }
}

/// The path of the header: for an `.img` (or `.img.gz`) that of the `.hdr` beside it.
fn header_of(path: &Path) -> Result<PathBuf, VolumeError> {
    match partner(path, "img", "hdr") {
        Some(header) => existing(header),
        None => Ok(path.to_owned()),
    }
}

/// The path of the image: for a `.hdr` (or `.hdr.gz`) that of the `.img` beside it.
fn image_of(header: &Path) -> Result<PathBuf, VolumeError> {
    let image = partner(header, "hdr", "img").ok_or_else(|| {
        let found = "the header is one of a pair of files but its name does not end in .hdr";
        VolumeError::malformed(found, "a pair is called NAME.hdr and NAME.img")
    })?;
    let image = existing(image)?;
    // As for data files that headers name, no link may lead out of the folder.
    layout::beside(header, Path::new(image.file_name().unwrap_or_default()))
}

/// The names of the other file of a pair, plain and compressed; `None` if the path does not have the extension `this`.
fn partner(path: &Path, this: &str, other: &str) -> Option<[PathBuf; 2]> {
    let compressed = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"));
    let plain = if compressed { path.with_extension("") } else { path.to_owned() };
    let ending = plain.extension().filter(|ending| ending.eq_ignore_ascii_case(this))?;
    let upper = ending.as_encoded_bytes().iter().all(u8::is_ascii_uppercase);
    let plain = plain.with_extension(if upper { other.to_ascii_uppercase() } else { other.to_owned() });
    let mut compressed = plain.clone().into_os_string();
    compressed.push(".gz");
    Some([plain, compressed.into()])
}

/// The one of two paths that exists.
fn existing([plain, compressed]: [PathBuf; 2]) -> Result<PathBuf, VolumeError> {
    let missing = excerpt_name(&plain);
    let found = [plain, compressed].into_iter().find(|path| path.exists());
    found.ok_or(VolumeError::MissingHalf { missing })
}
