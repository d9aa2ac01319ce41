//! Folders of slices: equal pictures whose names count, `s9.png` before `s10.png`.
//!
//! The *slices* of a folder are its PNG, JPEG and TIFF files that are not hidden, in natural order of their names; they
//! are the volume's Z axis. TIFF files count only where every one of the folder has a single page: where one has more,
//! they are volumes of their own. Three slices make a stack. All of a stack have one size and one sample type, mixed
//! kinds or not; nothing is scaled or converted, and a folder in which one differs is refused by the name of that file.
//!
//! Grey, grey with alpha, RGB and RGBA of 8 or 16 bits are read, the alpha dropped; palette PNG becomes RGB, PNG of 1, 2
//! or 4 bits becomes 8-bit grey. Samples of 16 bits go through the intensity rule, over the whole stack.

use std::fs;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

use image::{ColorType, ImageDecoder, ImageReader};

use super::picture::{Format, credible};
use super::samples::{Endian, SampleType, Samples};
use super::tiff::{self, SinglePage};
use super::{FileKind, MIN_SIDE, ReadOptions, Shape, Source, Volume, VolumeError, decode, natural_cmp};

/// Ends of the names of pictures that have one page by their nature.
const PICTURES: &[&str] = &["png", "jpg", "jpeg"];

/// The slices of a folder in natural order; fewer than [`MIN_SIDE`] are no stack.
pub(super) fn of_folder(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let (mut pictures, mut tiffs) = (Vec::new(), Vec::new());
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        let hidden = path.file_name().is_none_or(|name| name.as_encoded_bytes().starts_with(b"."));
        let list = match ending.as_str() {
            _ if hidden => continue,
            ending if PICTURES.contains(&ending) => &mut pictures,
            "tif" | "tiff" => &mut tiffs,
            _ => continue,
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

/// The volume in a folder of slices.
pub(super) fn read(folder: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    let mut stack = Stack::open(folder, options)?;
    let length = stack.paths.iter().filter_map(|path| Some(fs::metadata(path).ok()?.len())).sum();
    decode::may_inflate(stack.paths.len() as u128 * stack.format.bytes(), length, options.max_inflated)?;
    let mut bytes = Vec::new();
    stack.next(stack.paths.len(), &mut bytes)?;
    let Format { channels, ty, .. } = stack.format;
    let samples = Samples { shape: stack.shape(), channels, ty, endian: Endian::NATIVE, bytes };
    let (volume, mapping) = samples.into_volume(options.intensity)?;
    Ok((volume, Source { kind: FileKind::Slices, samples: ty, mapping, spacing: None }))
}

/// The slices of a folder, read one after the other.
pub(super) struct Stack {
    paths: Vec<PathBuf>,
    /// That of the first slice, which the others must have.
    format: Format,
    /// How many slices have been read.
    read: usize,
}

impl Stack {
    /// Lists the folder and reads the header of the first slice.
    pub(super) fn open(folder: &Path, options: &ReadOptions) -> Result<Self, VolumeError> {
        let paths = of_folder(folder).map_err(|source| VolumeError::Io { doing: "listing the folder", source })?;
        let first = match paths.as_slice() {
            [first, ..] if paths.len() >= MIN_SIDE => first,
            _ => {
                return Err(VolumeError::Malformed {
                    found: format!("the folder holds {} slices", paths.len()),
                    expected: format!(
                        "a folder that is one volume has at least {MIN_SIDE} PNG, JPEG or single-page TIFF slices of one size; of a folder of volumes name the files"
                    ),
                });
            }
        };
        let format = Slice::open(first)?.format;
        format.within(paths.len() as u64, options.max_voxels)?;
        Ok(Self { paths, format, read: 0 })
    }

    pub(super) fn shape(&self) -> Shape {
        [self.paths.len(), self.format.height, self.format.width]
    }

    pub(super) fn format(&self) -> Format {
        self.format
    }

    /// Goes back to the first slice.
    pub(super) fn rewind(&mut self) {
        self.read = 0;
    }

    /// Appends the samples of the next `count` slices in the byte order of this machine.
    pub(super) fn next(&mut self, count: usize, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        let Some(first) = self.paths.first() else { return Ok(()) };
        for path in self.paths.iter().skip(self.read).take(count) {
            let slice = Slice::open(path)?;
            if slice.format != self.format {
                return Err(VolumeError::Malformed {
                    found: format!("the slice {} has {}", name(path), slice.format),
                    expected: format!(
                        "the first, {}, has {}: all slices of a volume are alike",
                        name(first),
                        self.format
                    ),
                });
            }
            slice.decode(path, bytes)?;
            self.read += 1;
        }
        Ok(())
    }
}

/// One slice whose header has been read.
struct Slice {
    format: Format,
    pixels: Pixels,
}

/// What decodes a slice.
enum Pixels {
    Tiff(SinglePage),
    /// PNG or JPEG; whether an alpha follows each grey sample.
    Picture(Box<dyn ImageDecoder>, bool),
}

impl Slice {
    fn open(path: &Path) -> Result<Self, VolumeError> {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        if ending == "tif" || ending == "tiff" {
            let page = SinglePage::open(path).map_err(|error| undecodable(path, error))?;
            return Ok(Self { format: page.format(), pixels: Pixels::Tiff(page) });
        }
        Self::open_picture(path)
    }

    fn open_picture(path: &Path) -> Result<Self, VolumeError> {
        let file = decode::open(path).map_err(|error| undecodable(path, error))?;
        let length = file.metadata().map_err(|error| undecodable(path, error))?.len();
        // The reader's own limits (512 MiB beside the pixels) stand.
        let reader = ImageReader::new(BufReader::new(file)).with_guessed_format();
        let decoder = reader.map_err(|error| undecodable(path, error))?.into_decoder();
        let decoder = decoder.map_err(|error| undecodable(path, error))?;
        let (width, height) = decoder.dimensions();
        let (channels, ty, alpha) = match decoder.color_type() {
            ColorType::L8 => (1, SampleType::U8, false),
            ColorType::La8 => (1, SampleType::U8, true),
            ColorType::Rgb8 => (3, SampleType::U8, false),
            ColorType::Rgba8 => (4, SampleType::U8, false),
            ColorType::L16 => (1, SampleType::U16, false),
            ColorType::La16 => (1, SampleType::U16, true),
            ColorType::Rgb16 => (3, SampleType::U16, false),
            ColorType::Rgba16 => (4, SampleType::U16, false),
            other => {
                return Err(VolumeError::Unsupported {
                    what: format!("the slice {} of {other:?} samples", name(path)),
                    supported: "grey, RGB and RGBA slices of 8 or 16 bits".into(),
                });
            }
        };
        credible(u128::from(decoder.total_bytes()), true, length).map_err(|error| undecodable(path, error))?;
        let format = Format { height: height as usize, width: width as usize, channels, ty };
        Ok(Self { format, pixels: Pixels::Picture(Box::new(decoder), alpha) })
    }

    /// Appends the samples in the byte order of this machine.
    fn decode(self, path: &Path, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        let start = bytes.len();
        match self.pixels {
            Pixels::Tiff(page) => page.decode(bytes).map_err(|error| undecodable(path, error))?,
            Pixels::Picture(decoder, alpha) => {
                let total = usize::try_from(decoder.total_bytes()).map_err(|error| undecodable(path, error))?;
                bytes.resize(start + total, 0);
                let pixels = bytes.get_mut(start..).unwrap_or_default();
                decoder.read_image_boxed(pixels).map_err(|error| undecodable(path, error))?;
                if alpha {
                    let size = self.format.ty.size();
                    for pixel in 0..total / (2 * size) {
                        let from = start + 2 * size * pixel;
                        bytes.copy_within(from..from + size, start + size * pixel);
                    }
                    bytes.truncate(start + total / 2);
                }
            }
        }
        Ok(())
    }
}

/// A file's name as an error shows it.
fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().escape_debug().to_string()
}

fn undecodable(path: &Path, error: impl std::error::Error + Send + Sync + 'static) -> VolumeError {
    VolumeError::Decode { what: format!("the slice {}", name(path)), source: Box::new(error) }
}
