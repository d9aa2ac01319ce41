//! [`Slice`]: one picture of a folder.

use std::error::Error;
use std::path::Path;

#[cfg(feature = "images")]
use std::io::BufReader;

#[cfg(feature = "images")]
use image::{ColorType, ImageDecoder, ImageReader};

use crate::VolumeError;
use crate::formats::has_ending;
use crate::formats::plane_format::PlaneFormat;
#[cfg(feature = "tiff")]
use crate::formats::tiff::SinglePage;
use crate::text::excerpt_name;
#[cfg(feature = "images")]
use crate::{Endian, SampleType, formats::plane_format::check_credible, layout::open_file, samples::make_little};

/// The extensions of pictures that may have more than one page.
pub(super) const TIFF: &[&str] = &[".tif", ".tiff"];

/// One slice whose header has been read.
pub(super) struct Slice {
    pub(super) format: PlaneFormat,
    /// Appends the samples, little-endian.
    decode: Box<Decode>,
}

type Decode = dyn FnOnce(&mut Vec<u8>) -> Result<(), Box<dyn Error + Send + Sync>>;

impl Slice {
    /// Reads the header of a slice.
    pub(super) fn open(path: &Path) -> Result<Self, VolumeError> {
        if has_ending(path, TIFF) { Self::open_tiff(path) } else { Self::open_picture(path) }
    }

    #[cfg(feature = "tiff")]
    fn open_tiff(path: &Path) -> Result<Self, VolumeError> {
        let page = SinglePage::open(path).map_err(|error| undecodable(path, &error))?;
        Ok(Self { format: page.format(), decode: Box::new(|bytes| Ok(page.decode(bytes)?)) })
    }

    #[cfg(not(feature = "tiff"))]
    fn open_tiff(_: &Path) -> Result<Self, VolumeError> {
        Err(VolumeError::FeatureDisabled { what: "a slice in TIFF", feature: "tiff" })
    }

    #[cfg(not(feature = "images"))]
    fn open_picture(_: &Path) -> Result<Self, VolumeError> {
        Err(VolumeError::FeatureDisabled { what: "a slice in PNG or JPEG", feature: "images" })
    }

    #[cfg(feature = "images")]
    fn open_picture(path: &Path) -> Result<Self, VolumeError> {
        let file = open_file(path).map_err(|error| undecodable(path, &error))?;
        let length = file.metadata().map_err(|error| undecodable(path, &error))?.len();
        // The limits of the reader itself (512 MiB besides the pixels) apply.
        let reader = ImageReader::new(BufReader::new(file)).with_guessed_format();
        let decoder = reader.map_err(|error| undecodable(path, &error))?.into_decoder();
        let decoder = decoder.map_err(|error| undecodable(path, &error))?;
        let (width, height) = decoder.dimensions();
        let (channels, ty, grey_alpha) = match decoder.color_type() {
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
                    what: format!("the slice {} of {other:?} samples", excerpt_name(path)),
                    supported: "grey, RGB and RGBA slices of 8 or 16 bits".into(),
                });
            }
        };
        let promised = u128::from(decoder.total_bytes());
        check_credible(promised, true, length).map_err(|error| undecodable(path, &error))?;
        let format = PlaneFormat { height: height as usize, width: width as usize, channels, ty };
        let decode = move |bytes: &mut Vec<u8>| {
            let start = bytes.len();
            decode_picture(Box::new(decoder), bytes)?;
            if grey_alpha {
                drop_grey_alpha(bytes, start, ty.size());
            }
            make_little(bytes.get_mut(start..).unwrap_or_default(), ty, Endian::NATIVE);
            Ok(())
        };
        Ok(Self { format, decode: Box::new(decode) })
    }

    /// Appends the samples, little-endian.
    pub(super) fn decode(self, path: &Path, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        (self.decode)(bytes).map_err(|error| undecodable(path, &*error))
    }
}

/// Appends the samples in the byte order of this machine.
#[cfg(feature = "images")]
fn decode_picture(decoder: Box<dyn ImageDecoder>, bytes: &mut Vec<u8>) -> Result<(), Box<dyn Error + Send + Sync>> {
    let start = bytes.len();
    bytes.resize(start + usize::try_from(decoder.total_bytes())?, 0);
    Ok(decoder.read_image_boxed(bytes.get_mut(start..).unwrap_or_default())?)
}

/// Removes the alpha that follows each grey sample of `size` bytes from `start` on, in place.
#[cfg(feature = "images")]
fn drop_grey_alpha(bytes: &mut Vec<u8>, start: usize, size: usize) {
    let pixels = (bytes.len() - start) / (2 * size);
    for pixel in 0..pixels {
        let from = start + 2 * size * pixel;
        bytes.copy_within(from..from + size, start + size * pixel);
    }
    bytes.truncate(start + pixels * size);
}

fn undecodable(path: &Path, error: &dyn Error) -> VolumeError {
    VolumeError::decode(format!("the slice {}", excerpt_name(path)), error)
}
