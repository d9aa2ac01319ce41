//! numpy arrays: `.npy`, and archives of them, `.npz`.
//!
//! Every integer and float type of up to 64 bits, either byte order, C or Fortran order. Truth values become 0 and 255.
//! The array has the axes (Z, Y, X), or (Z, Y, X, 3) or (Z, Y, X, 4) for colour; axes of length 1 are left out where
//! there are more than three. An archive must hold exactly one array of such a shape.
//!
//! The header is parsed here and not by a crate: it is a Python literal, and a parser of all of them can be sent into
//! recursion or overflow by a hostile one.

use std::io::{self, BufReader, ErrorKind, Read};
use std::path::Path;

use zip::{CompressionMethod, ZipArchive};

use super::extent::{Axes, Axis, Encoding, Extent, Start, dense};
use super::levels::Scaling;
use super::{Endian, FileKind, ReadOptions, SampleType, Source, Volume, VolumeError, decode};

/// The longest header that is read; numpy itself refuses longer ones than 10 000.
const LONGEST_HEADER: u32 = 1 << 16;

const MAGIC: &[u8] = b"\x93NUMPY";

/// Whether a file begins as an array does.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// Whether a file begins as an archive of arrays does: a zip file whose first name ends in `.npy`.
pub(super) fn sniff_archive(head: &[u8]) -> bool {
    const NAME: usize = 30;
    let name = |head: &[u8]| {
        let length = usize::from(u16::from_le_bytes(*head.get(26..)?.first_chunk()?));
        Some(head.get(NAME..NAME + length)?.ends_with(b".npy"))
    };
    head.starts_with(b"PK\x03\x04") && name(head).unwrap_or(false)
}

/// The volume in an array.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    let array = extent(path, options)?;
    let (volume, source) = array.extent.read(options)?;
    Ok((array.finish(volume)?, source))
}

/// An array whose header has been read.
pub(super) struct Array {
    pub(super) extent: Extent,
    /// Samples are truth values.
    pub(super) truth: bool,
}

impl Array {
    /// Truth values become black and white.
    fn finish(&self, volume: Volume) -> Result<Volume, VolumeError> {
        if !self.truth {
            return Ok(volume);
        }
        let (shape, channels) = (volume.shape(), volume.channels());
        let mut voxels = volume.into_voxels();
        black_and_white(&mut voxels);
        Volume::new(shape, channels, voxels)
    }
}

/// The voxels of truth values.
pub(super) fn black_and_white(voxels: &mut [u8]) {
    voxels.iter_mut().for_each(|voxel| *voxel = if *voxel == 0 { 0 } else { 255 });
}

/// Where the samples of an array lie.
pub(super) fn extent(path: &Path, options: &ReadOptions) -> Result<Array, VolumeError> {
    let mut reader = BufReader::new(decode::open(path)?);
    Header::read(&mut reader)?.array(path, FileKind::Npy, options.max_voxels)
}

/// The volume in an archive of arrays.
pub(super) fn read_archive(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    let mut archive = ZipArchive::new(BufReader::new(decode::open(path)?)).map_err(damaged)?;
    let mut names = Vec::new();
    let mut volumes = Vec::new();
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).map_err(damaged)?;
        let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
        let Some(name) = name.strip_suffix(".npy") else { continue };
        let header = Header::read(&mut entry)?;
        names.push(format!("{} of shape {:?}", name.escape_debug(), header.shape));
        // Whatever its size: an array too large is still the one that is meant.
        if header.array(path, FileKind::Npz, u64::MAX).is_ok() {
            volumes.push((index, header));
        }
    }
    let [(index, header)] = volumes.as_slice() else { return Err(not_one(&names, volumes.len())) };
    let array = header.array(path, FileKind::Npz, options.max_voxels)?;
    let mut entry = archive.by_index(*index).map_err(damaged)?;
    Header::read(&mut entry)?;
    if entry.compression() != CompressionMethod::Stored {
        array.extent.may_inflate(options)?;
    }
    let (volume, source) = array.extent.read_from(entry, options)?;
    Ok((array.finish(volume)?, source))
}

fn damaged(source: zip::result::ZipError) -> VolumeError {
    VolumeError::Decode { what: "the zip archive".into(), source: Box::new(source) }
}

fn not_one(names: &[String], volumes: usize) -> VolumeError {
    const SHOWN: usize = 8;
    let mut list = names.iter().take(SHOWN).cloned().collect::<Vec<_>>().join(", ");
    if names.len() > SHOWN {
        list += &format!(" and {} more", names.len() - SHOWN);
    }
    VolumeError::Malformed {
        found: format!("the archive holds {volumes} arrays that could be a volume ({list})"),
        expected: "one is read from a file: save the volume by itself as .npy".into(),
    }
}

/// The header of an array.
struct Header {
    /// The type as the file writes it.
    descr: String,
    fortran_order: bool,
    shape: Vec<u64>,
    /// Bytes of the header, its magic included.
    length: u64,
}

impl Header {
    /// The header at the start of a stream, which is left at the first sample.
    fn read(reader: &mut impl Read) -> Result<Self, VolumeError> {
        let ended = |source: io::Error| match source.kind() {
            ErrorKind::UnexpectedEof => VolumeError::Malformed {
                found: "the file ends within the header of the array".into(),
                expected: "samples should follow it: the file is truncated, fetch or write it again".into(),
            },
            _ => VolumeError::Io { doing: "reading the header of the array", source },
        };
        let mut start = [0; 8];
        reader.read_exact(&mut start).map_err(ended)?;
        let [magic @ .., major, _] = &start;
        if magic != MAGIC {
            return Err(VolumeError::Malformed {
                found: format!("the array begins with \"{}\"", magic.escape_ascii()),
                expected: "a numpy array begins with \"\\x93NUMPY\": the file is of another kind than its name says"
                    .into(),
            });
        }
        let mut length = [0; 4];
        let width = if *major == 1 { 2 } else { 4 };
        reader.read_exact(&mut length[..width]).map_err(ended)?;
        let bytes = u32::from_le_bytes(length);
        if !(1..=3).contains(major) || bytes > LONGEST_HEADER {
            return Err(VolumeError::Unsupported {
                what: format!("a numpy array of format version {major} with a header of {bytes} bytes"),
                supported: format!("versions 1 to 3 with headers of up to {LONGEST_HEADER} bytes"),
            });
        }
        let mut text = vec![0; bytes as usize];
        reader.read_exact(&mut text).map_err(ended)?;
        let text = String::from_utf8_lossy(&text);
        let length = start.len() as u64 + width as u64 + u64::from(bytes);
        Self::parse(&text, length).unwrap_or_else(|| {
            Err(VolumeError::Malformed {
                found: format!("the header of the array is \"{}\"", shortened(text.trim())),
                expected: "it should be a dictionary of 'descr', 'fortran_order' and 'shape'".into(),
            })
        })
    }

    /// From `{'descr': '<f4', 'fortran_order': False, 'shape': (64, 64, 64), }`; `None` where it is no such dictionary.
    fn parse(text: &str, length: u64) -> Option<Result<Self, VolumeError>> {
        let mut rest = text.trim().strip_prefix('{')?.strip_suffix('}')?.trim();
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        while !rest.is_empty() {
            let (key, after) = rest.split_once(':')?;
            let end = end_of_value(after);
            let value = after.get(..end)?.trim();
            match unquoted(key.trim())? {
                "descr" => descr = Some(unquoted(value).unwrap_or(value).to_owned()),
                "fortran_order" => match truth(value) {
                    Some(truth) => fortran_order = Some(truth),
                    None => return Some(Err(odd("fortran_order", value, "it should be True or False"))),
                },
                "shape" => match lengths(value) {
                    Some(lengths) => shape = Some(lengths),
                    None => return Some(Err(odd("shape", value, "it should be a tuple of whole numbers from 0 on"))),
                },
                _ => {}
            }
            rest = after.get(end..)?.trim_start_matches(',').trim();
        }
        Some(Ok(Self { descr: descr?, fortran_order: fortran_order?, shape: shape?, length }))
    }

    /// The array that this heads, in a file of its own; of an archive's the extent counts from the start of its entry.
    fn array(&self, path: &Path, kind: FileKind, limit: u64) -> Result<Array, VolumeError> {
        let (samples, endian, truth) = self.samples()?;
        let extent = Extent {
            kind,
            file: path.into(),
            start: Start::At(self.length),
            encoding: Encoding::Raw,
            skip: 0,
            axes: Axes::of_array(&self.axes(), limit)?,
            samples,
            endian,
            scaling: Scaling::IDENTITY,
            spacing: None,
        };
        Ok(Array { extent, truth })
    }

    fn axes(&self) -> Vec<Axis> {
        if self.fortran_order {
            return dense(self.shape.iter().copied());
        }
        let mut axes = dense(self.shape.iter().rev().copied());
        axes.reverse();
        axes
    }

    /// The type and byte order of the samples, and whether they are truth values.
    fn samples(&self) -> Result<(SampleType, Endian, bool), VolumeError> {
        let unsupported = || VolumeError::Unsupported {
            what: format!("an array of type {}", self.descr.escape_debug()),
            supported: "bool, i1 to i8, u1 to u8, f2, f4 and f8".into(),
        };
        let (endian, code) = match self.descr.split_at_checked(1) {
            Some(("<", code)) => (Endian::Little, code),
            Some((">", code)) => (Endian::Big, code),
            Some(("|" | "=", code)) => (Endian::NATIVE, code),
            _ => return Err(unsupported()),
        };
        let ty = match code {
            "b1" | "u1" => SampleType::U8,
            "i1" => SampleType::I8,
            "u2" => SampleType::U16,
            "i2" => SampleType::I16,
            "u4" => SampleType::U32,
            "i4" => SampleType::I32,
            "u8" => SampleType::U64,
            "i8" => SampleType::I64,
            "f2" => SampleType::F16,
            "f4" => SampleType::F32,
            "f8" => SampleType::F64,
            _ => return Err(unsupported()),
        };
        Ok((ty, endian, code == "b1"))
    }
}

/// An entry of the header that is not what it should be.
fn odd(key: &str, value: &str, expected: &str) -> VolumeError {
    VolumeError::Malformed {
        found: format!("the header of the array says '{key}': {}", shortened(value)),
        expected: format!("{expected}: the file is damaged or was not written by numpy"),
    }
}

/// The beginning of a text that may be very long, escaped.
fn shortened(text: &str) -> String {
    const SHOWN: usize = 120;
    let start: String = text.chars().take(SHOWN).collect();
    let more = if start.len() < text.len() { "..." } else { "" };
    format!("{}{more}", start.escape_debug())
}

/// Where a value ends: at the first comma that is in no brackets and no quotes, or with the text.
fn end_of_value(text: &str) -> usize {
    let (mut depth, mut quote) = (0_usize, None);
    for (index, byte) in text.bytes().enumerate() {
        match (byte, quote) {
            (_, Some(open)) if byte == open => quote = None,
            (_, Some(_)) => {}
            (b'\'' | b'"', None) => quote = Some(byte),
            (b'(' | b'[' | b'{', None) => depth += 1,
            (b')' | b']' | b'}', None) => depth = depth.saturating_sub(1),
            (b',', None) if depth == 0 => return index,
            _ => {}
        }
    }
    text.len()
}

fn unquoted(text: &str) -> Option<&str> {
    let between = |quote| text.strip_prefix(quote)?.strip_suffix(quote);
    between('\'').or_else(|| between('"'))
}

fn truth(text: &str) -> Option<bool> {
    match text {
        "True" => Some(true),
        "False" => Some(false),
        _ => None,
    }
}

/// The numbers of a tuple; old writers end them with `L`.
fn lengths(text: &str) -> Option<Vec<u64>> {
    let inner = text.strip_prefix('(')?.strip_suffix(')')?.trim();
    let inner = inner.strip_suffix(',').unwrap_or(inner);
    if inner.is_empty() {
        return Some(Vec::new());
    }
    inner.split(',').map(|number| number.trim().trim_end_matches('L').parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use zip::write::SimpleFileOptions;

    use super::*;
    use crate::testing::{Folder, encode, read as read_file, samples, volume};

    /// An array as numpy writes it, in format version 1.
    fn npy(header: &str, data: &[u8]) -> Vec<u8> {
        versioned(1, header, data)
    }

    fn versioned(major: u8, header: &str, data: &[u8]) -> Vec<u8> {
        let length = header.len() as u32;
        let length = if major == 1 { (length as u16).to_le_bytes().to_vec() } else { length.to_le_bytes().to_vec() };
        [MAGIC, &[major, 0], &length, header.as_bytes(), data].concat()
    }

    fn header(descr: &str, fortran: bool, shape: &str) -> String {
        let fortran = if fortran { "True" } else { "False" };
        format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}          \n")
    }

    fn transposed() -> Vec<f64> {
        let (samples, [depth, height, width]) = (samples(), volume().shape());
        let at = |i: usize| samples[(i % depth * height + i / depth % height) * width + i / depth / height];
        (0..samples.len()).map(at).collect()
    }

    #[test]
    fn every_type_and_order() {
        let folder = Folder::new();
        for (code, ty) in [
            ("u1", SampleType::U8),
            ("u2", SampleType::U16),
            ("i2", SampleType::I16),
            ("u4", SampleType::U32),
            ("i4", SampleType::I32),
            ("u8", SampleType::U64),
            ("i8", SampleType::I64),
            ("f2", SampleType::F16),
            ("f4", SampleType::F32),
            ("f8", SampleType::F64),
        ] {
            for (order, endian) in [('<', Endian::Little), ('>', Endian::Big), ('=', Endian::NATIVE)] {
                for (fortran, values) in [(false, samples()), (true, transposed())] {
                    let bytes =
                        npy(&header(&format!("{order}{code}"), fortran, "(3, 4, 5)"), &encode(&values, ty, endian));
                    let (found, source) = folder.read("array.npy", bytes).unwrap();
                    assert_eq!((found, source.samples), (volume(), ty), "{order}{code} {fortran}");
                }
            }
        }
        let halved: Vec<f64> = samples().iter().map(|v| (v - 255.0) / 2.0).collect();
        let (found, source) = folder
            .read("i1.npy", npy(&header("|i1", false, "(3, 4, 5)"), &encode(&halved, SampleType::I8, Endian::Little)))
            .unwrap();
        assert_eq!((found.voxels()[59], source.samples), (255, SampleType::I8));
    }

    #[test]
    fn truth_values_are_black_and_white() {
        let bytes: Vec<u8> = (0..60).map(|i| i % 3).collect();
        let (found, source) = Folder::new().read("b.npy", npy(&header("|b1", false, "(3, 4, 5)"), &bytes)).unwrap();
        assert_eq!(&found.voxels()[..4], [0, 255, 255, 0]);
        assert_eq!((source.samples, source.mapping), (SampleType::U8, None));
    }

    #[test]
    fn headers_of_every_version_and_writer() {
        let folder = Folder::new();
        let data = encode(&samples(), SampleType::U8, Endian::Little);
        for major in 1..=3 {
            let bytes = versioned(major, &header("|u1", false, "(3, 4, 5)"), &data);
            assert_eq!(folder.read("array.npy", bytes).unwrap().0, volume());
        }
        for text in [
            "{'shape': (3L, 4L, 5L), 'fortran_order': False, 'descr': '|u1'}",
            r#"{"descr": "|u1", "fortran_order": False, "shape": (3,4,5), "more": [(1, "}"), 2]}"#,
            "{ 'descr' : '|u1' , 'fortran_order' : False , 'shape' : ( 1 , 3 , 4 , 5 , ) , }",
        ] {
            assert_eq!(folder.read("array.npy", npy(text, &data)).unwrap().0, volume(), "{text}");
        }
    }

    #[test]
    fn what_is_no_volume_is_refused_in_a_sentence() {
        let folder = Folder::new();
        let refused = |bytes: Vec<u8>| folder.read("array.npy", bytes).unwrap_err();
        let sentence = |header: &str| refused(npy(header, &[0; 1000])).to_string();
        for descr in ["<c8", "|O", "<U3", "<f16", "<M8[ns]", "", "f4", "<"] {
            let found = sentence(&header(descr, false, "(3, 4, 5)"));
            assert!(found.starts_with(&format!("an array of type {descr} is not supported")), "{found}");
        }
        let record = "{'descr': [('a', '<f4'), ('b', '|u1')], 'fortran_order': False, 'shape': (3, 4, 5), }";
        assert!(
            sentence(record).contains("[('a', '<f4'), ('b', '|u1')]") || sentence(record).contains("is not supported")
        );
        for (shape, expected) in
            [("()", "0 axes"), ("(5,)", "1 axes"), ("(30, 40)", "2 axes"), ("(2, 3, 4, 5)", "4 axes")]
        {
            assert!(sentence(&header("|u1", false, shape)).contains(expected));
        }
        for broken in
            ["", "{", "{}", "{'descr': '|u1'}", "[1]", "{'descr': '|u1', 'fortran_order': 0, 'shape': (3, 4, 5)}"]
        {
            assert!(matches!(refused(npy(broken, &[])), VolumeError::Malformed { .. }), "{broken}");
        }
        for shape in ["(3, -4, 5)", "(3, 4, 1e9)", "3, 4, 5", &format!("(3, 4, {}0)", u64::MAX)] {
            let error = refused(npy(&header("|u1", false, shape), &[]));
            assert!(matches!(error, VolumeError::Malformed { .. }), "{shape}");
        }
        let large = refused(npy(&header("<f8", false, "(65536, 65536, 65536)"), &[]));
        assert!(matches!(large, VolumeError::TooLarge { .. }), "{large}");
        let short = refused(npy(&header("<u2", false, "(3, 4, 5)"), &[0; 119]));
        assert!(matches!(short, VolumeError::Truncated { expected: 120, found: 119 }), "{short}");
        assert!(matches!(refused(MAGIC.to_vec()), VolumeError::Malformed { .. }));
        assert!(matches!(refused(b"not an array".to_vec()), VolumeError::Malformed { .. }));
        let long = [MAGIC, &[2, 0], &u32::MAX.to_le_bytes(), b"{"].concat();
        assert!(matches!(refused(long), VolumeError::Unsupported { .. }));
        // A parser of all of Python would descend into this.
        let deep = refused(npy(&"(".repeat(60_000), &[]));
        assert!(matches!(deep, VolumeError::Malformed { .. }));
    }

    fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, bytes) in arrays {
            archive.start_file(*name, SimpleFileOptions::default()).unwrap();
            archive.write_all(bytes).unwrap();
        }
        archive.finish().unwrap().into_inner()
    }

    #[test]
    fn the_one_volume_of_an_archive_is_read() {
        let folder = Folder::new();
        let block = npy(&header("<f4", true, "(3, 4, 5)"), &encode(&transposed(), SampleType::F32, Endian::Little));
        let affine = npy(&header("<f8", false, "(4, 4)"), &[0; 128]);
        let name = npy(&header("<U5", false, "()"), &[0; 20]);
        let texts = npy(&header("<U1", false, "(3, 4, 5)"), &[0; 240]);
        let arrays = [
            ("affine.npy", affine.clone()),
            ("note.txt", vec![0]),
            ("name.npy", name),
            ("t.npy", texts),
            ("block.npy", block),
        ];
        let (found, source) = folder.read("some.dat", npz(&arrays)).unwrap();
        assert_eq!((found, source.kind), (volume(), FileKind::Npz));

        let none = folder.read("none.npz", npz(&[("affine.npy", affine)])).unwrap_err().to_string();
        assert!(none.contains("holds 0 arrays that could be a volume (affine of shape [4, 4])"), "{none}");
        let empty = folder.read("empty.npz", npz(&[])).unwrap_err();
        assert!(matches!(empty, VolumeError::Malformed { .. }), "{empty}");
    }

    #[test]
    fn a_damaged_archive_is_found_out() {
        let folder = Folder::new();
        let block = npy(&header("|u1", false, "(3, 4, 5)"), &encode(&samples(), SampleType::U8, Endian::Little));
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        archive
            .start_file("block.npy", SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored))
            .unwrap();
        archive.write_all(&block).unwrap();
        let whole = archive.finish().unwrap().into_inner();
        let path = folder.write("whole.npz", &whole);
        assert_eq!(read_file(&path).unwrap().0, volume());
        let mut flipped = whole.clone();
        let sample = 30 + "block.npy".len() + block.len() - 1;
        flipped[sample] ^= 1;
        assert!(matches!(folder.read("flipped.npz", flipped), Err(VolumeError::Decode { .. })));
        assert!(matches!(folder.read("cut.npz", &whole[..whole.len() - 9]), Err(VolumeError::Decode { .. })));
        let short = npz(&[("short.npy", block[..block.len() - 5].to_vec())]);
        assert!(matches!(folder.read("short.npz", short), Err(VolumeError::Truncated { expected: 60, found: 55 })));
    }
}
