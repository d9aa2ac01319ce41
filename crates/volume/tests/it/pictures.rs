//! Volumes from pictures by tifffile, Pillow and MagicaVoxel, and the volumes of folders.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;

use hlacdb_volume::{Intensity, ReadOptions, SampleType, Volume, VolumeSource, discover, read};

use hlacdb_testing::data;

use crate::support::{assert_bounded, chain, fixtures};

/// A fixture; all are written by `make.py` beside them.
fn fixture(name: &str) -> PathBuf {
    fixtures().join("pictures").join(name)
}

fn read_window(name: &str, lo: f64, hi: f64) -> (Volume, VolumeSource) {
    let options = ReadOptions::new().intensity(Intensity::Window { lo, hi });
    read(&fixture(name), &options).unwrap_or_else(|error| panic!("{}", chain(&error)))
}

/// The voxels that all fixtures hold.
fn value(z: usize, y: usize, x: usize) -> u8 {
    ((z * 63 + y * 9 + x) % 251) as u8
}

fn expected() -> Volume {
    Volume::from_fn([5, 7, 9], value).unwrap()
}

fn expected_colours() -> Volume {
    let colours = expected().voxels().iter().flat_map(|&v| [v, 255 - v, v / 2]).collect();
    Volume::new([5, 7, 9], 3, colours).unwrap()
}

#[test]
fn every_compression_of_a_tiff_yields_the_same_voxels() {
    let names = "plain big_endian bigtiff bigtiff_big_endian strips tiles deflate deflate_predictor deflate_tiles lzw \
                 lzw_strips packbits white_is_zero thumbnail";
    for name in names.split_whitespace() {
        let (volume, source) = read_window(&format!("{name}.tif"), 0.0, 255.0);
        assert_eq!(volume, expected(), "{name}");
        assert_eq!((source.format, source.samples, source.mapping), ("tiff", SampleType::U8, None), "{name}");
        assert_eq!(source.spacing, None, "{name}");
    }
}

#[test]
fn every_sample_type_yields_the_same_voxels() {
    for (names, lo, hi) in [
        ("u2 u4 u8 u2_big_endian_lzw u2_white_is_zero", 0.0, 255.0),
        ("i2 i4 i8", -100.0, 155.0),
        ("f2 f4 f8 f4_predictor f4_predictor_tiles", 0.0, 255.0 / 4.0),
    ] {
        for name in names.split_whitespace() {
            let (volume, source) = read_window(&format!("{name}.tif"), lo, hi);
            assert_eq!(volume, expected(), "{name}");
            assert_eq!(source.mapping.map(|mapping| (mapping.lo, mapping.hi)), Some((lo, hi)), "{name}");
            let size = name[1..2].parse::<usize>().unwrap();
            assert!(source.samples.size() == size && source.samples.name().starts_with(&name[..1]), "{name}");
        }
    }
    let clipped = Volume::from_fn([5, 7, 9], |z, y, x| value(z, y, x).min(227)).unwrap();
    assert_eq!(read_window("i1.tif", -100.0, 155.0).0, clipped);
    let bits = Volume::from_fn([5, 7, 9], |z, y, x| value(z, y, x) % 2 * 255).unwrap();
    assert_eq!(read_window("bits.tif", 0.0, 1.0).0, bits);
}

#[test]
fn colour_pages_keep_their_colours() {
    for name in ["rgb.tif", "rgb_planes.tif", "rgb_u2.tif", "rgba.tif", "ome_colour.tif"] {
        assert_eq!(read_window(name, 0.0, 255.0).0, expected_colours(), "{name}");
    }
}

#[test]
fn stacks_of_imagej_and_microscopes_have_a_spacing() {
    for (name, samples) in [
        ("imagej.tif", SampleType::U8),
        ("imagej_one_directory_u1.tif", SampleType::U8),
        ("imagej_one_directory_u2.tif", SampleType::U16),
        ("imagej_one_directory_f4.tif", SampleType::F32),
        ("ome.tif", SampleType::U8),
    ] {
        let (volume, source) = read_window(name, 0.0, 255.0);
        assert_eq!(volume, expected(), "{name}");
        let spacing = source.spacing.map(|spacing| (spacing.zyx, spacing.unit.map(|unit| unit.symbol())));
        assert_eq!((source.samples, spacing), (samples, Some(([3.0, 0.25, 0.5], Some("um")))), "{name}");
    }
}

#[test]
fn folders_of_slices_are_volumes_in_natural_order() {
    for (name, hi, kind, volume) in [
        ("png", 255.0, SampleType::U8, expected()),
        ("png16", 65535.0, SampleType::U16, expected()),
        ("tiff_slices", 255.0, SampleType::U8, expected()),
        ("png_rgb", 255.0, SampleType::U8, expected_colours()),
        ("png_palette", 255.0, SampleType::U8, expected_colours()),
        ("jpeg_grey", 255.0, SampleType::U8, Volume::from_fn([5, 16, 16], |z, _, _| 8 * z as u8 + 40).unwrap()),
    ] {
        let (read, source) = read_window(name, 0.0, hi);
        assert_eq!(read, volume, "{name}");
        assert_eq!((source.format, source.samples, source.mapping.is_some()), ("slices", kind, hi > 255.0), "{name}");
    }
}

/// The error of a file and its causes.
fn refusal(path: &Path, options: &ReadOptions) -> String {
    chain(&read(path, options).expect_err(&path.display().to_string()))
}

#[test]
fn what_is_not_read_is_named() {
    for (name, word) in [
        ("palette.tif", "palette"),
        ("jpeg.tif", "JPEG"),
        ("single.tif", "2 axes [7, 9]"),
        ("sizes.tif", "page 3 of the TIFF file has 7 x 8 pixels of grey u8"),
        ("hyperstack.tif", "2 channels"),
        ("ome_channels.tif", "2 channels"),
    ] {
        let text = refusal(&fixture(name), &ReadOptions::new());
        assert!(text.contains(word), "{name}: {text}");
    }
    let few = ReadOptions::new().max_voxels(314);
    for name in ["plain.tif", "lzw.tif", "imagej_one_directory_u1.tif", "png", "tiff_slices"] {
        let text = refusal(&fixture(name), &few);
        assert!(text.contains("315 voxels, more than the limit of 314"), "{name}: {text}");
    }
}

#[test]
fn damaged_slices_and_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["s8", "s9", "s10"] {
        fs::copy(fixture(&format!("png/{name}.png")), folder.path().join(format!("{name}.png"))).unwrap();
    }
    let options = ReadOptions::new();
    assert_eq!(read(folder.path(), &options).unwrap().0.shape(), [3, 7, 9]);

    fs::copy(fixture("png16/s11.png"), folder.path().join("s11.png")).unwrap();
    let text = refusal(folder.path(), &options);
    assert!(text.contains("s11.png has 7 x 9 pixels of grey u16") && text.contains("s8.png"), "{text}");

    let whole = fs::read(fixture("png/s11.png")).unwrap();
    fs::write(folder.path().join("s11.png"), &whole[..whole.len() / 2]).unwrap();
    assert!(refusal(folder.path(), &options).contains("the slice s11.png"));

    // A picture that promises 4 billion pixels in 70 bytes.
    let mut bomb = whole.clone();
    bomb[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0xff, 0xff]);
    let sum = crc(&bomb[12..29]);
    bomb[29..33].copy_from_slice(&sum.to_be_bytes());
    fs::write(folder.path().join("s1.png"), bomb).unwrap();
    let text = refusal(folder.path(), &options.max_voxels(u64::MAX));
    assert!(text.contains("the slice s1.png") && text.contains("the data ends after"), "{text}");

    for file in ["s1.png", "s8.png", "s9.png"] {
        fs::remove_file(folder.path().join(file)).unwrap();
    }
    assert!(refusal(folder.path(), &options).contains("the folder holds 2 slices"));

    let half = folder.path().join("half.tif");
    for name in ["plain.tif", "deflate.tif", "tiles.tif", "imagej_one_directory_u2.tif"] {
        let whole = fs::read(fixture(name)).unwrap();
        fs::write(&half, &whole[..whole.len() * 2 / 3]).unwrap();
        assert!(refusal(&half, &options).contains("half.tif"), "{name}");
    }
}

/// The checksum of a PNG chunk.
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    })
}

/// What is found in a folder, relative to it; errors as `!path`.
fn found(folder: &Path, raw: bool) -> Vec<String> {
    let relative = |path: &Path| path.strip_prefix(folder).unwrap_or(path).display().to_string().replace('\\', "/");
    discover(folder, raw)
        .map(|item| match item {
            Ok(path) => relative(&path),
            Err(error) => format!("!{}", relative(&error.path)),
        })
        .collect()
}

fn touch(folder: &Path, name: &str) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, b"").unwrap();
}

#[test]
fn discovery_is_in_natural_order() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let names = "s10.npy s9.npy B.NII.GZ a.vox notes.txt .hidden.npy .git/x.npy scan.mhd scan.raw lone.raw head.hdr \
                 head.img deep/er/x.nrrd two/1.png two/2.png two/vol.npz";
    for name in names.split_whitespace() {
        touch(at, name);
    }
    fs::create_dir(at.join("stack")).unwrap();
    for (name, slice) in [("stack/1.png", "png/s8.png"), ("stack/2.PNG", "png/s9.png"), ("stack/3.png", "png/s10.png")]
    {
        fs::copy(fixture(slice), at.join(name)).unwrap();
    }
    touch(at, "stack/inner/y.mha");
    touch(at, "stack/also.npy");
    let expected = "B.NII.GZ a.vox deep/er/x.nrrd head.hdr s9.npy s10.npy scan.mhd stack stack/also.npy stack/inner/y.mha two/vol.npz";
    assert_eq!(found(at, false), expected.split_whitespace().collect::<Vec<_>>());
    // The samples of scan.mhd and head.hdr have their headers.
    let expected = expected.replace(" s9", " lone.raw s9");
    assert_eq!(found(at, true), expected.split_whitespace().collect::<Vec<_>>());

    assert_eq!(found(&at.join("stack"), false), ["", "also.npy", "inner/y.mha"]);
    assert_eq!(found(&at.join("notes.txt"), false), [""]);
    let missing = at.join("missing");
    assert_eq!(found(&missing, false), ["!"]);
    let error = discover(&missing, false).next().unwrap().unwrap_err();
    assert!(error.to_string().contains("missing"));
}

#[test]
fn tiff_files_are_slices_only_where_all_have_one_page() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["s8.tif", "s9.tif", "s10.tif"] {
        fs::copy(fixture(&format!("tiff_slices/{name}")), folder.path().join(name)).unwrap();
    }
    assert_eq!(found(folder.path(), false), [""]);
    fs::copy(fixture("plain.tif"), folder.path().join("whole.tif")).unwrap();
    assert_eq!(found(folder.path(), false), ["s8.tif", "s9.tif", "s10.tif", "whole.tif"]);
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_loops_reported_once() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::fs::symlink;

    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    touch(at, "a/1.npy");
    touch(at, "z.npy");
    symlink(at, at.join("a/loop")).unwrap();
    symlink(at.join("nowhere"), at.join("dangling.npy")).unwrap();
    symlink(at.join("z.npy"), at.join("again.npy")).unwrap();
    symlink(at.join("nowhere"), at.join(".#lock")).unwrap();
    assert_eq!(found(at, false), ["a/1.npy", "!a/loop", "again.npy", "!dangling.npy", "z.npy"]);
    let error = discover(at, false).find_map(Result::err).unwrap();
    assert!(error.to_string().contains("leads back"), "{error}");

    let odd = at.join(OsStr::from_bytes(b"b\xff.npy"));
    fs::write(&odd, b"").unwrap();
    assert!(discover(at, false).any(|item| item.is_ok_and(|path| path == odd)));
}

#[test]
fn the_ketton_scan_is_read() {
    let Some(path) = data("ketton_microct.tif") else { return };
    let (volume, source) = read(&path, &ReadOptions::new()).unwrap();
    assert_eq!((volume.shape(), volume.channels(), source.format), ([256, 256, 256], 1, "tiff"));
    assert!(volume.voxels().iter().all(|&voxel| voxel == 0 || voxel == 255));
    // Counted with tifffile.
    assert_eq!(volume.voxels().iter().filter(|&&voxel| voxel == 255).count(), 14_648_824);
}

#[test]
fn the_saucer_is_read_in_colour() {
    let Some(path) = data("saucer.vox") else { return };
    let (volume, source) = read(&path, &ReadOptions::new()).unwrap();
    assert_eq!((volume.channels(), source.format, source.mapping), (3, "vox", None));
    let filled = volume.voxels().as_chunks::<3>().0.iter().filter(|&&colour| colour != [0; 3]).count();
    // Counted in Python: the model is 48 wide, 48 deep and 18 high.
    assert_eq!((volume.shape(), filled), ([18, 48, 48], 34_392));
}

/// The fixtures that are files, and one slice of every folder.
fn all_files() -> Vec<PathBuf> {
    let entries = |folder: &Path| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    let mut files: Vec<PathBuf> = entries(&fixture(""))
        .into_iter()
        .flat_map(|path| if path.is_dir() { entries(&path).into_iter().take(1).collect() } else { vec![path] })
        .filter(|path| path.extension().is_some_and(|ending| ending != "py"))
        .collect();
    files.sort();
    files
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(400))]

    /// A damaged file is read or refused, by itself and as one of three slices.
    #[test]
    fn damaged_pictures_never_panic(
        file in prop::sample::select(all_files()),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let whole = fs::read(&file).unwrap();
        let mut bytes = whole.clone();
        for (place, byte) in changes {
            // Most of what can go wrong is near the beginning.
            let place = place.index(bytes.len().min(400));
            bytes[place] = byte;
        }
        bytes.truncate(cut.map_or(bytes.len(), |cut| cut.index(bytes.len())));
        let folder = tempfile::tempdir().unwrap();
        let damaged = folder.path().join("2").with_extension(file.extension().unwrap());
        fs::write(&damaged, &bytes).unwrap();
        for other in ["1", "3"] {
            fs::write(folder.path().join(other).with_extension(file.extension().unwrap()), &whole).unwrap();
        }
        let options = ReadOptions::new().max_voxels(1 << 22);
        for path in [damaged.as_path(), folder.path()] {
            if let Err(error) = read(path, &options) {
                assert_bounded(&error);
            }
        }
        prop_assert!(discover(folder.path(), false).all(|item| item.is_ok()));
    }
}
