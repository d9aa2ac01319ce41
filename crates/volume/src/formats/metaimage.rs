//! MetaImage, with the samples in the same file (`.mha`) or in another (`.mhd`).
//!
//! Binary, zlib-compressed and ascii data. The first axis is the fastest, so (X, Y, Z) becomes (Z, Y, X); three or four
//! channels are interleaved colours. Orientation and origin are not applied. Data in several files are refused.
//!
//! Format: <https://itk.org/Wiki/ITK/MetaIO/Documentation>

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::{Format, FormatInfo, Head, VolumeReader};
use crate::layout::{self, Axes, DataLayout, Encoding, HeaderLines, Start, dense};
use crate::text::excerpt;
use crate::{Endian, ReadOptions, SampleType, VolumeError, VoxelSpacing};

pub(super) struct MetaImage;

static INFO: FormatInfo = FormatInfo::new(
    "metaimage",
    "MetaImage",
    "A volume with its samples in the same file or in one beside it; binary, zlib or ascii.",
)
.extensions(&[".mha", ".mhd"])
.detached(&[".mhd"], &[".raw", ".zraw", ".bin", ".dat", ".img"])
.compressions(&["zlib"]);

impl Format for MetaImage {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    fn sniff(&self, head: &Head) -> bool {
        is_metaimage(head.bytes())
    }

    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        layout(path, options)?.open()
    }
}

/// The field that ends a header.
const LAST: &str = "elementdatafile";

/// Whether the first lines are `Key = value`, with one of two keys among them that every header has.
fn is_metaimage(start: &[u8]) -> bool {
    const LINES: usize = 16;
    let known = |line: &[u8]| {
        let key = line.split(|&byte| byte == b'=').next().unwrap_or_default().trim_ascii();
        key.eq_ignore_ascii_case(b"ObjectType") || key.eq_ignore_ascii_case(b"NDims")
    };
    let lines = start.split(|&byte| byte == b'\n').take(LINES);
    lines.take_while(|line| line.contains(&b'=') && line.is_ascii()).any(known)
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
            let (key, value) = line.split_once('=').ok_or_else(|| {
                let found = format!("the header has the line \"{}\"", excerpt(&line));
                VolumeError::malformed(found, "every line of it should be `Key = value`")
            })?;
            let key = key.trim().to_ascii_lowercase();
            let last = key == LAST;
            values.insert(key, value.trim().to_owned());
            if last {
                return Ok(Self { values, length: lines.position });
            }
        }
        Err(VolumeError::malformed("the header has no field `ElementDataFile`", "it should end with one"))
    }

    fn get(&self, key: &str) -> Option<&str> {
        self.values.get(&key.to_ascii_lowercase()).map(String::as_str)
    }

    fn required(&self, key: &str) -> Result<&str, VolumeError> {
        self.get(key).ok_or_else(|| {
            let found = format!("the header has no field `{key}`");
            VolumeError::malformed(found, "a MetaImage needs NDims, DimSize, ElementType and ElementDataFile")
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
fn layout(path: &Path, options: &ReadOptions) -> Result<DataLayout, VolumeError> {
    let fields = Fields::read(path)?;
    let samples = sample_type(fields.required("ElementType")?)?;
    let axes = axes(&fields, options)?;
    let (file, first) = data_file(path, &fields)?;
    let encoding = encoding(&fields)?;
    let start = match fields.number::<i64>("HeaderSize")?.unwrap_or(0) {
        0 => Start::At(first),
        -1 if encoding == Encoding::Raw => Start::FromEnd,
        // From the start of the file that holds the samples, even if that is the header's own.
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
    let endian = if msb { Endian::Big } else { Endian::Little };
    let spacing = spacing(&fields);
    Ok(DataLayout { start, encoding, spacing, ..DataLayout::raw(file, 0, axes, samples, endian) })
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
    // The channels of a voxel are side by side: the fastest axis of all.
    let channels: u64 = fields.number("ElementNumberOfChannels")?.unwrap_or(1);
    if !matches!(channels, 1 | 3 | 4) {
        return Err(VolumeError::Channels { found: channels });
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
        return Err(VolumeError::SeveralDataFiles);
    }
    Ok((layout::beside(header, Path::new(named))?, 0))
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
                what: format!("a MetaImage of type \"{}\"", excerpt(text)),
                supported: "MET_CHAR, MET_SHORT, MET_INT, MET_LONG, MET_LONG_LONG, their unsigned forms, MET_FLOAT and MET_DOUBLE".into(),
            });
        }
    })
}

/// The spacing along (Z, Y, X), or else the size of a voxel.
fn spacing(fields: &Fields) -> Option<VoxelSpacing> {
    let text = fields.get("ElementSpacing").or_else(|| fields.get("ElementSize"))?;
    let steps = text.split_whitespace().map(|step| step.parse().ok()).collect::<Option<Vec<f64>>>()?;
    let [x, y, z] = *steps.first_chunk::<3>()?;
    VoxelSpacing::new([z, y, x])
}

fn malformed(key: &str, value: &str, expected: &str) -> VolumeError {
    VolumeError::malformed(
        format!("the field `{key}` holds \"{}\"", excerpt(value)),
        format!("it should hold {expected}"),
    )
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
                assert_eq!((found, source.samples, source.format), (volume(), ty, "metaimage"), "{name} {key}");
            }
        }
    }

    #[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
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
            let expected = expected.and_then(VoxelSpacing::new);
            assert_eq!(folder.read("a.mha", bytes).unwrap().1.spacing, expected);
        }
    }

    #[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
    #[test]
    fn headers_that_are_wrong_are_refused() {
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
        for fields in
            ["ElementType = MET_STRING\n", "ElementType = MET_UCHAR\nBinaryData = False\nCompressedData = True\n"]
        {
            assert!(matches!(refused(local(fields, &u8s())), VolumeError::Unsupported { .. }), "{fields}");
        }
        for fields in [
            "ElementType = MET_UCHAR\nElementDataFile = LIST\n",
            "ElementType = MET_UCHAR\nElementDataFile = s%03d.raw 1 3 1\n",
        ] {
            assert!(matches!(refused(local(fields, &u8s())), VolumeError::SeveralDataFiles), "{fields}");
        }
        let two = local("ElementType = MET_UCHAR\nElementNumberOfChannels = 2\n", &u8s());
        assert!(matches!(refused(two), VolumeError::Channels { found: 2 }));
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
        assert!(matches!(read_file(&folder.write("a.mhd", outside)), Err(VolumeError::OutsideFolder { .. })));
    }

    #[test]
    fn headers_are_recognised_by_their_lines() {
        assert!(is_metaimage(b"Comment = x\r\nNDims = 3\r\n"));
        assert!(is_metaimage(b"objecttype=Image"));
        for other in [&b""[..], b"= \n", b"NDims", b"a text\nNDims = 3\n", b"\xff\n=ObjectType = Image"] {
            assert!(!is_metaimage(other), "{}", other.escape_ascii());
        }
    }
}
