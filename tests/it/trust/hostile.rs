//! A folder of hostile files: every one ends in one sentence, the good ones are in, and the program stays within a gibibyte.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::Command;

use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::Value;

use super::volume;
use crate::support::write_npy;

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    let length = (header.len() as u16).to_le_bytes();
    [&b"\x93NUMPY\x01\x00"[..], &length, header.as_bytes(), data].concat()
}

fn array(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    npy(&format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n"), data)
}

fn nifti(change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut header = vec![0; 352];
    header[..4].copy_from_slice(&348_u32.to_le_bytes());
    for (axis, length) in [3_i16, 4, 4, 4, 1, 1, 1, 1].into_iter().enumerate() {
        header[40 + 2 * axis..42 + 2 * axis].copy_from_slice(&length.to_le_bytes());
    }
    header[70] = 2;
    header[108..112].copy_from_slice(&352_f32.to_le_bytes());
    header[344..348].copy_from_slice(b"n+1\0");
    change(&mut header);
    header
}

fn set(at: usize, bytes: &'static [u8]) -> impl FnOnce(&mut Vec<u8>) {
    move |header| header[at..at + bytes.len()].copy_from_slice(bytes)
}

/// A little-endian TIFF of one directory, which claims the given entries and then says where the next directory is.
fn tiff(entries: &[(u16, u16, u32, u32)], next: u32) -> Vec<u8> {
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((entries.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in entries {
        bytes.extend(tag.to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(count.to_le_bytes());
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend(next.to_le_bytes());
    bytes
}

fn zip(name: &str, content: &[u8]) -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
    zip.write_all(content).unwrap();
    zip.finish().unwrap().into_inner()
}

fn vox(chunks: &[u8], claimed: u32) -> Vec<u8> {
    [&b"VOX "[..], &150_u32.to_le_bytes(), b"MAIN", &[0; 4], &claimed.to_le_bytes(), chunks].concat()
}

/// Forty files (and folders of slices) that are no volumes, each in its own way.
fn hostile(folder: &Path) -> usize {
    let zeros = gzip(&vec![0; 1 << 26]);
    // Members one after the other: four gibibytes of zeros in a few hundred kilobytes.
    let bomb = zeros.repeat(64);
    let nrrd = |fields: &str, data: &[u8]| {
        [format!("NRRD0004\ntype: uchar\ndimension: 3\n{fields}\n\n").as_bytes(), data].concat()
    };
    let mha =
        |fields: &str, data: &[u8]| [format!("ObjectType = Image\nNDims = 3\n{fields}\n").as_bytes(), data].concat();
    let page = [
        (256, 4, 1, 1_000_000),
        (257, 4, 1, 1_000_000),
        (258, 3, 1, 8),
        (262, 3, 1, 1),
        (273, 4, 1, 8),
        (279, 4, 1, 9),
    ];
    let files: Vec<(&str, Vec<u8>)> = vec![
        ("empty.npy", Vec::new()),
        ("magic.npy", b"\x93NUMPY".to_vec()),
        ("huge.npy", array("|u1", "(100000, 100000, 100000)", &[0; 64])),
        ("overflow.npy", array("|u1", "(9223372036854775807, 9223372036854775807, 3)", &[0; 64])),
        ("nan.npy", array("<f4", "(3, 3, 3)", &[0xff; 108])),
        ("object.npy", array("|O", "(3, 3, 3)", &[0; 27])),
        ("flat.npy", array("|u1", "(2, 9, 9)", &[0; 162])),
        ("short.npy", array("|u1", "(30, 30, 30)", &[0; 26_999])),
        ("brackets.npy", npy(&"(".repeat(60_000), &[])),
        ("negative.npy", array("|u1", "(-3, 3, 3)", &[0; 27])),
        ("long.npy", [&b"\x93NUMPY\x02\x00"[..], &u32::MAX.to_le_bytes(), b"{}"].concat()),
        ("text.npy", b"these are only words".to_vec()),
        ("none.npz", zip("readme.npy.txt", b"words")),
        ("lies.npz", zip("a.npy", &array("|u1", "(60000, 60000, 60000)", &[0; 27]))),
        ("torn.npz", zip("a.npy", &array("|u1", "(3, 3, 3)", &[0; 27]))[..60].to_vec()),
        ("outside.nhdr", nrrd("sizes: 3 3 3\nencoding: raw\ndata file: ../../../etc/passwd", b"")),
        ("missing.nhdr", nrrd("sizes: 3 3 3\nencoding: raw\ndata file: none.raw", b"")),
        ("lies.nrrd", nrrd("sizes: 99999 99999 99999\nencoding: raw", b"")),
        ("encoding.nrrd", nrrd("sizes: 3 3 3\nencoding: rot13", &[0; 27])),
        ("bomb.nrrd", nrrd("sizes: 1500 1500 1500\nencoding: gzip", &bomb)),
        ("letters.nrrd", nrrd("sizes: 3 3 3\nencoding: text", b"one two three")),
        ("absolute.mhd", mha("DimSize = 3 3 3\nElementType = MET_UCHAR\nElementDataFile = /etc/passwd", b"")),
        ("negative.mha", mha("DimSize = -3 3 3\nElementType = MET_UCHAR\nElementDataFile = LOCAL", &[0; 27])),
        ("short.mha", mha("DimSize = 9 9 9\nElementType = MET_UCHAR\nElementDataFile = LOCAL", &[0; 27])),
        (
            "huge.mha",
            mha("DimSize = 4000000000 4000000000 4000000000\nElementType = MET_DOUBLE\nElementDataFile = LOCAL", b""),
        ),
        ("cut.nii", nifti(|_| ())[..200].to_vec()),
        ("long.nii", nifti(set(42, b"\xff\x7f\xff\x7f\xff\x7f"))),
        ("type.nii", nifti(set(70, b"\x01\0"))),
        ("series.nii", nifti(set(40, b"\x04\0\x04\0\x04\0\x04\0\x09\0"))),
        ("torn.nii.gz", gzip(&nifti(|_| ()))[..40].to_vec()),
        ("bomb.nii.gz", [gzip(&nifti(set(42, b"\xdc\x05\xdc\x05\xdc\x05"))), bomb].concat()),
        ("offset.nii", nifti(set(108, b"\x00\x00\x80\x7f"))),
        ("empty.tif", Vec::new()),
        ("loop.tif", tiff(&page, 8)),
        ("header.tif", b"II*\0\x08\0\0\0".to_vec()),
        ("huge.tif", tiff(&page, 0)),
        ("start.vox", b"VOX ".to_vec()),
        ("lies.vox", vox(b"SIZE\xff\xff\xff\xff", 4_000_000_000)),
        ("size.vox", vox(&[&b"SIZE\x0c\0\0\0\0\0\0\0"[..], &[0xff; 12]].concat(), 24)),
    ];
    for (name, bytes) in &files {
        fs::write(folder.join(name), bytes).unwrap();
    }
    let slices = folder.join("slices");
    fs::create_dir(&slices).unwrap();
    for n in 0..3 {
        fs::write(slices.join(format!("s{n}.png")), b"\x89PNG\r\n\x1a\nand then nothing").unwrap();
    }
    files.len() + 1
}

#[test]
fn hostile_files_are_refused_within_a_gibibyte_of_memory() {
    let folder = tempfile::tempdir().unwrap();
    let scans = folder.path().join("scans");
    fs::create_dir(&scans).unwrap();
    let bad = hostile(&scans);
    assert_eq!(bad, 40);
    for n in 1..=3 {
        write_npy(&scans.join(format!("good{n}.npy")), &volume(n, 16));
    }
    let program = assert_cmd::cargo::cargo_bin("hlacdb");
    let store = folder.path().join("t.hlacdb");
    let ingest = ["--json", "-s", store.to_str().unwrap(), "ingest", scans.to_str().unwrap(), "--jobs", "2"];
    // The whole address space is held to a gibibyte, so that peak memory is less than that, whatever is touched of it.
    let mut command = match cfg!(target_os = "linux") {
        true => {
            let mut shell = Command::new("sh");
            shell.args(["-c", "ulimit -v 1048576 && exec \"$0\" \"$@\""]).arg(program);
            shell
        }
        false => Command::new(program),
    };
    command.env("RAYON_NUM_THREADS", "2").env("MALLOC_ARENA_MAX", "2").args(ingest);
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let failed = report["failed"].as_array().unwrap();
    let named: Vec<&str> = failed.iter().map(|failure| failure["path"].as_str().unwrap()).collect();
    assert_eq!((report["added"].as_u64(), failed.len()), (Some(3), bad), "{named:?}");
    for failure in failed {
        let (path, error) = (failure["path"].as_str().unwrap(), failure["error"].as_str().unwrap());
        assert!(error.starts_with(path) && !error.contains('\n') && error.len() < 700, "{path}: {error}");
        eprintln!("{}", &error[scans.to_str().unwrap().len() + 1..]);
    }
}
