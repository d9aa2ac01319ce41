//! NRRD, with the samples in the same file (`.nrrd`) or in another (`.nhdr`).
//!
//! Encodings raw, gzip, bzip2, ascii and hex; line and byte skips. The first axis of a NRRD is the fastest, so (X, Y, Z)
//! becomes (Z, Y, X). An axis of 3 or 4 samples whose kind is a colour or a vector is the colour axis; where no kinds are
//! given, the first of four axes is. Space directions are not applied, only their lengths are used, as the spacing. Data
//! in several files are refused.
//!
//! Format: <https://teem.sourceforge.net/nrrd/format.html>

use std::path::{Path, PathBuf};

use super::{Format, FormatInfo, Head, VolumeReader};
use crate::layout::{self, Axes, Axis, DataLayout, Encoding, HeaderLines, Start, dense};
use crate::text::excerpt;
use crate::{Endian, LengthUnit, ReadOptions, SampleType, VolumeError, VoxelSpacing};

pub(super) struct Nrrd;

static INFO: FormatInfo = FormatInfo::new(
    "nrrd",
    "NRRD",
    "A volume with its samples in the same file or in one beside it; raw, gzip, bzip2, ascii or hex.",
)
.extensions(&[".nrrd", ".nhdr"])
.detached(&[".nhdr"], &[".raw", ".bin", ".dat", ".txt", ".hex"])
.compressions(&["gzip", "bzip2"]);

impl Format for Nrrd {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    fn sniff(&self, head: &Head) -> bool {
        is_nrrd(head.bytes())
    }

    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        layout(path, options)?.open()
    }
}

fn is_nrrd(start: &[u8]) -> bool {
    start.starts_with(b"NRRD000")
}

/// The fields of a header that say where and how the samples lie, as written.
#[derive(Default)]
struct Fields {
    ty: Option<String>,
    sizes: Option<String>,
    encoding: Option<String>,
    endian: Option<String>,
    kinds: Option<String>,
    spacings: Option<String>,
    directions: Option<String>,
    space_units: Option<String>,
    units: Option<String>,
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
        if !is_nrrd(magic.as_bytes()) {
            let found = format!("the first line is \"{}\"", excerpt(&magic));
            return Err(VolumeError::malformed(found, "a NRRD begins with NRRD0001 to NRRD0005"));
        }
        let mut fields = Self::default();
        let mut attached = false;
        while let Some(line) = lines.next()? {
            if line.is_empty() {
                attached = true;
                break;
            }
            // `key:=value` lines hold what the writer likes, as comments do.
            if line.starts_with('#') || line.split_once(':').is_some_and(|(_, value)| value.starts_with('=')) {
                continue;
            }
            let (field, value) = line.split_once(':').ok_or_else(|| {
                let found = format!("the header has the line \"{}\"", excerpt(&line));
                VolumeError::malformed(found, "every line of it should be `field: value`")
            })?;
            fields.set(field.trim(), value.trim())?;
        }
        fields.length = lines.position;
        if !attached && fields.data_file.is_none() {
            return Err(VolumeError::malformed(
                "the header has no end and names no data file",
                "an empty line should come before the samples",
            ));
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
            "space units" => self.space_units = text(),
            "units" => self.units = text(),
            "data file" | "datafile" => self.data_file = text(),
            "line skip" | "lineskip" => self.line_skip = number("line skip", value)?,
            "byte skip" | "byteskip" => self.byte_skip = number("byte skip", value)?,
            _ => {}
        }
        Ok(())
    }
}

/// Where the samples of a NRRD lie.
fn layout(path: &Path, options: &ReadOptions) -> Result<DataLayout, VolumeError> {
    let fields = Fields::read(path)?;
    let samples = sample_type(required("type", &fields.ty)?)?;
    let encoding = encoding(required("encoding", &fields.encoding)?)?;
    let order = axis_order(&fields)?;
    let axes = Axes::new(&order.space, order.channel, options.max_voxels)?;
    let (file, first) = match &fields.data_file {
        Some(named) => (data_file(path, named)?, 0),
        None => (path.to_owned(), fields.length),
    };
    let start = if fields.line_skip > 0 { layout::after_lines(&file, first, fields.line_skip)? } else { first };
    let (start, skip) = match (fields.byte_skip, encoding) {
        (-1, Encoding::Raw) => (Start::FromEnd, 0),
        // Of compressed data, decompressed bytes are skipped.
        (bytes @ 0.., Encoding::Gzip | Encoding::Bzip2) => (Start::At(start), bytes.unsigned_abs()),
        (bytes @ 0.., _) => (Start::At(start.saturating_add_signed(bytes)), 0),
        (bytes, _) => {
            let found = format!("the byte skip is {bytes}");
            return Err(VolumeError::malformed(found, "it should be 0 or more, or -1 with raw encoding"));
        }
    };
    let endian = endian(&fields, samples, encoding)?;
    let spacing = spacing(&fields, &order);
    Ok(DataLayout { start, encoding, skip, spacing, ..DataLayout::raw(file, 0, axes, samples, endian) })
}

/// The axes of space in the order (Z, Y, X), the colour axis, and which of the header's axes that is.
struct Order {
    space: Vec<Axis>,
    channel: Option<Axis>,
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
    Ok(Order { space: axes, channel, colour })
}

/// The axis of 3 or 4 samples whose kind is a colour or a vector; of four axes without kinds, the first.
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
        return Err(VolumeError::SeveralDataFiles);
    }
    layout::beside(header, Path::new(named))
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
                what: format!("a NRRD of type \"{}\"", excerpt(text)),
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
                what: format!("a NRRD of encoding \"{}\"", excerpt(text)),
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
        other => {
            let found = other.map_or("the header gives no byte order".into(), |text| {
                format!("the byte order is \"{}\"", excerpt(text))
            });
            Err(VolumeError::malformed(
                found,
                format!("samples of type {samples} need `endian: little` or `endian: big`"),
            ))
        }
    }
}

/// The spacing along (Z, Y, X), if it is given for each of them.
fn spacing(fields: &Fields, order: &Order) -> Option<VoxelSpacing> {
    let per_axis: Vec<Option<f64>> = match (&fields.spacings, &fields.directions) {
        (Some(spacings), _) => spacings.split_whitespace().map(|number| number.parse().ok()).collect(),
        (None, Some(directions)) => directions_lengths(directions),
        (None, None) => return None,
    };
    let of_space =
        per_axis.iter().enumerate().filter(|(axis, _)| Some(*axis) != order.colour).map(|(_, length)| *length);
    let [x, y, z] = of_space.collect::<Option<Vec<f64>>>()?.try_into().ok()?;
    Some(VoxelSpacing::new([z, y, x])?.unit(unit(fields)))
}

/// The unit that all axes of space share.
fn unit(fields: &Fields) -> Option<LengthUnit> {
    let text = fields.space_units.as_ref().or(fields.units.as_ref())?;
    let mut units = text.split('"').skip(1).step_by(2).filter(|unit| !unit.is_empty()).map(LengthUnit::from_name);
    let first = units.next()??;
    units.all(|unit| unit == Some(first)).then_some(first)
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
    value.as_deref().ok_or_else(|| {
        let found = format!("the header has no field `{field}`");
        VolumeError::malformed(found, "a NRRD needs type, sizes and encoding")
    })
}

fn number<T: std::str::FromStr>(field: &str, value: &str) -> Result<T, VolumeError> {
    value.parse().map_err(|_| {
        let found = format!("the field `{field}` holds \"{}\"", excerpt(value));
        VolumeError::malformed(found, "it should hold whole numbers")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Volume;
    use crate::testing::{Folder, encode, gzip, read as read_file, samples, volume};

    const PLAIN: &str = "NRRD0004\n# a remark\nkey:=value: and more\ndimension: 3\nsizes: 5 4 3\n";

    fn nrrd(fields: &str, data: &[u8]) -> Vec<u8> {
        [PLAIN.as_bytes(), fields.as_bytes(), b"\n", data].concat()
    }

    fn u8s() -> Vec<u8> {
        encode(&samples(), SampleType::U8, Endian::Little)
    }

    #[test]
    fn every_type_and_byte_order() {
        let folder = Folder::new();
        for (names, ty) in [
            (&["uchar", "unsigned char", "uint8", "uint8_t"][..], SampleType::U8),
            (&["short", "signed short int", "int16_t"], SampleType::I16),
            (&["ushort", "unsigned short int", "uint16"], SampleType::U16),
            (&["int", "signed int", "int32"], SampleType::I32),
            (&["uint", "unsigned int", "uint32_t"], SampleType::U32),
            (&["longlong", "signed long long int", "int64"], SampleType::I64),
            (&["ulonglong", "unsigned long long", "uint64_t"], SampleType::U64),
            (&["float"], SampleType::F32),
            (&["double", "Double"], SampleType::F64),
        ] {
            for (name, (order, endian)) in names
                .iter()
                .flat_map(|name| [("little", Endian::Little), ("big", Endian::Big)].map(|order| (name, order)))
            {
                let bytes =
                    nrrd(&format!("type: {name}\nencoding: raw\nendian: {order}\n"), &encode(&samples(), ty, endian));
                let (found, source) = folder.read("a.nrrd", bytes).unwrap();
                assert_eq!((found, source.samples, source.format), (volume(), ty, "nrrd"), "{name} {order}");
            }
        }
    }

    #[cfg_attr(not(all(feature = "bzip2", feature = "gzip")), ignore = "needs bzip2 and gzip")]
    #[test]
    fn every_encoding() {
        let folder = Folder::new();
        let raw = encode(&samples(), SampleType::I16, Endian::Big);
        let mut packer = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
        std::io::Write::write_all(&mut packer, &raw).unwrap();
        let text: String = samples().iter().map(|v| format!("{v}\n")).collect();
        let hex: String = raw.iter().map(|byte| format!("{byte:02x}")).collect();
        for (names, data) in [
            (["raw", "RAW"], raw.clone()),
            (["gzip", "gz"], gzip(&raw)),
            (["bzip2", "bz2"], packer.finish().unwrap()),
            (["ascii", "text"], text.into_bytes()),
            (["hex", "hex"], hex.into_bytes()),
        ] {
            for name in names {
                let bytes = nrrd(&format!("type: short\nendian: big\nencoding: {name}\n"), &data);
                assert_eq!(folder.read("a.nrrd", bytes).unwrap().0, volume(), "{name}");
            }
        }
    }

    #[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
    #[test]
    fn bytes_and_lines_are_skipped() {
        let folder = Folder::new();
        let cases = [
            ("encoding: raw\nline skip: 2\n", [&b"one\ntwo\n"[..], &u8s()].concat()),
            ("encoding: raw\nbyte skip: 3\n", [&b"abc"[..], &u8s(), b"more"].concat()),
            ("encoding: raw\nlineskip: 1\nbyteskip: 3\n", [&b"one\nabc"[..], &u8s()].concat()),
            ("encoding: raw\nbyte skip: -1\n", [&b"whatever"[..], &u8s()].concat()),
            (
                "encoding: gzip\nline skip: 1\nbyte skip: 3\n",
                [&b"one\n"[..], &gzip(&[&b"abc"[..], &u8s()].concat())].concat(),
            ),
        ];
        for (fields, data) in cases {
            let fields = format!("type: uchar\n{fields}");
            assert_eq!(folder.read("a.nrrd", nrrd(&fields, &data)).unwrap().0, volume(), "{fields}");
            // The same in a file of its own.
            folder.write("data.bin", &data);
            let detached = format!("{PLAIN}{fields}data file: data.bin\n");
            assert_eq!(folder.read("a.nhdr", detached).unwrap().0, volume(), "{fields} detached");
        }
        let bad = nrrd("type: uchar\nencoding: gzip\nbyte skip: -1\n", &gzip(&u8s()));
        assert!(matches!(folder.read("a.nrrd", bad), Err(VolumeError::Malformed { .. })));
        let beyond = nrrd(&format!("type: uchar\nencoding: raw\nbyte skip: {}\n", i64::MAX), &u8s());
        assert!(matches!(folder.read("a.nrrd", beyond), Err(VolumeError::Truncated { found: 0, .. })));
    }

    #[test]
    fn colours_are_first_or_last_by_their_kind() {
        let folder = Folder::new();
        let interleaved: Vec<u8> = u8s().iter().flat_map(|&v| [v, 255 - v, 7]).collect();
        let planar: Vec<u8> =
            (0..3).flat_map(|c| interleaved.iter().skip(c).step_by(3).copied().collect::<Vec<_>>()).collect();
        let expected = Volume::new([3, 4, 5], 3, interleaved.clone()).unwrap();
        let read = |fields: &str, data: &[u8]| {
            folder.read("a.nrrd", [b"NRRD0005\ntype: uchar\nencoding: raw\n", fields.as_bytes(), b"\n", data].concat())
        };
        for (fields, data) in [
            ("sizes: 3 5 4 3\nkinds: RGB-color domain domain domain\n", &interleaved),
            ("sizes: 3 5 4 3\nkinds: vector space space space\n", &interleaved),
            ("sizes: 3 5 4 3\n", &interleaved),
            ("sizes: 5 4 3 3\nkinds: domain domain domain RGB-color\n", &planar),
        ] {
            assert_eq!(read(fields, data).unwrap().0, expected, "{fields}");
        }
        for fields in [
            "sizes: 3 5 4 3\nkinds: time domain domain domain\n",
            "sizes: 2 5 4 3\nkinds: vector domain domain domain\n",
        ] {
            assert!(matches!(read(fields, &interleaved), Err(VolumeError::Dimensions { .. })), "{fields}");
        }
    }

    #[test]
    fn spacing_comes_from_either_field() {
        let folder = Folder::new();
        for (field, expected) in [
            ("spacings: 0.5 0.75 2\n", Some(None)),
            ("space directions: (0.5,0,0) (0, 0.75, 0) (0,1.2,1.6)\n", Some(None)),
            ("spacings: 0.5 0.75 2\nunits: \"mm\" \"mm\" \"mm\"\n", Some(Some(LengthUnit::Millimeter))),
            ("spacings: 0.5 0.75 2\nspace units: \"um\" \"um\" \"um\"\n", Some(Some(LengthUnit::Micrometer))),
            ("spacings: 0.5 0.75 2\nspace units: \"um\" \"mm\" \"um\"\n", Some(None)),
            ("spacings: 0.5 nan 2\n", None),
            ("spacings: 1 2\n", None),
            ("space directions: (1,0,0 none (\n", None),
            ("", None),
        ] {
            let bytes = nrrd(&format!("type: uchar\nencoding: raw\n{field}"), &u8s());
            let expected = expected.and_then(|unit| Some(VoxelSpacing::new([2.0, 0.75, 0.5])?.unit(unit)));
            assert_eq!(folder.read("a.nrrd", bytes).unwrap().1.spacing, expected, "{field}");
        }
    }

    #[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
    #[test]
    fn headers_that_are_wrong_are_refused() {
        let folder = Folder::new();
        let refused = |bytes: Vec<u8>| folder.read("a.nrrd", bytes).unwrap_err();
        for fields in [
            "encoding: raw\n",
            "type: uchar\n",
            "type: short\nencoding: raw\n",
            "type: short\nencoding: raw\nendian: middle\n",
            "type: uchar\nencoding: raw\nline skip: -2\n",
            "type: uchar\nencoding: raw\nbyte skip: -2\n",
            "type: uchar\nencoding: raw\nsizes: 5 4 x\n",
            "type: uchar\nencoding: raw\nline skip: 99\n",
            "no field\n",
        ] {
            assert!(matches!(refused(nrrd(fields, &u8s())), VolumeError::Malformed { .. }), "{fields}");
        }
        for fields in ["type: block\nencoding: raw\n", "type: uchar\nencoding: zrl\n"] {
            assert!(matches!(refused(nrrd(fields, &u8s())), VolumeError::Unsupported { .. }), "{fields}");
        }
        for fields in [
            "type: uchar\nencoding: raw\ndata file: LIST\n",
            "type: uchar\nencoding: raw\ndata file: slice%03d.raw 1 3 1\n",
        ] {
            assert!(matches!(refused(nrrd(fields, &u8s())), VolumeError::SeveralDataFiles), "{fields}");
        }
        let endless = [PLAIN, "type: uchar\nencoding: raw\n"].concat();
        assert!(matches!(refused(endless.into_bytes()), VolumeError::Malformed { .. }));
        let large = nrrd("type: uchar\nencoding: gzip\nsizes: 99999 99999 99999\n", &gzip(&[0; 9]));
        assert!(matches!(refused(large), VolumeError::TooLarge { .. }));
        let lying = nrrd("type: double\nencoding: gzip\nendian: big\nsizes: 500 500 500\n", &gzip(&[0; 9]));
        assert!(matches!(refused(lying), VolumeError::Truncated { expected: 1_000_000_000, found: 9 }));
        let lying = nrrd("type: double\nencoding: gzip\nendian: big\nsizes: 1500 1500 1500\n", &gzip(&[0; 9]));
        assert!(matches!(refused(lying), VolumeError::Inflated { bytes: 27_000_000_000, .. }));
    }

    #[test]
    fn detached_data_stay_in_the_folder() {
        let folder = Folder::new();
        let away = folder.write("away.raw", u8s());
        let inner = folder.path().join("inner");
        std::fs::create_dir(&inner).unwrap();
        for named in ["../away.raw", away.to_str().unwrap()] {
            let text = format!("{PLAIN}type: uchar\nencoding: raw\ndata file: {named}\n");
            let error = read_file(&folder.write("inner/a.nhdr", text)).unwrap_err();
            assert!(matches!(error, VolumeError::OutsideFolder { .. }), "{error}");
        }
    }
}
