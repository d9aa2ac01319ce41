//! Files of other programs yield the same voxels: fixtures of one volume in many formats, which `make.py` beside them wrote
//! with numpy, nibabel, pynrrd and SimpleITK, and real volumes.

use std::path::{Path, PathBuf};

use hlacdb_volume::{Endian, Intensity, RawLayout, ReadOptions, SampleType, Volume, VolumeError, VolumeSource};

use hlacdb_testing::data;

use crate::support::entries;

fn fixtures() -> PathBuf {
    crate::support::fixtures().join("volumes")
}

fn read(path: &Path, options: &ReadOptions) -> (Volume, VolumeSource) {
    hlacdb_volume::read(path, options).unwrap_or_else(|error| panic!("{error}"))
}

fn fixture(name: &str) -> (Volume, VolumeSource) {
    read(&fixtures().join(name), &ReadOptions::new())
}

/// Excludes files that are not a volume by themselves: data of headers, raw samples, an archive of two volumes, the script.
fn is_volume(path: &Path) -> bool {
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    let no_volume = [".raw", ".raw.gz", ".zraw", ".py", "several.npz"];
    !no_volume.iter().any(|ending| name.ends_with(ending))
}

#[test]
fn every_writer_and_format_yields_the_same_voxels() {
    let mut files = entries("volumes");
    files.retain(|path| is_volume(path));
    assert!(files.len() > 50, "the fixtures are there");
    let rules = [Intensity::Full, Intensity::Auto];
    for path in &files {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let same_as = ["u8", "deep", "rgb"].into_iter().find(|start| name.starts_with(start)).unwrap();
        for intensity in rules {
            let options = ReadOptions::new().intensity(intensity);
            let (expected, _) = read(&fixtures().join(format!("{same_as}.npy")), &options);
            let (found, source) = read(path, &options);
            assert!(found == expected, "{} under {intensity} is not {same_as}", path.display());
            assert_eq!(source.mapping.is_some(), same_as == "deep", "{}", path.display());
        }
    }
}

#[test]
fn the_array_is_what_numpy_wrote() {
    let expected = Volume::from_fn([5, 7, 9], |z, y, x| ((z * 49 + y * 17 + x * 5 + z * y * x) % 256) as u8).unwrap();
    assert_eq!(fixture("u8.npy").0, expected);
    let (deep, source) = fixture("deep.npy");
    assert_eq!((deep.shape(), source.samples), ([5, 7, 9], SampleType::I16));
    let sample = |z, y, x| f64::from(expected.voxels()[(z * 7 + y) * 9 + x]) * 97.0 - 4000.0 + x as f64;
    let mapping = source.mapping.unwrap();
    for (z, y, x) in [(0, 0, 0), (4, 6, 8), (1, 2, 3), (3, 0, 7)] {
        let level = 255.0 * (sample(z, y, x) - mapping.lo) / (mapping.hi - mapping.lo);
        assert_eq!(f64::from(deep.voxels()[(z * 7 + y) * 9 + x]), level.round());
    }
}

#[test]
fn format_samples_and_spacing_are_reported() {
    for (name, format, samples) in [
        ("deep_i8_be.npy", "npy", SampleType::I64),
        ("u8_deflated.npz", "npz", SampleType::U8),
        ("deep_sitk.nrrd", "nrrd", SampleType::I16),
        ("deep_sitk.mhd", "metaimage", SampleType::I16),
        ("deep_pair.img", "nifti", SampleType::I16),
    ] {
        let (_, source) = fixture(name);
        assert_eq!((source.format, source.samples), (format, samples), "{name}");
    }
    for name in ["u8_sitk.mha", "u8_sitk.nrrd", "u8_sitk.nii", "u8_nifti2.nii", "rgb_sitk.nrrd", "deep_analyze.img"] {
        assert_eq!(fixture(name).1.spacing.map(|spacing| spacing.zyx), Some([2.0, 0.75, 0.5]), "{name}");
    }
}

#[test]
fn a_window_is_in_the_units_of_the_file() {
    let (deep, scaled) = (fixtures().join("deep.npy"), fixtures().join("deep_scaled.nii"));
    let windowed = |path: &Path, lo, hi| read(path, &ReadOptions::new().intensity(Intensity::Window { lo, hi })).0;
    // Its header says: a quarter of the stored sample, plus 100.
    assert_eq!(windowed(&deep, -1000.0, 3000.0), windowed(&scaled, -150.0, 850.0));
    assert_ne!(windowed(&deep, -1000.0, 3000.0), windowed(&scaled, -1000.0, 3000.0));
}

#[test]
fn raw_samples_need_a_layout() {
    let layout = RawLayout::new([5, 7, 9], SampleType::U8, Endian::Little);
    let options = ReadOptions::new().raw(layout);
    let (bare, source) = read(&fixtures().join("u8_bare.raw"), &options);
    assert_eq!((bare, source.format), (fixture("u8.npy").0, "raw"));
    // A layout does not apply to files that are recognised.
    assert_eq!(read(&fixtures().join("deep_sitk.mha"), &options).1.format, "metaimage");

    let layout = RawLayout { samples: SampleType::I16, endian: Endian::Big, offset: 13, ..layout };
    let options = ReadOptions::new().raw(layout);
    assert_eq!(read(&fixtures().join("deep_bare_offset.raw"), &options).0, fixture("deep.npy").0);

    let unknown = hlacdb_volume::read(&fixtures().join("u8_bare.raw"), &ReadOptions::new()).unwrap_err();
    assert!(matches!(unknown.error, VolumeError::UnknownFormat { .. }), "{unknown}");
}

#[test]
fn an_archive_of_two_volumes_is_refused_by_their_names() {
    let error = hlacdb_volume::read(&fixtures().join("several.npz"), &ReadOptions::new()).unwrap_err().to_string();
    assert!(error.contains("an archive of 2 arrays that could be a volume"), "{error}");
    assert!(error.contains("u8 of shape [5, 7, 9]") && error.contains("deep of shape [5, 7, 9]"), "{error}");
}

/// A sum that depends on every voxel and its place.
fn placed_sum(volume: &Volume) -> u64 {
    volume.voxels().iter().zip(0_u64..).map(|(&voxel, place)| u64::from(voxel) * (place % 65_521 + 1)).sum()
}

/// The last two columns are computed by numpy from the same files, read with nibabel and pynrrd: the placed sums of the
/// levels under `full` and `auto`.
#[test]
fn real_volumes_are_what_numpy_computes_from_other_readers() {
    let raw = RawLayout::new([64; 3], SampleType::U32, Endian::Little).offset(24);
    for (name, shape, samples, full, auto) in [
        ("iguana_ct.nii.gz", [179, 256, 210], SampleType::U8, 10_390_073_839_217, 10_390_073_839_217),
        ("head_mr_gd.nii.gz", [144, 188, 176], SampleType::U8, 3_758_541_219_715, 3_758_541_219_715),
        ("brain1_image.nrrd", [25, 256, 256], SampleType::I16, 1_725_610_143_110, 2_561_132_006_100),
        ("brain1_label.nrrd", [25, 256, 256], SampleType::I32, 29_148_945_960, 29_148_945_960),
        ("sandstone_generated_f32.npy", [64; 3], SampleType::F32, 1_120_010_355_062, 1_145_672_298_455),
        ("blue_noise_64_u32.raw", [64; 3], SampleType::U32, 1_094_317_223_218, 1_094_309_038_951),
    ] {
        let Some(path) = data(name) else { continue };
        for (intensity, expected) in [(Intensity::Full, full), (Intensity::Auto, auto)] {
            let options = ReadOptions::new().intensity(intensity).raw(raw);
            let (volume, source) = read(&path, &options);
            assert_eq!((volume.shape(), volume.channels(), source.samples), (shape, 1, samples), "{name}");
            assert_eq!(placed_sum(&volume), expected, "{name} under {intensity}");
        }
    }
}
