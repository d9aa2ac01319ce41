//! NRRD, attached (`.nrrd`) or detached (`.nhdr` with its data file beside it).
//!
//! Encodings raw, gzip, bzip2, ascii and hex; line and byte skips. The first axis of a NRRD is the fastest, so (X, Y, Z)
//! comes out as (Z, Y, X). An axis of 3 or 4 samples that its kind calls a colour or a vector is the colour axis, first or
//! last; where no kinds are given, the first of four axes is. Space directions are not applied, only their lengths are
//! taken as the spacing. Data in several files are refused.

use std::path::{Path, PathBuf};

use super::decode::{self, HeaderLines};
use super::extent::{Axes, Axis, Encoding, Extent, Start, dense};
use super::levels::Scaling;
use super::{Endian, FileKind, ReadOptions, SampleType, Source, Volume, VolumeError};

/// Whether a file begins as a NRRD does.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.starts_with(b"NRRD000")
}

/// The volume in a NRRD.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    extent(path, options)?.read(options)
}

/// The fields of a header that say where and how the samples lie, as they are written.
#[derive(Default)]
struct Fields {
    ty: Option<String>,
    sizes: Option<String>,
    encoding: Option<String>,
    endian: Option<String>,
    kinds: Option<String>,
    spacings: Option<String>,
    directions: Option<String>,
    data_file: Option<String>,
    line_skip: u64,
    byte_skip: i64,
    /// Bytes of the header.
    length: u64,
}

impl Fields {
    fn read(path: &Path) -> Result<Self, VolumeError> {
        let mut lines = HeaderLines::open(path)?;
        let magic = lines.next()?.unwrap_or_default();
        if !sniff(magic.as_bytes()) {
            return Err(VolumeError::Malformed {
                found: format!("the first line is \"{}\"", shown(&magic)),
                expected: "a NRRD begins with NRRD0001 to NRRD0005".into(),
            });
        }
        let mut fields = Self::default();
        let mut attached = false;
        while let Some(line) = lines.next()? {
            if line.is_empty() {
                attached = true;
                break;
            }
            // `key:=value` lines are free-form remarks, as are comments.
            if line.starts_with('#') || line.split_once(':').is_some_and(|(_, value)| value.starts_with('=')) {
                continue;
            }
            let (field, value) = line.split_once(':').ok_or_else(|| VolumeError::Malformed {
                found: format!("the header has the line \"{}\"", shown(&line)),
                expected: "every line of it should be `field: value`".into(),
            })?;
            fields.set(field.trim(), value.trim())?;
        }
        fields.length = lines.position;
        if !attached && fields.data_file.is_none() {
            return Err(VolumeError::Malformed {
                found: "the header has no end and names no data file".into(),
                expected: "an empty line should come before the samples: the file is truncated or damaged".into(),
            });
        }
        Ok(fields)
    }

    fn set(&mut self, field: &str, value: &str) -> Result<(), VolumeError> {
        let text = || Some(value.to_owned());
        match field.to_ascii_lowercase().as_str() {
            "type" => self.ty = text(),
            "sizes" => self.sizes = text(),
            "encoding" => self.encoding = text(),
            "endian" => self.endian = text(),
            "kinds" => self.kinds = text(),
            "spacings" => self.spacings = text(),
            "space directions" => self.directions = text(),
            "data file" | "datafile" => self.data_file = text(),
            "line skip" | "lineskip" => self.line_skip = number("line skip", value)?,
            "byte skip" | "byteskip" => self.byte_skip = number("byte skip", value)?,
            _ => {}
        }
        Ok(())
    }
}

/// Where the samples of a NRRD lie.
fn extent(path: &Path, options: &ReadOptions) -> Result<Extent, VolumeError> {
    let fields = Fields::read(path)?;
    let samples = sample_type(required("type", &fields.ty)?)?;
    let encoding = encoding(required("encoding", &fields.encoding)?)?;
    let order = axis_order(&fields)?;
    let axes = Axes::new(&order.logical, options.max_voxels)?;
    let (file, first) = match &fields.data_file {
        Some(named) => (data_file(path, named)?, 0),
        None => (path.to_owned(), fields.length),
    };
    let start = if fields.line_skip > 0 { decode::after_lines(&file, first, fields.line_skip)? } else { first };
    let (start, skip) = match (fields.byte_skip, encoding) {
        (-1, Encoding::Raw) => (Start::FromEnd, 0),
        // Of compressed data the bytes are skipped that come out, not those that go in.
        (bytes @ 0.., Encoding::Gzip | Encoding::Bzip2) => (Start::At(start), bytes.unsigned_abs()),
        (bytes @ 0.., _) => (Start::At(start.saturating_add_signed(bytes)), 0),
        (bytes, _) => {
            return Err(VolumeError::Malformed {
                found: format!("the byte skip is {bytes}"),
                expected: "it should be 0 or more, or -1 with raw encoding".into(),
            });
        }
    };
    Ok(Extent {
        kind: FileKind::Nrrd,
        file,
        start,
        encoding,
        skip,
        axes,
        samples,
        endian: endian(&fields, samples, encoding)?,
        scaling: Scaling::IDENTITY,
        spacing: spacing(&fields, &order),
    })
}

/// The axes in the order (Z, Y, X, colour), and which of the header's axes are not the colour.
struct Order {
    logical: Vec<Axis>,
    colour: Option<usize>,
}

fn axis_order(fields: &Fields) -> Result<Order, VolumeError> {
    let sizes = required("sizes", &fields.sizes)?;
    let sizes: Vec<u64> = sizes.split_whitespace().map(|size| number("sizes", size)).collect::<Result<_, _>>()?;
    if sizes.len() > 16 {
        return Err(VolumeError::Dimensions { found: sizes });
    }
    let colour = colour_axis(&sizes, fields.kinds.as_deref());
    let mut axes = dense(sizes.iter().copied());
    let channel = colour.map(|axis| axes.remove(axis));
    axes.reverse();
    axes.extend(channel);
    Ok(Order { logical: axes, colour })
}

/// The axis of 3 or 4 samples that is called a colour or a vector; of four axes without kinds, the first.
fn colour_axis(sizes: &[u64], kinds: Option<&str>) -> Option<usize> {
    const COLOURS: [&str; 8] =
        ["rgb-color", "rgba-color", "3-color", "4-color", "vector", "3-vector", "4-vector", "list"];
    let fits = |axis: usize| sizes.len() == 4 && sizes.get(axis).is_some_and(|size| matches!(size, 3 | 4));
    match kinds {
        None => fits(0).then_some(0),
        Some(kinds) => {
            let called = |kind: &str| COLOURS.contains(&kind.to_ascii_lowercase().as_str());
            kinds.split_whitespace().position(called).filter(|&axis| fits(axis))
        }
    }
}

fn data_file(header: &Path, named: &str) -> Result<PathBuf, VolumeError> {
    let list = named == "LIST" || named.starts_with("LIST ");
    let pattern = named.contains('%') && named.split_whitespace().count() >= 4;
    if list || pattern {
        return Err(VolumeError::Unsupported {
            what: "a NRRD whose data lie in several files".into(),
            supported: "one data file: join them, e.g. with `unu save`".into(),
        });
    }
    decode::beside(header, Path::new(named))
}

fn sample_type(text: &str) -> Result<SampleType, VolumeError> {
    Ok(match text.to_ascii_lowercase().as_str() {
        "signed char" | "int8" | "int8_t" => SampleType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => SampleType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => SampleType::U16,
        "int" | "signed int" | "int32" | "int32_t" => SampleType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleType::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => SampleType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => SampleType::U64,
        "float" => SampleType::F32,
        "double" => SampleType::F64,
        _ => {
            return Err(VolumeError::Unsupported {
                what: format!("a NRRD of type \"{}\"", shown(text)),
                supported: "signed and unsigned integers of 8 to 64 bits, float and double".into(),
            });
        }
    })
}

fn encoding(text: &str) -> Result<Encoding, VolumeError> {
    Ok(match text.to_ascii_lowercase().as_str() {
        "raw" => Encoding::Raw,
        "gz" | "gzip" => Encoding::Gzip,
        "bz2" | "bzip2" => Encoding::Bzip2,
        "txt" | "text" | "ascii" => Encoding::Text,
        "hex" => Encoding::Hex,
        _ => {
            return Err(VolumeError::Unsupported {
                what: format!("a NRRD of encoding \"{}\"", shown(text)),
                supported: "raw, gzip, bzip2, ascii and hex".into(),
            });
        }
    })
}

fn endian(fields: &Fields, samples: SampleType, encoding: Encoding) -> Result<Endian, VolumeError> {
    match fields.endian.as_deref().map(str::to_ascii_lowercase).as_deref() {
        Some("little") => Ok(Endian::Little),
        Some("big") => Ok(Endian::Big),
        None if samples.size() == 1 || encoding == Encoding::Text => Ok(Endian::Little),
        other => Err(VolumeError::Malformed {
            found: other.map_or("the header gives no byte order".into(), |text| {
                format!("the byte order is \"{}\"", shown(text))
            }),
            expected: format!("samples of type {samples} need `endian: little` or `endian: big`"),
        }),
    }
}

/// The spacing along (Z, Y, X) where it is given for each of them.
fn spacing(fields: &Fields, order: &Order) -> Option<[f64; 3]> {
    let per_axis: Vec<Option<f64>> = match (&fields.spacings, &fields.directions) {
        (Some(spacings), _) => spacings.split_whitespace().map(|number| number.parse().ok()).collect(),
        (None, Some(directions)) => directions_lengths(directions),
        (None, None) => return None,
    };
    let of_space =
        per_axis.iter().enumerate().filter(|(axis, _)| Some(*axis) != order.colour).map(|(_, length)| *length);
    let [x, y, z] = of_space.collect::<Option<Vec<f64>>>()?.try_into().ok()?;
    [x, y, z].iter().all(|step| step.is_finite() && *step > 0.0).then_some([z, y, x])
}

/// The lengths of vectors such as `none (0.5,0,0) (0,0.5,0) (0,0,2)`.
fn directions_lengths(text: &str) -> Vec<Option<f64>> {
    let length = |vector: &str| {
        let parts = vector.split(',').map(|part| part.trim().parse::<f64>().ok());
        Some(parts.collect::<Option<Vec<f64>>>()?.iter().map(|part| part * part).sum::<f64>().sqrt())
    };
    let mut lengths = Vec::new();
    let mut rest = text.trim();
    while !rest.is_empty() {
        let (item, after) = match rest.strip_prefix('(') {
            Some(inside) => inside.split_once(')').unwrap_or((inside, "")),
            None => rest.split_once(char::is_whitespace).unwrap_or((rest, "")),
        };
        lengths.push(length(item));
        rest = after.trim();
    }
    lengths
}

fn required<'a>(field: &str, value: &'a Option<String>) -> Result<&'a str, VolumeError> {
    value.as_deref().ok_or_else(|| VolumeError::Malformed {
        found: format!("the header has no field `{field}`"),
        expected: "a NRRD needs type, sizes and encoding".into(),
    })
}

fn number<T: std::str::FromStr>(field: &str, value: &str) -> Result<T, VolumeError> {
    value.parse().map_err(|_| VolumeError::Malformed {
        found: format!("the field `{field}` holds \"{}\"", shown(value)),
        expected: "whole numbers belong there".into(),
    })
}

/// A text of the header as an error shows it.
fn shown(text: &str) -> String {
    text.chars().take(80).collect::<String>().escape_debug().to_string()
}
