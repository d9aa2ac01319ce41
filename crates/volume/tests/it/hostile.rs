//! No bytes make a reader panic, hang, take more memory than its limits allow, or quote more than a line of them.
//!
//! Valid small files of every format, written by other programs, are damaged at random and read again; so are random bytes
//! under every name. A small limit of voxels bounds the work that a wrong header can cause, so that
//! thousands of cases stay fast.

use std::io::Write;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use proptest::sample::Index;

use hlacdb_volume::{Endian, Hint, Intensity, RawLayout, ReadOptions, SampleType, VolumeError, read};

use crate::support::{Folder, assert_bounded, entries, gzip};

const LIMIT: u64 = 1 << 16;

fn files() -> Vec<PathBuf> {
    let mut files = entries("volumes");
    files.retain(|path| path.is_file());
    files
}

/// One way of damaging a file.
#[derive(Debug, Clone)]
enum Damage {
    Flip(Index, u8),
    Set(Index, Vec<u8>),
    Cut(Index),
    Insert(Index, Vec<u8>),
    Remove(Index, usize),
    Repeat(Index, usize),
}

impl Damage {
    fn apply(&self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        let length = bytes.len();
        match self {
            Self::Flip(at, bits) => bytes[at.index(length)] ^= bits,
            Self::Set(at, with) => {
                let at = at.index(length);
                let end = length.min(at + with.len());
                bytes[at..end].copy_from_slice(&with[..end - at]);
            }
            Self::Cut(at) => bytes.truncate(at.index(length)),
            Self::Insert(at, with) => {
                let at = at.index(length);
                bytes.splice(at..at, with.iter().copied());
            }
            Self::Remove(at, count) => {
                let at = at.index(length);
                bytes.drain(at..length.min(at + count));
            }
            Self::Repeat(at, count) => {
                let at = at.index(length);
                let part = bytes[at..length.min(at + count)].to_vec();
                bytes.splice(at..at, part);
            }
        }
    }
}

fn damage() -> impl Strategy<Value = Damage> {
    let extreme = prop::sample::select(vec![
        vec![0; 4],
        vec![0xff; 8],
        vec![0x7f, 0xff],
        vec![0xff, 0x7f],
        b"-1".to_vec(),
        b"99999999999999999999".to_vec(),
        b"\n\n".to_vec(),
        b"((((".to_vec(),
        b"nan".to_vec(),
        b" ../".to_vec(),
    ]);
    prop_oneof![
        (any::<Index>(), 1_u8..).prop_map(|(at, bits)| Damage::Flip(at, bits)),
        (any::<Index>(), extreme.clone()).prop_map(|(at, with)| Damage::Set(at, with)),
        any::<Index>().prop_map(Damage::Cut),
        (any::<Index>(), prop_oneof![extreme, prop::collection::vec(any::<u8>(), 1..40)])
            .prop_map(|(at, with)| Damage::Insert(at, with)),
        (any::<Index>(), 1_usize..64).prop_map(|(at, count)| Damage::Remove(at, count)),
        (any::<Index>(), 1_usize..64).prop_map(|(at, count)| Damage::Repeat(at, count)),
    ]
}

/// Reads a file and checks the volume or the error.
fn survives(path: &Path, intensity: Intensity) {
    let raw = RawLayout::new([5, 7, 9], SampleType::F16, Endian::Big).offset(3);
    let options = ReadOptions::new().intensity(intensity).max_voxels(LIMIT);
    for options in [options, options.raw(raw)] {
        match read(path, &options) {
            Ok((volume, _)) => assert!(volume.voxels().len() as u64 <= 3 * LIMIT),
            Err(error) => assert_bounded(&error),
        }
    }
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(700))]

    #[test]
    fn damaged_files_are_read_or_refused(
        file in any::<Index>(),
        damages in prop::collection::vec(damage(), 1..4),
        auto in any::<bool>(),
        packed in any::<bool>(),
    ) {
        let files = files();
        let path = file.get(&files);
        let mut bytes = std::fs::read(path).unwrap();
        damages.iter().for_each(|damage| damage.apply(&mut bytes));
        let folder = Folder::new();
        // A detached header finds its data, whole.
        for entry in files.iter().filter(|other| other.file_stem() == path.file_stem()) {
            folder.write(entry.file_name().unwrap().to_str().unwrap(), std::fs::read(entry).unwrap());
        }
        // Damage before packing reaches the header behind the checksum.
        let bytes = if packed && path.extension().is_some_and(|ending| ending == "nii") { gzip(&bytes) } else { bytes };
        let damaged = folder.write(path.file_name().unwrap().to_str().unwrap(), bytes);
        survives(&damaged, if auto { Intensity::Auto } else { Intensity::Full });
    }

    #[test]
    fn random_bytes_under_any_name_are_read_or_refused(
        start in prop::sample::select(vec![
            &b""[..], b"\x93NUMPY\x01\x00", b"PK\x03\x04", b"NRRD0004\n", b"ObjectType = Image\n", b"\x5c\x01\0\0",
            b"\0\0\x02\x1cn+2\0", b"\x1f\x8b\x08\0\0\0\0\0\0\xff",
        ]),
        ending in prop::sample::select(vec![
            "", ".npy", ".npz", ".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".nii.gz", ".hdr", ".img", ".raw",
        ]),
        rest in prop::collection::vec(any::<u8>(), 0..700),
    ) {
        let folder = Folder::new();
        survives(&folder.write(&format!("a{ending}"), [start, &rest].concat()), Intensity::Full);
    }
}

/// Files in every compressed format whose header promises 3 x 40 x 50 voxels of `u8`, and whose data are `more` zeros.
fn packed(folder: &Folder, more: usize) -> Vec<PathBuf> {
    let data = vec![0; more];
    let nrrd = |encoding: &str, data: Vec<u8>| {
        let header = format!("NRRD0004\ntype: uchar\ndimension: 3\nsizes: 50 40 3\nencoding: {encoding}\n\n");
        [header.into_bytes(), data].concat()
    };
    let mut bzip2 = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
    bzip2.write_all(&data).unwrap();
    let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    zlib.write_all(&data).unwrap();
    let metaimage =
        "NDims = 3\nDimSize = 50 40 3\nElementType = MET_UCHAR\nCompressedData = True\nElementDataFile = LOCAL\n";
    let mut nifti = vec![0; 352];
    nifti[..4].copy_from_slice(&348_u32.to_le_bytes());
    for (axis, length) in [3_i16, 50, 40, 3, 1, 1, 1, 1].into_iter().enumerate() {
        nifti[40 + 2 * axis..42 + 2 * axis].copy_from_slice(&length.to_le_bytes());
    }
    nifti[70] = 2;
    nifti[108..112].copy_from_slice(&352_f32.to_le_bytes());
    nifti[344..348].copy_from_slice(b"n+1\0");
    let header = "{'descr': '|u1', 'fortran_order': False, 'shape': (3, 40, 50), }\n";
    let npy = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &data].concat();
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let deflated = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    zip.start_file("a.npy", deflated).unwrap();
    zip.write_all(&npy).unwrap();
    vec![
        folder.write("gzip.nrrd", nrrd("gzip", gzip(&data))),
        folder.write("bzip2.nrrd", nrrd("bzip2", bzip2.finish().unwrap())),
        folder.write("zlib.mha", [metaimage.as_bytes(), &zlib.finish().unwrap()].concat()),
        folder.write("gzip.nii.gz", gzip(&[nifti, data.clone()].concat())),
        folder.write("zip.npz", zip.finish().unwrap().into_inner()),
    ]
}

/// Data behind the promised samples are not decoded: of each of these 64 MiB, 6000 bytes and what a decoder reads ahead.
#[test]
fn no_more_is_inflated_than_the_header_promises() {
    let folder = Folder::new();
    for path in packed(&folder, 1 << 26) {
        let limited = ReadOptions::new().max_inflated(6000).max_voxels(6000);
        let (volume, _) = read(&path, &limited).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(volume.shape(), [3, 40, 50]);
        assert!(volume.into_voxels().capacity() < 1 << 20, "{}", path.display());
    }
}

#[test]
fn a_small_file_of_many_zeros_is_refused_before_it_takes_memory() {
    let folder = Folder::new();
    let slices = folder.path().join("slices");
    std::fs::create_dir(&slices).unwrap();
    for n in 0..3 {
        image::GrayImage::new(500, 400).save(slices.join(format!("{n}.png"))).unwrap();
    }
    let mut paths = packed(&folder, 6000);
    paths.push(slices);
    for path in paths {
        let limited = |max_inflated| read(&path, &ReadOptions::new().max_inflated(max_inflated));
        let error = limited(5999).unwrap_err();
        assert!(matches!(error.error, VolumeError::Inflated { limit: 5999, .. }), "{error}");
        assert_eq!(error.hint(), Some(Hint::RaiseInflatedLimit), "{error}");
        assert!(limited(600_000).is_ok(), "{}", path.display());
    }
    // Files that are not compressed, or no more than ordinary scans are, have no limit.
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    for name in ["volumes/deep_nifti1_gz.nii.gz", "volumes/deep.npy", "pictures/deflate.tif", "pictures/plain.tif"] {
        let options = ReadOptions::new().max_inflated(0);
        assert!(read(&fixtures.join(name), &options).is_ok(), "{name}");
    }
}

/// Headers that are valid so far that their text would be quoted, and long.
#[test]
fn long_texts_of_headers_are_cut_in_errors() {
    let folder = Folder::new();
    let long = "[".repeat(60_000);
    let numbers = "7 ".repeat(30_000);
    let npy = |text: &str| {
        let length = (text.len() as u32).to_le_bytes();
        [b"\x93NUMPY\x02\x00", &length[..], text.as_bytes(), &[0; 100]].concat()
    };
    let nrrd = |fields: &str| format!("NRRD0004\n{fields}\n\n").into_bytes();
    let mha = |fields: &str| format!("ObjectType = Image\nNDims = 3\n{fields}\nElementDataFile = LOCAL\n").into_bytes();
    let files = [
        ("brackets.npy", npy(&long)),
        ("type.npy", npy(&format!("{{'descr': {long}, 'fortran_order': False, 'shape': (3, 4, 5), }}"))),
        ("order.npy", npy(&format!("{{'descr': '|u1', 'fortran_order': {long}, 'shape': (3, 4, 5), }}"))),
        ("axes.npy", npy(&format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({}), }}", "9,".repeat(20_000)))),
        ("line.nrrd", nrrd(&long)),
        ("magic.nrrd", format!("{long}\n").into_bytes()),
        ("type.nrrd", nrrd(&format!("type: {long}\nencoding: raw\nsizes: 3 4 5"))),
        ("sizes.nrrd", nrrd(&format!("type: uchar\nencoding: raw\nsizes: {numbers}"))),
        ("endian.nrrd", nrrd(&format!("type: short\nencoding: raw\nsizes: 3 4 5\nendian: {long}"))),
        ("file.nhdr", nrrd(&format!("type: uchar\nencoding: raw\nsizes: 3 4 5\ndata file: {long}"))),
        ("outside.nhdr", nrrd(&format!("type: uchar\nencoding: raw\nsizes: 3 4 5\ndata file: ../{long}"))),
        ("type.mha", mha(&format!("ElementType = {long}"))),
        ("sizes.mha", mha(&format!("ElementType = MET_UCHAR\nDimSize = {numbers}"))),
        ("line.mha", mha(&long)),
        ("text.nrrd", [nrrd("type: uchar\nencoding: ascii\nsizes: 3 4 5"), long.clone().into_bytes()].concat()),
    ];
    for (name, bytes) in files {
        let error = read(&folder.write(name, bytes), &ReadOptions::new()).expect_err(name);
        assert!(error.to_string().contains(name), "{error}");
        assert_bounded(&error);
    }
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for number in 0..20 {
        let name = format!("{number}{}.npy", "\n[".repeat(20_000));
        zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        zip.write_all(&npy("{'descr': '|u1', 'fortran_order': False, 'shape': (3, 4, 5), }")).unwrap();
    }
    let path = folder.write("names.npz", zip.finish().unwrap().into_inner());
    assert_bounded(&read(&path, &ReadOptions::new()).unwrap_err());
}
