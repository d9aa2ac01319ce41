//! Every form, type and byte order, pairs, and headers that are wrong.

use super::header::SIZE_1;
use super::*;
use crate::testing::{Folder, encode, gzip, read as read_file, samples, volume};
use crate::{Endian, Intensity, LengthUnit, SampleType, VoxelSpacing, read as read_any};

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
        // Micrometres and seconds.
        self.put(&mut bytes, if self.two { 500 } else { 123 }, integer(3 + 8, if self.two { 4 } else { 1 }));
        let place = if self.two { 176 } else { 112 };
        self.put(&mut bytes, place, float(self.scaling.0, real));
        self.put(&mut bytes, place + real, float(self.scaling.1, real));
        bytes
    }

    /// A single file: header, four bytes about extensions, samples at the offset.
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

#[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
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
            for (name, bytes) in [("a.nii.gz", gzip(&bytes)), ("by content", bytes)] {
                let (found, source) = folder.read(name, bytes).unwrap();
                assert_eq!((found, source.samples, source.format), (volume(), ty, "nifti"), "{name} {datatype}");
                let spacing = VoxelSpacing::new([2.0, 0.75, 0.5]).unwrap().unit(Some(LengthUnit::Micrometer));
                assert_eq!(source.spacing, Some(spacing));
            }
        }
    }
}

#[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
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
fn the_missing_file_of_a_pair_is_named() {
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
        assert!(matches!(linked, Err(VolumeError::OutsideFolder { .. })), "{linked:?}");
    }
}

#[test]
fn a_calibration_is_applied_if_it_is_one() {
    let folder = Folder::new();
    let levels = |scaling: (f64, f64), ty, datatype, lo, hi| {
        let bytes = Written { scaling, datatype, ..Written::new(true, Endian::Little) }.single(ty);
        let options = ReadOptions::new().intensity(Intensity::Window { lo, hi });
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

#[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
#[test]
fn offsets_are_used_and_corrected() {
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

#[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
#[test]
fn headers_that_are_wrong_are_refused() {
    let folder = Folder::new();
    let refused = |written: Written| folder.read("a.nii", written.single(SampleType::U8)).unwrap_err();
    for form in forms() {
        let dims = |dim: &[i64]| refused(Written { dim: dim.to_vec(), ..form.clone() });
        assert!(matches!(dims(&[2, 12, 5]), VolumeError::Dimensions { .. }));
        assert!(matches!(dims(&[4, 5, 4, 3, 12]), VolumeError::SeveralVolumes { .. }));
        assert!(matches!(dims(&[5, 5, 4, 3, 1, 2]), VolumeError::Channels { found: 2 }));
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
