//! One page of a TIFF file: what its directory says, checked before the decoder sees it.

use std::io::{Read, Seek};

use super::directory::{Directory, Tag, Walker, malformed};
use crate::formats::plane_format::{PlaneFormat, check_credible};
use crate::text::Listed;
use crate::{SampleType, VolumeError};

pub(super) const STRIP_OFFSETS: Tag = 273;
pub(super) const STRIP_BYTES: Tag = 279;
pub(super) const X_RESOLUTION: Tag = 282;
pub(super) const Y_RESOLUTION: Tag = 283;
const SUBFILE: Tag = 254;
const WIDTH: Tag = 256;
const HEIGHT: Tag = 257;
const BITS: Tag = 258;
const COMPRESSION: Tag = 259;
const PHOTOMETRIC: Tag = 262;
const FILL_ORDER: Tag = 266;
const SAMPLES: Tag = 277;
const ROWS_PER_STRIP: Tag = 278;
const PLANAR: Tag = 284;
const PREDICTOR: Tag = 317;
const TILE_WIDTH: Tag = 322;
const TILE_HEIGHT: Tag = 323;
const TILE_OFFSETS: Tag = 324;
const TILE_BYTES: Tag = 325;
const EXTRA_SAMPLES: Tag = 338;
const SAMPLE_FORMAT: Tag = 339;

/// The longest side that a tile may have if the page is smaller.
const LONGEST_TILE: u64 = 1 << 16;

/// A page that can be decoded.
#[derive(Clone, Copy)]
pub(super) struct Page {
    pub(super) format: PlaneFormat,
    /// One bit a pixel, eight to a byte, which become 0 and 255.
    pub(super) bilevel: bool,
    /// The channels one after the other instead of interleaved.
    pub(super) planar: bool,
    /// Not compressed.
    pub(super) plain: bool,
    /// 0 is white.
    pub(super) inverted: bool,
}

impl Page {
    /// The page of a directory; `None` for thumbnails and masks (NewSubfileType 1 and 4), which are not slices.
    ///
    /// In either case the strips or tiles of the directory cover the page: the decoder relies on that.
    pub(super) fn of<R: Read + Seek>(
        walker: &mut Walker<'_, R>,
        directory: &Directory,
    ) -> Result<Option<Self>, VolumeError> {
        let mut side = |tag| {
            let length = walker.number(directory, tag)?.filter(|&length| (1..=u64::from(u32::MAX)).contains(&length));
            length.ok_or_else(|| malformed("a page of the TIFF file has no width or height", "both are 1 to 2^32 - 1"))
        };
        let (width, height) = (side(WIDTH)?, side(HEIGHT)?);
        let channels = walker.number(directory, SAMPLES)?.unwrap_or(1);
        let planar = walker.number(directory, PLANAR)?.unwrap_or(1) == 2;
        if !(1..=u64::from(u16::MAX)).contains(&channels) {
            return Err(malformed(
                &format!("a page of the TIFF file has {channels} samples per pixel"),
                "1, 3 or 4 are read",
            ));
        }
        covered(walker, directory, width, height, if planar { channels } else { 1 })?;
        if walker.number(directory, SUBFILE)?.unwrap_or(0) & 0b101 != 0 {
            return Ok(None);
        }
        let (ty, bilevel) = sample_type(walker, directory, channels)?;
        let inverted = colours(walker, directory, channels, ty)?;
        let plain = compression(walker, directory, ty, bilevel)?;
        let format = PlaneFormat { height: height as usize, width: width as usize, channels: channels as usize, ty };
        let page = Self { format, bilevel, planar: planar && channels > 1, plain, inverted };
        check_credible(if bilevel { format.bytes() / 8 } else { format.bytes() }, !plain, walker.length)?;
        Ok(Some(page))
    }
}

/// Checks that strips or tiles, as many as offsets and sizes are given, cover a page.
fn covered<R: Read + Seek>(
    walker: &mut Walker<'_, R>,
    directory: &Directory,
    width: u64,
    height: u64,
    planes: u64,
) -> Result<(), VolumeError> {
    let wrong = |what: String| malformed(&what, "they must cover the page");
    let counts =
        |walker: &Walker<'_, R>, offsets, bytes| (walker.count(directory, offsets), walker.count(directory, bytes));
    let (strips, tiles) = (counts(walker, STRIP_OFFSETS, STRIP_BYTES), counts(walker, TILE_OFFSETS, TILE_BYTES));
    let (given, needed) = if tiles == (0, 0) {
        let rows = walker.number(directory, ROWS_PER_STRIP)?.unwrap_or(height);
        if rows == 0 || rows > u64::from(u32::MAX) {
            return Err(wrong(format!("the strips of a TIFF page have {rows} rows")));
        }
        (strips, u128::from(height.div_ceil(rows)))
    } else {
        let across = walker.number(directory, TILE_WIDTH)?.unwrap_or(0);
        let down = walker.number(directory, TILE_HEIGHT)?.unwrap_or(0);
        let sane = |tile, side| (1..=u64::max(LONGEST_TILE, side)).contains(&tile);
        if strips != (0, 0) || !sane(across, width) || !sane(down, height) {
            return Err(wrong(format!(
                "the tiles of a TIFF page have {down} x {across} pixels, or strips beside them"
            )));
        }
        (tiles, u128::from(width.div_ceil(across)) * u128::from(height.div_ceil(down)))
    };
    let needed = needed * u128::from(planes);
    if needed > u128::from(u32::MAX) || u128::from(given.0) != needed || given.0 != given.1 {
        return Err(wrong(format!("a TIFF page lists {} strips or tiles and {} sizes of them", given.0, given.1)));
    }
    Ok(())
}

/// The type of the samples, and whether they are single bits.
fn sample_type<R: Read + Seek>(
    walker: &mut Walker<'_, R>,
    directory: &Directory,
    channels: u64,
) -> Result<(SampleType, bool), VolumeError> {
    let mut same = |tag, absent| {
        let numbers = walker.numbers(directory, tag)?.unwrap_or_else(|| vec![absent]);
        let first = numbers.first().copied().unwrap_or(0);
        let fits = numbers.len() == 1 || numbers.len() as u64 == channels;
        if !fits || numbers.iter().any(|&number| number != first) {
            let what = format!("a TIFF page whose channels have different types {}", Listed(&numbers));
            return Err(unsupported(what));
        }
        Ok(first)
    };
    let (bits, format) = (same(BITS, 1)?, same(SAMPLE_FORMAT, 1)?);
    let ty = match (format, bits) {
        (1, 1) if channels == 1 => return Ok((SampleType::U8, true)),
        (1, 8) => SampleType::U8,
        (1, 16) => SampleType::U16,
        (1, 32) => SampleType::U32,
        (1, 64) => SampleType::U64,
        (2, 8) => SampleType::I8,
        (2, 16) => SampleType::I16,
        (2, 32) => SampleType::I32,
        (2, 64) => SampleType::I64,
        (3, 16) => SampleType::F16,
        (3, 32) => SampleType::F32,
        (3, 64) => SampleType::F64,
        _ => {
            let kind = match format {
                1 => "unsigned",
                2 => "signed",
                3 => "floating point",
                _ => "undefined",
            };
            return Err(unsupported(format!("a TIFF page of {bits}-bit {kind} samples")));
        }
    };
    Ok((ty, false))
}

/// Checks that the samples are grey, RGB or RGBA; whether 0 is white.
fn colours<R: Read + Seek>(
    walker: &mut Walker<'_, R>,
    directory: &Directory,
    channels: u64,
    ty: SampleType,
) -> Result<bool, VolumeError> {
    let extra = walker.numbers(directory, EXTRA_SAMPLES)?.unwrap_or_default();
    let unsigned = matches!(ty, SampleType::U8 | SampleType::U16 | SampleType::U32 | SampleType::U64);
    match (walker.number(directory, PHOTOMETRIC)?, channels, extra.as_slice()) {
        (Some(0), 1, []) if unsigned => Ok(true),
        (Some(1), 1, []) | (Some(2), 3, []) | (Some(2), 4, [] | [1 | 2]) => Ok(false),
        (Some(0), 1, []) => Err(unsupported(format!("a TIFF page where 0 is white, of {ty} samples"))),
        (photometric, channels, _) => {
            let kind = match photometric {
                Some(0 | 1) => "grey",
                Some(2) => "RGB",
                Some(3) => "palette",
                Some(4) => "mask",
                Some(5) => "CMYK",
                Some(6) => "YCbCr",
                Some(8..=10) => "CIE Lab",
                _ => "unnamed",
            };
            Err(unsupported(format!("a TIFF page of {kind} colours in {channels} samples per pixel")))
        }
    }
}

/// Checks that the compression is one that is read; whether there is none.
fn compression<R: Read + Seek>(
    walker: &mut Walker<'_, R>,
    directory: &Directory,
    ty: SampleType,
    bilevel: bool,
) -> Result<bool, VolumeError> {
    let compression = walker.number(directory, COMPRESSION)?.unwrap_or(1);
    if !matches!(compression, 1 | 5 | 8 | 32_773 | 32_946) {
        let name = match compression {
            2..=4 => "fax",
            6 | 7 => "JPEG",
            34_712 => "JPEG 2000",
            34_925 => "LZMA",
            50_000 => "Zstandard",
            50_001 => "WebP",
            _ => "unknown",
        };
        return Err(unsupported(format!("a TIFF page of {name} compression ({compression})")));
    }
    let float = matches!(ty, SampleType::F16 | SampleType::F32 | SampleType::F64);
    match walker.number(directory, PREDICTOR)?.unwrap_or(1) {
        1 => {}
        2 if !bilevel => {}
        3 if float => {}
        other => return Err(unsupported(format!("predictor {other} of a TIFF page of {ty} samples"))),
    }
    if bilevel && walker.number(directory, FILL_ORDER)?.unwrap_or(1) != 1 {
        return Err(unsupported("a TIFF page of bits in reversed order".into()));
    }
    Ok(compression == 1)
}

pub(super) fn unsupported(what: String) -> VolumeError {
    VolumeError::Unsupported {
        what,
        supported: "grey, RGB and RGBA pages of 8 to 64-bit integers or 16 to 64-bit floating point numbers (and grey \
                    ones of single bits), uncompressed or compressed by deflate, LZW or PackBits"
            .into(),
    }
}
