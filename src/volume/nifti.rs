//! NIfTI-1 and NIfTI-2: one file (`.nii`, `.nii.gz`) or a pair (`.hdr` and `.img`, each possibly with `.gz`), in either
//! byte order. The older Analyze 7.5 pair, which has the same header but no magic, is read as well.
//!
//! The axes stay as stored: (i, j, k) with i fastest comes out as (Z, Y, X) = (k, j, i). Neither qform nor sform is
//! applied, as a texture has no anatomical up. The scaling `scl_slope * v + scl_inter` is applied where it is one (a
//! slope that is finite and not 0): it decides what an intensity window means, and a negative slope turns dark and bright
//! round. Samples of `u8` are taken as they are, scaled or not. Analyze's fields in that place mean other things and
//! are left alone. Series over time are refused.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::GzDecoder;

use super::extent::{Axes, Encoding, Extent, Start, dense};
use super::levels::Scaling;
use super::{Endian, FileKind, ReadOptions, SampleType, Source, Volume, VolumeError, decode};

/// Bytes of a NIfTI-1 (and Analyze) header.
const SIZE_1: usize = 348;

/// Bytes of a NIfTI-2 header.
const SIZE_2: usize = 540;

const GZIP: &[u8] = &[0x1f, 0x8b];

/// Whether a file begins as NIfTI does, compressed or not. (An Analyze header is told by its name.)
pub(super) fn sniff(head: &[u8]) -> bool {
    let mut start = Vec::new();
    if head.starts_with(GZIP) {
        // The head is cut off somewhere: what came out before is enough.
        let _cut = GzDecoder::new(head).take(SIZE_2 as u64).read_to_end(&mut start);
    } else {
        start.extend_from_slice(head);
    }
    matches!(Form::of(&start), Some((form, _)) if form != Form::Analyze)
}

/// The volume in a NIfTI file or pair.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    extent(path, options)?.read(options)
}

/// What a header says it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Analyze,
    Nifti1 { pair: bool },
    Nifti2 { pair: bool },
}

impl Form {
    /// The form and byte order of a header, told by its first number (its own size) and its magic.
    fn of(header: &[u8]) -> Option<(Self, Endian)> {
        let size: [u8; 4] = *header.first_chunk()?;
        let sized = |size_of: usize| match size_of as u32 {
            expected if u32::from_le_bytes(size) == expected => Some(Endian::Little),
            expected if u32::from_be_bytes(size) == expected => Some(Endian::Big),
            _ => None,
        };
        if let Some(endian) = sized(SIZE_2) {
            return match header.get(4..8)? {
                b"n+2\0" => Some((Self::Nifti2 { pair: false }, endian)),
                b"ni2\0" => Some((Self::Nifti2 { pair: true }, endian)),
                _ => None,
            };
        }
        let endian = sized(SIZE_1)?;
        match header.get(SIZE_1 - 4..SIZE_1)? {
            b"n+1\0" => Some((Self::Nifti1 { pair: false }, endian)),
            b"ni1\0" => Some((Self::Nifti1 { pair: true }, endian)),
            _ => Some((Self::Analyze, endian)),
        }
    }

    fn pair(self) -> bool {
        match self {
            Self::Analyze => true,
            Self::Nifti1 { pair } | Self::Nifti2 { pair } => pair,
        }
    }
}

/// What a header says of the samples, whichever form it has.
struct Header {
    form: Form,
    endian: Endian,
    dim: [i64; 8],
    datatype: i16,
    /// Distances along i, j, k.
    steps: [f64; 3],
    offset: f64,
    scaling: Option<Scaling>,
}

impl Header {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let (form, endian) = Form::of(bytes)?;
        let field = Numbers { bytes, endian };
        let mut header = Self { form, endian, dim: [0; 8], datatype: 0, steps: [0.0; 3], offset: 0.0, scaling: None };
        if let Form::Nifti2 { .. } = form {
            for (axis, length) in header.dim.iter_mut().enumerate() {
                *length = i64::from_le_bytes(field.at(16 + 8 * axis)?);
            }
            for (axis, step) in header.steps.iter_mut().enumerate() {
                *step = f64::from_le_bytes(field.at(112 + 8 * axis)?);
            }
            header.datatype = i16::from_le_bytes(field.at(12)?);
            header.offset = i64::from_le_bytes(field.at(168)?) as f64;
            header.scaling = Scaling::new(f64::from_le_bytes(field.at(176)?), f64::from_le_bytes(field.at(184)?));
        } else {
            for (axis, length) in header.dim.iter_mut().enumerate() {
                *length = i16::from_le_bytes(field.at(40 + 2 * axis)?).into();
            }
            for (axis, step) in header.steps.iter_mut().enumerate() {
                *step = field.float(80 + 4 * axis)?;
            }
            header.datatype = i16::from_le_bytes(field.at(70)?);
            header.offset = field.float(108)?;
            header.scaling = Scaling::new(field.float(112)?, field.float(116)?).filter(|_| form != Form::Analyze);
        }
        Some(header)
    }

    /// The axes (Z, Y, X) and, if there is one, colour.
    fn axes(&self, options: &ReadOptions) -> Result<Axes, VolumeError> {
        let bad = || VolumeError::Malformed {
            found: format!("the header's dimensions are {:?}", self.dim),
            expected: "the first should count the axes, 1 to 7, and as many lengths should follow".into(),
        };
        let count = usize::try_from(self.dim[0]).ok().filter(|count| (1..=7).contains(count)).ok_or_else(bad)?;
        let lengths = self.dim[1..=count].iter().map(|&length| u64::try_from(length).map_err(|_| bad()));
        let lengths = lengths.collect::<Result<Vec<_>, _>>()?;
        if let Some(&volumes) = lengths.get(3).filter(|&&volumes| volumes > 1) {
            return Err(VolumeError::Unsupported {
                what: format!("a series of {volumes} volumes over time"),
                supported: "one volume: split the series, e.g. with `fslsplit`".into(),
            });
        }
        // (i, j, k, time, vector, ...): of the last ones only a vector of 3 or 4 may be longer than 1.
        let mut axes = dense(lengths);
        let others = axes.split_off(axes.len().min(3));
        axes.reverse();
        axes.extend(others.into_iter().filter(|axis| axis.length != 1));
        let axes = Axes::new(&axes, options.max_voxels)?;
        match self.datatype {
            128 | 2304 if axes.channels != 1 => Err(bad()),
            128 => Ok(axes.interleaved(3)),
            2304 => Ok(axes.interleaved(4)),
            _ => Ok(axes),
        }
    }

    fn samples(&self) -> Result<SampleType, VolumeError> {
        Ok(match self.datatype {
            2 | 128 | 2304 => SampleType::U8,
            4 => SampleType::I16,
            8 => SampleType::I32,
            16 => SampleType::F32,
            64 => SampleType::F64,
            256 => SampleType::I8,
            512 => SampleType::U16,
            768 => SampleType::U32,
            1024 => SampleType::I64,
            1280 => SampleType::U64,
            other => {
                return Err(VolumeError::Unsupported {
                    what: format!("NIfTI data of type {other}"),
                    supported: "integers of 8 to 64 bits, 32 and 64 bit floats, RGB24 and RGBA32".into(),
                });
            }
        })
    }

    /// Where in the file of the samples they begin.
    fn offset(&self) -> Result<u64, VolumeError> {
        if !(0.0..=i64::MAX as f64).contains(&self.offset) {
            return Err(VolumeError::Malformed {
                found: format!("the samples begin at byte {}", self.offset),
                expected: "vox_offset should be 0 or more".into(),
            });
        }
        // In one file they follow the header and 4 bytes that tell of extensions, whatever a careless writer left out.
        let least = match self.form {
            Form::Nifti1 { pair: false } => SIZE_1 + 4,
            Form::Nifti2 { pair: false } => SIZE_2 + 4,
            _ => 0,
        };
        Ok((self.offset as u64).max(least as u64))
    }

    fn spacing(&self) -> Option<[f64; 3]> {
        let [x, y, z] = self.steps.map(f64::abs);
        [x, y, z].iter().all(|step| step.is_finite() && *step > 0.0).then_some([z, y, x])
    }
}

/// Numbers in a header, by their place.
struct Numbers<'a> {
    bytes: &'a [u8],
    endian: Endian,
}

impl Numbers<'_> {
    /// The bytes of a number, the lowest first.
    fn at<const N: usize>(&self, place: usize) -> Option<[u8; N]> {
        let mut bytes: [u8; N] = *self.bytes.get(place..)?.first_chunk()?;
        if self.endian == Endian::Big {
            bytes.reverse();
        }
        Some(bytes)
    }

    fn float(&self, place: usize) -> Option<f64> {
        Some(f32::from_le_bytes(self.at(place)?).into())
    }
}

/// Where the samples of a NIfTI file or pair lie.
fn extent(path: &Path, options: &ReadOptions) -> Result<Extent, VolumeError> {
    let header_path = header_of(path)?;
    let bytes = header_bytes(&header_path)?;
    let header = Header::parse(&bytes).ok_or_else(|| VolumeError::Malformed {
        found: format!("the header begins with \"{}\"", bytes[..bytes.len().min(8)].escape_ascii()),
        expected: "a NIfTI header begins with its size, 348 or 540, and has the magic n+1, ni1, n+2 or ni2".into(),
    })?;
    let samples = header.samples()?;
    let axes = header.axes(options)?;
    let offset = header.offset()?;
    let file = if header.form.pair() { image_of(&header_path)? } else { header_path };
    let packed = begins_with_gzip(&file)?;
    Ok(Extent {
        kind: FileKind::Nifti,
        start: Start::At(if packed { 0 } else { offset }),
        encoding: if packed { Encoding::Gzip } else { Encoding::Raw },
        skip: if packed { offset } else { 0 },
        file,
        axes,
        samples,
        endian: header.endian,
        scaling: header.scaling.unwrap_or(Scaling::IDENTITY),
        spacing: header.spacing(),
    })
}

/// The first bytes of a header file, decompressed; fewer where it is shorter.
fn header_bytes(path: &Path) -> Result<Vec<u8>, VolumeError> {
    let mut bytes = Vec::new();
    let io = |source| VolumeError::Io { doing: "reading the header", source };
    if begins_with_gzip(path)? {
        let stream = GzDecoder::new(BufReader::new(decode::open(path)?));
        stream
            .take(SIZE_2 as u64)
            .read_to_end(&mut bytes)
            .map_err(|source| VolumeError::Decode { what: "the compressed header".into(), source: Box::new(source) })?;
    } else {
        decode::open(path)?.take(SIZE_2 as u64).read_to_end(&mut bytes).map_err(io)?;
    }
    Ok(bytes)
}

fn begins_with_gzip(path: &Path) -> Result<bool, VolumeError> {
    let mut start = Vec::new();
    let io = |source| VolumeError::Io { doing: "reading the header", source };
    let file: File = decode::open(path)?;
    file.take(GZIP.len() as u64).read_to_end(&mut start).map_err(io)?;
    Ok(start == GZIP)
}

/// The header's path: of an `.img` (or `.img.gz`) that of the `.hdr` beside it.
fn header_of(path: &Path) -> Result<PathBuf, VolumeError> {
    match partner(path, "img", "hdr") {
        Some(header) => existing(header),
        None => Ok(path.to_owned()),
    }
}

/// The image's path: of a `.hdr` (or `.hdr.gz`) that of the `.img` beside it.
fn image_of(header: &Path) -> Result<PathBuf, VolumeError> {
    let image = partner(header, "hdr", "img").ok_or_else(|| VolumeError::Malformed {
        found: "the header is the half of a pair but its name does not end in .hdr".into(),
        expected: "a pair is called NAME.hdr and NAME.img: name the two files so".into(),
    })?;
    let image = existing(image)?;
    // Held to the rule of names that stand in headers: no link may lead out of the folder.
    decode::beside(header, Path::new(image.file_name().unwrap_or_default()))
}

/// The names of the other half of a pair, plain and compressed; `None` where the path is not called as this half is.
fn partner(path: &Path, this: &str, other: &str) -> Option<[PathBuf; 2]> {
    let packed = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("gz"));
    let plain = if packed { path.with_extension("") } else { path.to_owned() };
    let ending = plain.extension().filter(|ending| ending.eq_ignore_ascii_case(this))?;
    let upper = ending.as_encoded_bytes().iter().all(u8::is_ascii_uppercase);
    let plain = plain.with_extension(if upper { other.to_ascii_uppercase() } else { other.to_owned() });
    let mut packed = plain.clone().into_os_string();
    packed.push(".gz");
    Some([plain, packed.into()])
}

/// The one of a half's possible names that is there.
fn existing([plain, packed]: [PathBuf; 2]) -> Result<PathBuf, VolumeError> {
    let name = plain.file_name().unwrap_or_default().to_string_lossy().escape_debug().to_string();
    [plain, packed].into_iter().find(|path| path.exists()).ok_or_else(|| VolumeError::Malformed {
        found: format!("there is no {name} beside the file"),
        expected: "this kind comes as a pair, NAME.hdr and NAME.img: bring the two together".into(),
    })
}
