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
        // (i, j, k, time, vector, ...): of the last ones only one may be longer than 1, and that is a colour's.
        let mut axes = dense(lengths);
        let others = axes.split_off(axes.len().min(3)).into_iter().filter(|axis| axis.length != 1);
        axes.reverse();
        let axes = match others.collect::<Vec<_>>()[..] {
            [] => Axes::new(&axes, None, options.max_voxels)?,
            [channel] => Axes::new(&axes, Some(channel), options.max_voxels)?,
            _ => {
                return Err(VolumeError::Dimensions { found: self.dim[1..=count].iter().map(|&n| n as u64).collect() });
            }
        };
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
pub(super) fn extent(path: &Path, options: &ReadOptions) -> Result<Extent, VolumeError> {
    let header_path = header_of(path)?;
    let bytes = header_bytes(&header_path)?;
    if let Some(size) = cut_short(&bytes) {
        return Err(VolumeError::Malformed {
            found: format!("the file ends after {} bytes, within its header of {size}", bytes.len()),
            expected: "samples should follow the header: the file is truncated, fetch or write it again".into(),
        });
    }
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

/// The size that a header says it has, where there is less of it.
fn cut_short(bytes: &[u8]) -> Option<usize> {
    let said: [u8; 4] = *bytes.first_chunk()?;
    let said = [u32::from_le_bytes(said), u32::from_be_bytes(said)];
    [SIZE_1, SIZE_2].into_iter().find(|&size| said.contains(&(size as u32)) && bytes.len() < size)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Folder, encode, gzip, read as read_file, samples, volume};
    use crate::{Intensity, read as read_any};

    /// A header, to be changed by the tests before it is written.
    #[derive(Clone)]
    struct Written {
        two: bool,
        endian: Endian,
        magic: &'static [u8; 4],
        dim: Vec<i64>,
        datatype: i64,
        pixdim: [f64; 3],
        offset: i64,
        scaling: (f64, f64),
    }

    impl Written {
        fn new(two: bool, endian: Endian) -> Self {
            Self {
                two,
                endian,
                magic: if two { b"n+2\0" } else { b"n+1\0" },
                dim: vec![3, 5, 4, 3, 1, 1, 1, 1],
                datatype: 2,
                pixdim: [0.5, -0.75, 2.0],
                offset: if two { 544 } else { 352 },
                scaling: (0.0, 0.0),
            }
        }

        fn put(&self, bytes: &mut [u8], place: usize, mut number: Vec<u8>) {
            if self.endian == Endian::Big {
                number.reverse();
            }
            bytes[place..place + number.len()].copy_from_slice(&number);
        }

        fn bytes(&self) -> Vec<u8> {
            let size = if self.two { SIZE_2 } else { SIZE_1 };
            let mut bytes = vec![0; size];
            let integer = |number: i64, width: usize| number.to_le_bytes()[..width].to_vec();
            let float = |number: f64, width| {
                if width == 8 { number.to_le_bytes().to_vec() } else { (number as f32).to_le_bytes().to_vec() }
            };
            let (dim, wide, pixdim, real) = if self.two { (16, 8, 112, 8) } else { (40, 2, 80, 4) };
            self.put(&mut bytes, 0, integer(size as i64, 4));
            self.dim.iter().enumerate().for_each(|(i, &n)| self.put(&mut bytes, dim + wide * i, integer(n, wide)));
            self.pixdim.iter().enumerate().for_each(|(i, &n)| self.put(&mut bytes, pixdim + real * i, float(n, real)));
            self.put(&mut bytes, if self.two { 12 } else { 70 }, integer(self.datatype, 2));
            if self.two {
                self.put(&mut bytes, 168, integer(self.offset, 8));
                bytes[4..8].copy_from_slice(self.magic);
            } else {
                self.put(&mut bytes, 108, float(self.offset as f64, 4));
                bytes[344..].copy_from_slice(self.magic);
            }
            let place = if self.two { 176 } else { 112 };
            self.put(&mut bytes, place, float(self.scaling.0, real));
            self.put(&mut bytes, place + real, float(self.scaling.1, real));
            bytes
        }

        /// A file of its own: header, four bytes that tell of extensions, samples at the offset.
        fn single(&self, ty: SampleType) -> Vec<u8> {
            let mut bytes = self.bytes();
            bytes.resize(usize::try_from(self.offset).unwrap_or(0).max(bytes.len() + 4), 0);
            bytes.extend(encode(&samples(), ty, self.endian));
            bytes
        }
    }

    fn forms() -> impl Iterator<Item = Written> {
        let endians = [Endian::Little, Endian::Big];
        [false, true].into_iter().flat_map(move |two| endians.map(|endian| Written::new(two, endian)))
    }

    #[test]
    fn every_form_type_and_byte_order() {
        let folder = Folder::new();
        for form in forms() {
            for (datatype, ty) in [
                (2, SampleType::U8),
                (4, SampleType::I16),
                (8, SampleType::I32),
                (16, SampleType::F32),
                (64, SampleType::F64),
                (512, SampleType::U16),
                (768, SampleType::U32),
                (1024, SampleType::I64),
                (1280, SampleType::U64),
            ] {
                let bytes = Written { datatype, ..form.clone() }.single(ty);
                for (name, bytes) in [("a.nii.gz", gzip(&bytes)), ("told by content", bytes)] {
                    let (found, source) = folder.read(name, bytes).unwrap();
                    assert_eq!(
                        (found, source.samples, source.kind),
                        (volume(), ty, FileKind::Nifti),
                        "{name} {datatype}"
                    );
                    assert_eq!(source.spacing, Some([2.0, 0.75, 0.5]));
                }
            }
        }
    }

    #[test]
    fn both_names_of_a_pair_lead_to_it() {
        let image = encode(&samples(), SampleType::I16, Endian::Big);
        for (two, magic) in [(false, b"ni1\0"), (true, b"ni2\0"), (false, b"\0\0\0\0")] {
            let header = Written { magic, datatype: 4, offset: 0, ..Written::new(two, Endian::Big) }.bytes();
            for names in [
                ["a.hdr", "a.img"],
                ["A.HDR", "A.IMG"],
                ["a.b.hdr", "a.b.img"],
                ["a.hdr.gz", "a.img.gz"],
                ["a.hdr", "a.img.gz"],
            ] {
                let folder = Folder::new();
                let packed = |name: &str, bytes: &[u8]| if name.ends_with("gz") { gzip(bytes) } else { bytes.to_vec() };
                for (name, bytes) in [(names[0], &header), (names[1], &image)] {
                    folder.write(name, packed(name, bytes));
                }
                for name in names {
                    assert_eq!(
                        read_file(&folder.path().join(name)).unwrap().0,
                        volume(),
                        "{name} {}",
                        magic.escape_ascii()
                    );
                }
            }
        }
    }

    #[test]
    fn a_pair_that_is_not_whole_says_what_is_missing() {
        let folder = Folder::new();
        let header = Written { magic: b"ni1\0", offset: 0, ..Written::new(false, Endian::Little) }.bytes();
        let alone = folder.read("a.hdr", &header).unwrap_err().to_string();
        assert!(alone.starts_with("there is no a.img beside the file"), "{alone}");
        let alone = folder.read("b.img", [0; 60]).unwrap_err().to_string();
        assert!(alone.starts_with("there is no b.hdr beside the file"), "{alone}");
        assert!(matches!(folder.read("c.nii", &header), Err(VolumeError::Malformed { .. })));
        folder.write("a.img", [0; 59]);
        let short = read_file(&folder.path().join("a.hdr"));
        assert!(matches!(short, Err(VolumeError::Truncated { expected: 60, found: 59 })), "{short:?}");
        #[cfg(unix)]
        {
            let inner = folder.path().join("inner");
            std::fs::create_dir(&inner).unwrap();
            std::os::unix::fs::symlink("../a.img", inner.join("l.img")).unwrap();
            let linked = read_file(&folder.write("inner/l.hdr", &header));
            assert!(matches!(linked, Err(VolumeError::Outside { .. })), "{linked:?}");
        }
    }

    #[test]
    fn a_scaling_is_applied_where_it_is_one() {
        let folder = Folder::new();
        let levels = |scaling: (f64, f64), ty, datatype, lo, hi| {
            let bytes = Written { scaling, datatype, ..Written::new(true, Endian::Little) }.single(ty);
            let options = ReadOptions { intensity: Intensity::Window { lo, hi }, ..ReadOptions::default() };
            read_any(&folder.write("a.nii", bytes), &options).unwrap().0
        };
        let plain = levels((0.0, 0.0), SampleType::I16, 4, 10.0, 90.0);
        assert_eq!(levels((0.5, 3.0), SampleType::I16, 4, 8.0, 48.0), plain);
        assert_eq!(levels((f64::NAN, 3.0), SampleType::I16, 4, 10.0, 90.0), plain);
        // Taken as they are.
        assert_eq!(levels((-1.0, 3.0), SampleType::U8, 2, 8.0, 48.0), volume());
        let turned = Written { scaling: (-1.0, 0.0), datatype: 4, ..Written::new(false, Endian::Big) };
        let (turned, source) = folder.read("a.nii", turned.single(SampleType::I16)).unwrap();
        assert!(turned.voxels().iter().zip(volume().voxels()).all(|(a, b)| a + b == 255));
        let mapping = source.mapping.unwrap();
        assert_eq!((mapping.lo, mapping.hi), (-255.0, 0.0));
    }

    #[test]
    fn colours_are_interleaved_or_a_vector_axis() {
        let folder = Folder::new();
        let rgb: Vec<u8> = (0..180).collect();
        let rgba: Vec<u8> = rgb.chunks(3).flat_map(|p| [p[0], p[1], p[2], 77]).collect();
        let planar: Vec<u8> = (0..3).flat_map(|c| (0..60).map(move |i| 3 * i + c)).collect();
        let vector = vec![5, 5, 4, 3, 1, 3, 1, 1];
        let grey = vec![3, 5, 4, 3, 1, 1, 1, 1];
        for (datatype, dim, data) in [(128, grey.clone(), &rgb), (2304, grey, &rgba), (2, vector.clone(), &planar)] {
            let written = Written { datatype, dim, ..Written::new(false, Endian::Little) };
            let bytes = [&written.bytes()[..], &[0; 4], data].concat();
            let (found, _) = folder.read("a.nii", bytes).unwrap();
            assert_eq!((found.channels(), found.voxels()), (3, &rgb[..]), "{datatype}");
        }
        let both = Written { datatype: 128, dim: vector, ..Written::new(false, Endian::Little) };
        assert!(matches!(folder.read("a.nii", both.single(SampleType::U8)), Err(VolumeError::Malformed { .. })));
    }

    #[test]
    fn offsets_are_kept_and_mended() {
        let folder = Folder::new();
        for form in forms() {
            for offset in [form.offset, form.offset + 48] {
                let bytes = Written { offset, ..form.clone() }.single(SampleType::U8);
                assert_eq!(folder.read("a.nii", &bytes).unwrap().0, volume());
                assert_eq!(folder.read("a.nii.gz", gzip(&bytes)).unwrap().0, volume());
            }
            // Careless writers leave it at 0.
            let mut careless = Written { offset: 0, ..form.clone() }.bytes();
            careless.extend([0; 4]);
            careless.extend(encode(&samples(), SampleType::U8, form.endian));
            assert_eq!(folder.read("a.nii", careless).unwrap().0, volume());
            let negative = Written { offset: -8, ..form }.single(SampleType::U8);
            assert!(matches!(folder.read("a.nii", negative), Err(VolumeError::Malformed { .. })));
        }
    }

    #[test]
    fn what_is_no_volume_is_refused() {
        let folder = Folder::new();
        let refused = |written: Written| folder.read("a.nii", written.single(SampleType::U8)).unwrap_err();
        for form in forms() {
            let dims = |dim: &[i64]| refused(Written { dim: dim.to_vec(), ..form.clone() });
            assert!(matches!(dims(&[2, 12, 5]), VolumeError::Dimensions { .. }));
            assert!(matches!(dims(&[4, 5, 4, 3, 12]), VolumeError::Unsupported { .. }));
            assert!(matches!(dims(&[5, 5, 4, 3, 1, 2]), VolumeError::Unsupported { .. }));
            assert!(matches!(dims(&[6, 5, 4, 3, 1, 3, 3]), VolumeError::Dimensions { .. }));
            assert!(matches!(dims(&[0, 5, 4, 3]), VolumeError::Malformed { .. }));
            assert!(matches!(dims(&[8, 5, 4, 3]), VolumeError::Malformed { .. }));
            assert!(matches!(dims(&[3, 5, -4, 3]), VolumeError::Malformed { .. }));
            assert!(matches!(dims(&[3, 5, 4, 2]), VolumeError::TooSmall { .. }));
            assert!(matches!(dims(&[3, 30_000, 30_000, 30_000]), VolumeError::TooLarge { .. }));
            assert!(matches!(dims(&[3, 5, 4, 4]), VolumeError::Truncated { expected: 80, found: 60 }));
            for datatype in [0, 1, 32, 1536, 1792, 2048, -1] {
                assert!(matches!(refused(Written { datatype, ..form.clone() }), VolumeError::Unsupported { .. }));
            }
        }
        for broken in [&b""[..], &[0; 9], &[0; 400], b"ENVI\ndescription = {"] {
            assert!(matches!(folder.read("a.hdr", broken), Err(VolumeError::Malformed { .. })));
        }
        let cut = &gzip(&Written::new(false, Endian::Big).single(SampleType::U8))[..40];
        assert!(matches!(folder.read("a.nii.gz", cut), Err(VolumeError::Decode { .. })));
    }
}
