//! MetaImage, in one file (`.mha`) or with its data file beside it (`.mhd`).
//!
//! Binary, zlib-compressed and ascii data. The first axis is the fastest, so (X, Y, Z) comes out as (Z, Y, X); three or
//! four channels are interleaved colours. Orientation and origin are not applied. Data in several files are refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::decode::{self, HeaderLines};
use super::extent::{Axes, Encoding, Extent, Start, dense};
use super::levels::Scaling;
use super::{Endian, FileKind, ReadOptions, SampleType, Source, Volume, VolumeError};

/// The field that ends a header.
const LAST: &str = "elementdatafile";

/// Whether a file begins as a MetaImage does: with lines `Key = value`, among them one of two that none lacks.
pub(super) fn sniff(head: &[u8]) -> bool {
    const LINES: usize = 16;
    let known = |line: &[u8]| {
        let key = line.split(|&byte| byte == b'=').next().unwrap_or_default().trim_ascii();
        key.eq_ignore_ascii_case(b"ObjectType") || key.eq_ignore_ascii_case(b"NDims")
    };
    let lines = head.split(|&byte| byte == b'\n').take(LINES);
    lines.take_while(|line| line.contains(&b'=') && line.is_ascii()).any(known)
}

/// The volume in a MetaImage.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    extent(path, options)?.read(options)
}

/// The fields of a header by lower-case key, and where it ends.
struct Fields {
    values: BTreeMap<String, String>,
    length: u64,
}

impl Fields {
    fn read(path: &Path) -> Result<Self, VolumeError> {
        let mut lines = HeaderLines::open(path)?;
        let mut values = BTreeMap::new();
        while let Some(line) = lines.next()? {
            if line.is_empty() {
                continue;
            }
            let (key, value) = line.split_once('=').ok_or_else(|| VolumeError::Malformed {
                found: format!("the header has the line \"{}\"", shown(&line)),
                expected: "every line of it should be `Key = value`".into(),
            })?;
            let key = key.trim().to_ascii_lowercase();
            let last = key == LAST;
            values.insert(key, value.trim().to_owned());
            if last {
                return Ok(Self { values, length: lines.position });
            }
        }
        Err(VolumeError::Malformed {
            found: "the header has no field `ElementDataFile`".into(),
            expected: "it should end with one: the file is truncated or damaged".into(),
        })
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.values.get(&key.to_ascii_lowercase()).map(String::as_str)
    }

    fn required(&self, key: &str) -> Result<&str, VolumeError> {
        self.get(key).ok_or_else(|| VolumeError::Malformed {
            found: format!("the header has no field `{key}`"),
            expected: "a MetaImage needs NDims, DimSize, ElementType and ElementDataFile".into(),
        })
    }

    fn number<T: std::str::FromStr>(&self, key: &str) -> Result<Option<T>, VolumeError> {
        let number = |value: &str| value.parse().map_err(|_| malformed(key, value, "a whole number"));
        self.get(key).map(number).transpose()
    }

    fn truth(&self, key: &str) -> Result<Option<bool>, VolumeError> {
        let truth = |value: &str| match value.to_ascii_lowercase().as_str() {
            "true" | "t" | "1" => Ok(true),
            "false" | "f" | "0" => Ok(false),
            _ => Err(malformed(key, value, "True or False")),
        };
        self.get(key).map(truth).transpose()
    }
}

/// Where the samples of a MetaImage lie.
pub(super) fn extent(path: &Path, options: &ReadOptions) -> Result<Extent, VolumeError> {
    let fields = Fields::read(path)?;
    let samples = sample_type(fields.required("ElementType")?)?;
    let axes = axes(&fields, options)?;
    let (file, first) = data_file(path, &fields)?;
    let encoding = encoding(&fields)?;
    let start = match fields.number::<i64>("HeaderSize")?.unwrap_or(0) {
        0 => Start::At(first),
        -1 if encoding == Encoding::Raw => Start::FromEnd,
        // Counted from the start of the file that holds the samples, even where that is the header's own.
        bytes @ 1.. => Start::At(bytes.unsigned_abs()),
        bytes => {
            let expected = "0 or more, or -1 with uncompressed data";
            return Err(malformed("HeaderSize", &bytes.to_string(), expected));
        }
    };
    let msb = match fields.truth("BinaryDataByteOrderMSB")? {
        Some(msb) => msb,
        None => fields.truth("ElementByteOrderMSB")?.unwrap_or(false),
    };
    Ok(Extent {
        kind: FileKind::MetaImage,
        file,
        start,
        encoding,
        skip: 0,
        axes,
        samples,
        endian: if msb { Endian::Big } else { Endian::Little },
        scaling: Scaling::IDENTITY,
        spacing: spacing(&fields),
    })
}

fn axes(fields: &Fields, options: &ReadOptions) -> Result<Axes, VolumeError> {
    let text = fields.required("DimSize")?;
    let bad = || malformed("DimSize", text, "one whole number for each of `NDims` axes");
    let sizes = text.split_whitespace().map(|size| size.parse().map_err(|_| bad()));
    let sizes = sizes.collect::<Result<Vec<u64>, _>>()?;
    let count: usize = fields.number("NDims")?.unwrap_or(sizes.len());
    if count != sizes.len() || count > 16 {
        return Err(bad());
    }
    // The channels lie beside one another within a voxel: the fastest axis of all.
    let channels: u64 = fields.number("ElementNumberOfChannels")?.unwrap_or(1);
    if !matches!(channels, 1 | 3 | 4) {
        return Err(VolumeError::Unsupported {
            what: format!("a MetaImage of {channels} channels"),
            supported: "1 channel (grey), 3 (RGB) or 4 (RGB and alpha)".into(),
        });
    }
    let mut space = dense(sizes);
    space.reverse();
    Ok(Axes::new(&space, None, options.max_voxels)?.interleaved(channels as usize))
}

/// The file that holds the samples, and where in it they begin by default.
fn data_file(header: &Path, fields: &Fields) -> Result<(PathBuf, u64), VolumeError> {
    let named = fields.required("ElementDataFile")?;
    if named.eq_ignore_ascii_case("LOCAL") {
        return Ok((header.to_owned(), fields.length));
    }
    let list = named == "LIST" || named.starts_with("LIST ");
    let pattern = named.contains('%') && named.split_whitespace().count() >= 3;
    if list || pattern {
        return Err(VolumeError::Unsupported {
            what: "a MetaImage whose data lie in several files".into(),
            supported: "one data file: write the volume again as .mha".into(),
        });
    }
    Ok((decode::beside(header, Path::new(named))?, 0))
}

fn encoding(fields: &Fields) -> Result<Encoding, VolumeError> {
    let binary = fields.truth("BinaryData")?.unwrap_or(true);
    let compressed = fields.truth("CompressedData")?.unwrap_or(false);
    match (binary, compressed) {
        (true, false) => Ok(Encoding::Raw),
        (true, true) => Ok(Encoding::Zlib),
        (false, false) => Ok(Encoding::Text),
        (false, true) => Err(VolumeError::Unsupported {
            what: "a MetaImage of compressed text".into(),
            supported: "binary, compressed binary and ascii data".into(),
        }),
    }
}

fn sample_type(text: &str) -> Result<SampleType, VolumeError> {
    Ok(match text.to_ascii_uppercase().as_str() {
        "MET_CHAR" => SampleType::I8,
        "MET_UCHAR" => SampleType::U8,
        "MET_SHORT" => SampleType::I16,
        "MET_USHORT" => SampleType::U16,
        // MetaImage's `long` has 4 bytes on every machine.
        "MET_INT" | "MET_LONG" => SampleType::I32,
        "MET_UINT" | "MET_ULONG" => SampleType::U32,
        "MET_LONG_LONG" => SampleType::I64,
        "MET_ULONG_LONG" => SampleType::U64,
        "MET_FLOAT" => SampleType::F32,
        "MET_DOUBLE" => SampleType::F64,
        _ => {
            return Err(VolumeError::Unsupported {
                what: format!("a MetaImage of type \"{}\"", shown(text)),
                supported: "MET_CHAR, MET_SHORT, MET_INT, MET_LONG, MET_LONG_LONG, their unsigned forms, MET_FLOAT and MET_DOUBLE".into(),
            });
        }
    })
}

/// The spacing along (Z, Y, X): of the voxels, or else their size.
fn spacing(fields: &Fields) -> Option<[f64; 3]> {
    let text = fields.get("ElementSpacing").or_else(|| fields.get("ElementSize"))?;
    let steps = text.split_whitespace().map(|step| step.parse().ok()).collect::<Option<Vec<f64>>>()?;
    let [x, y, z] = *steps.first_chunk::<3>()?;
    [x, y, z].iter().all(|step| step.is_finite() && *step > 0.0).then_some([z, y, x])
}

fn malformed(key: &str, value: &str, expected: &str) -> VolumeError {
    VolumeError::Malformed {
        found: format!("the field `{key}` holds \"{}\"", shown(value)),
        expected: format!("{expected} belongs there"),
    }
}

/// A text of the header as an error shows it.
fn shown(text: &str) -> String {
    text.chars().take(80).collect::<String>().escape_debug().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Volume;
    use crate::testing::{Folder, encode, gzip, read as read_file, samples, volume};

    const START: &str = "ObjectType = Image\nNDims = 3\nDimSize = 5 4 3\n";

    fn local(fields: &str, data: &[u8]) -> Vec<u8> {
        [START.as_bytes(), fields.as_bytes(), b"ElementDataFile = LOCAL\n", data].concat()
    }

    fn u8s() -> Vec<u8> {
        encode(&samples(), SampleType::U8, Endian::Little)
    }

    fn zlib(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut encoder, bytes).unwrap();
        encoder.finish().unwrap()
    }

    #[test]
    fn every_type_and_byte_order() {
        let folder = Folder::new();
        for (name, ty) in [
            ("MET_UCHAR", SampleType::U8),
            ("MET_SHORT", SampleType::I16),
            ("MET_USHORT", SampleType::U16),
            ("MET_INT", SampleType::I32),
            ("MET_UINT", SampleType::U32),
            ("MET_LONG", SampleType::I32),
            ("MET_ULONG", SampleType::U32),
            ("MET_LONG_LONG", SampleType::I64),
            ("MET_ULONG_LONG", SampleType::U64),
            ("MET_FLOAT", SampleType::F32),
            ("met_double", SampleType::F64),
        ] {
            for (key, value, endian) in [
                ("BinaryDataByteOrderMSB", "True", Endian::Big),
                ("BinaryDataByteOrderMSB", "False", Endian::Little),
                ("ElementByteOrderMSB", "true", Endian::Big),
                ("Comment", "none", Endian::Little),
            ] {
                let bytes = local(&format!("{key} = {value}\nElementType = {name}\n"), &encode(&samples(), ty, endian));
                let (found, source) = folder.read("a.mha", bytes).unwrap();
                assert_eq!((found, source.samples, source.kind), (volume(), ty, FileKind::MetaImage), "{name} {key}");
            }
        }
    }

    #[test]
    fn every_encoding_in_one_file_or_two() {
        let folder = Folder::new();
        let text: String = samples().iter().map(|v| format!("{v} ")).collect();
        for (fields, data) in [
            ("BinaryData = True\n", u8s()),
            ("CompressedData = True\nCompressedDataSize = 1\n", zlib(&u8s())),
            ("BinaryData = False\n", text.into_bytes()),
            ("HeaderSize = -1\n", [b"anything", &u8s()[..]].concat()),
        ] {
            let fields = format!("ElementType = MET_UCHAR\n{fields}");
            assert_eq!(folder.read("a.mha", local(&fields, &data)).unwrap().0, volume(), "{fields}");
            folder.write("a b.zraw", &data);
            let detached = format!("{START}{fields}ElementDataFile = a b.zraw\n");
            assert_eq!(folder.read("a.mhd", detached).unwrap().0, volume(), "{fields} detached");
        }
        // Counted from the start of the file, its header included.
        let mut bytes = local("ElementType = MET_UCHAR\nHeaderSize = 300\n", &[]);
        bytes.resize(300, b'.');
        bytes.extend(u8s());
        assert_eq!(folder.read("a.mha", bytes).unwrap().0, volume());
    }

    #[test]
    fn channels_are_interleaved() {
        let rgba: Vec<u8> = u8s().iter().flat_map(|&v| [v, 255 - v, 7, 99]).collect();
        let rgb: Vec<u8> = u8s().iter().flat_map(|&v| [v, 255 - v, 7]).collect();
        for (channels, data) in [(3, &rgb), (4, &rgba)] {
            let fields = format!("ElementType = MET_UCHAR\nElementNumberOfChannels = {channels}\n");
            let found = Folder::new().read("a.mha", local(&fields, data)).unwrap().0;
            assert_eq!(found, Volume::new([3, 4, 5], 3, rgb.clone()).unwrap());
        }
    }

    #[test]
    fn spacing_or_else_size() {
        let folder = Folder::new();
        for (fields, expected) in [
            ("ElementSize = 9 9 9\nElementSpacing = 0.5 0.75 2\n", Some([2.0, 0.75, 0.5])),
            ("ElementSize = 0.5 0.75 2\n", Some([2.0, 0.75, 0.5])),
            ("ElementSpacing = 0 1 1\n", None),
            ("", None),
        ] {
            let bytes = local(&format!("ElementType = MET_UCHAR\n{fields}"), &u8s());
            assert_eq!(folder.read("a.mha", bytes).unwrap().1.spacing, expected);
        }
    }

    #[test]
    fn what_is_no_volume_is_refused() {
        let folder = Folder::new();
        let refused = |bytes: Vec<u8>| folder.read("a.mha", bytes).unwrap_err();
        for fields in [
            "",
            "ElementType = MET_UCHAR\nDimSize = 5 4\n",
            "ElementType = MET_UCHAR\nDimSize = 5 4 x\n",
            "ElementType = MET_UCHAR\nNDims = -1\n",
            "ElementType = MET_UCHAR\nBinaryData = maybe\n",
            "ElementType = MET_UCHAR\nHeaderSize = -2\n",
            "ElementType = MET_UCHAR\nHeaderSize = -1\nCompressedData = True\n",
            "ElementType = MET_UCHAR\nno field\n",
        ] {
            assert!(matches!(refused(local(fields, &u8s())), VolumeError::Malformed { .. }), "{fields}");
        }
        for fields in [
            "ElementType = MET_STRING\n",
            "ElementType = MET_UCHAR\nElementNumberOfChannels = 2\n",
            "ElementType = MET_UCHAR\nBinaryData = False\nCompressedData = True\n",
            "ElementType = MET_UCHAR\nElementDataFile = LIST\n",
            "ElementType = MET_UCHAR\nElementDataFile = s%03d.raw 1 3 1\n",
        ] {
            assert!(matches!(refused(local(fields, &u8s())), VolumeError::Unsupported { .. }), "{fields}");
        }
        let flat = local("NDims = 2\nDimSize = 12 5\nElementType = MET_UCHAR\n", &u8s());
        assert!(matches!(refused(flat), VolumeError::Dimensions { .. }));
        let series = local("NDims = 4\nDimSize = 5 4 3 3\nElementType = MET_UCHAR\n", &u8s());
        assert!(matches!(refused(series), VolumeError::Dimensions { .. }));
        assert!(matches!(refused(START.into()), VolumeError::Malformed { .. }));
        let large = local("DimSize = 99999 99999 99999\nElementType = MET_UCHAR\n", &[]);
        assert!(matches!(refused(large), VolumeError::TooLarge { .. }));
        let short = local("CompressedData = True\nElementType = MET_UCHAR\n", &zlib(&u8s()[1..]));
        assert!(matches!(refused(short), VolumeError::Truncated { expected: 60, found: 59 }));
        let gzipped = local("CompressedData = True\nElementType = MET_UCHAR\n", &gzip(&u8s()));
        assert!(matches!(refused(gzipped), VolumeError::Decode { .. }));
        let outside = format!("{START}ElementType = MET_UCHAR\nElementDataFile = ../a.raw\n");
        assert!(matches!(read_file(&folder.write("a.mhd", outside)), Err(VolumeError::Outside { .. })));
    }

    #[test]
    fn it_is_told_by_its_lines() {
        assert!(sniff(b"Comment = x\r\nNDims = 3\r\n"));
        assert!(sniff(b"objecttype=Image"));
        for other in [&b""[..], b"= \n", b"NDims", b"a text\nNDims = 3\n", b"\xff\n=ObjectType = Image"] {
            assert!(!sniff(other), "{}", other.escape_ascii());
        }
    }
}
