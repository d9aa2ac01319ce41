//! Slabs and boxes are parts of the whole volume: for every fixture, and for random boxes.

use std::fs;
use std::path::Path;

use hlacdb_volume::formats::Access;
use hlacdb_volume::{
    Endian, Intensity, RawLayout, ReadError, ReadOptions, SampleType, SlabReader, Volume, VolumeError, VolumeFile,
    VolumeSource, read,
};
use proptest::prelude::*;
use proptest::sample::Index;

use crate::support::{Folder, all_fixtures, fixtures};

const RULES: [Intensity; 4] =
    [Intensity::Full, Intensity::Auto, Intensity::NonZero, Intensity::Window { lo: -900.0, hi: 3000.0 }];

fn options(intensity: Intensity) -> ReadOptions {
    ReadOptions::new().intensity(intensity).raw(RawLayout::new([5, 7, 9], SampleType::U8, Endian::Little))
}

/// The volume out of slabs; `None` if the file is only read whole.
fn joined(path: &Path, options: &ReadOptions, planes: usize) -> Result<Option<(Volume, VolumeSource)>, ReadError> {
    let Some(mut reader) = SlabReader::open(path, options)? else { return Ok(None) };
    let mut voxels = Vec::new();
    while let Some(slab) = reader.read(planes)? {
        voxels.extend_from_slice(slab.voxels);
    }
    let volume = Volume::new(reader.shape(), reader.channels(), voxels).unwrap();
    Ok(Some((volume, reader.source())))
}

#[test]
fn slabs_are_the_whole_for_every_fixture() {
    let (mut in_slabs, mut refused) = (0, 0);
    for path in all_fixtures() {
        for intensity in RULES {
            let options = options(intensity);
            let whole = read(&path, &options);
            for planes in [1, 2, 9] {
                match (joined(&path, &options, planes), &whole) {
                    (Ok(None), _) => {}
                    (Ok(Some(found)), Ok(expected)) => {
                        assert!(found == *expected, "{} under {intensity} by {planes}", path.display());
                        in_slabs += 1;
                    }
                    (Err(found), Err(expected)) => {
                        assert_eq!(found.to_string(), expected.to_string(), "{intensity} by {planes}");
                        refused += 1;
                    }
                    (found, expected) => panic!("{}: {found:?}, whole {expected:?}", path.display()),
                }
            }
        }
    }
    assert!(in_slabs > 12 * 85 && refused > 12, "{in_slabs} in slabs, {refused} refused");
}

#[test]
fn files_whose_planes_are_not_in_order_have_no_slabs() {
    let access = |name: &str| {
        let path = all_fixtures().into_iter().find(|path| path.ends_with(name)).unwrap();
        VolumeFile::open(&path, &ReadOptions::new()).unwrap().access()
    };
    for name in ["u8_fortran.npy", "rgb_pynrrd_planar.nrrd"] {
        assert_eq!(access(name), Access::Whole, "{name}");
    }
    for name in ["u8.npy", "u8_squeezed.npy", "u8_stored.npz", "tiles.tif", "png16"] {
        assert_eq!(access(name), Access::Direct, "{name}");
    }
    for name in ["deep_sitk_packed.mhd", "deep_nifti1_gz.nii.gz", "u8_deflated.npz", "deep_pynrrd_ascii.nrrd"] {
        assert_eq!(access(name), Access::Sequential, "{name}");
    }
}

/// Truth values, which become 0 and 255.
#[test]
fn truth_values_come_in_slabs() {
    let folder = Folder::new();
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(format!("{:<117}\n", "{'descr': '|b1', 'fortran_order': False, 'shape': (4, 3, 5), }").bytes());
    bytes.extend((0..60).map(|index| u8::from(index % 7 == 0)));
    let path = folder.write("truth.npy", bytes);
    let (volume, source) = joined(&path, &ReadOptions::new(), 3).unwrap().unwrap();
    assert!((volume.clone(), source) == read(&path, &ReadOptions::new()).unwrap());
    assert_eq!(volume.voxels()[..8], [255, 0, 0, 0, 0, 0, 0, 255]);
}

/// A box by the places of its corners.
fn block(shape: [usize; 3], corners: [Index; 6]) -> ([usize; 3], [usize; 3]) {
    let side = |axis: usize| {
        let length = 3 + corners[axis].index(shape[axis] - 2);
        (corners[axis + 3].index(shape[axis] - length + 1), length)
    };
    let sides = [side(0), side(1), side(2)];
    (sides.map(|(origin, _)| origin), sides.map(|(_, length)| length))
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(24))]

    /// Random boxes of every fixture, several of one open file, so that reading goes back as well as on.
    #[test]
    fn boxes_are_those_of_the_whole_for_every_fixture(
        corners in prop::collection::vec(prop::array::uniform6(any::<Index>()), 3),
        rule in 0..RULES.len(),
    ) {
        let (options, mut boxes) = (options(RULES[rule]), 0);
        for path in all_fixtures() {
            let Ok((whole, source)) = read(&path, &options) else { continue };
            let mut file = VolumeFile::open(&path, &options).unwrap();
            for &corners in &corners {
                let (origin, shape) = block(whole.shape(), corners);
                let found = file.read_block(origin, shape).unwrap_or_else(|error| panic!("{error}"));
                let expected = whole.block(origin, shape).unwrap();
                prop_assert!(found == expected, "{} {origin:?} {shape:?}", path.display());
                boxes += 1;
            }
            prop_assert_eq!(file.source(), source);
        }
        prop_assert!(boxes > 300, "{} boxes", boxes);
    }

    /// The same in volumes larger than a read: every order of axes that an array can have.
    #[test]
    fn boxes_of_larger_arrays_are_those_of_the_whole(
        fortran in any::<bool>(),
        compressed in any::<bool>(),
        corners in prop::collection::vec(prop::array::uniform6(any::<Index>()), 3),
    ) {
        let (folder, shape) = (Folder::new(), [40, 90, 70]);
        let name = if fortran { "True" } else { "False" };
        let header = format!("{{'descr': '<u2', 'fortran_order': {name}, 'shape': (40, 90, 70), }}\n");
        let mut bytes = [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes()].concat();
        bytes.extend((0..shape.iter().product::<usize>() as u32).flat_map(|i| (i.wrapping_mul(40_503) as u16).to_le_bytes()));
        let path = if compressed {
            let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
            zip.start_file("a.npy", zip::write::SimpleFileOptions::default()).unwrap();
            std::io::Write::write_all(&mut zip, &bytes).unwrap();
            folder.write("a.npz", zip.finish().unwrap().into_inner())
        } else {
            folder.write("a.npy", bytes)
        };
        let (whole, _) = read(&path, &ReadOptions::new()).unwrap();
        let mut file = VolumeFile::open(&path, &ReadOptions::new()).unwrap();
        for corners in corners {
            let (origin, shape) = block(shape, corners);
            prop_assert!(file.read_block(origin, shape).unwrap() == whole.block(origin, shape).unwrap());
        }
    }
}

#[test]
fn boxes_outside_and_too_small_ones_are_refused() {
    let mut file = VolumeFile::open(&fixtures().join("volumes/u8.npy"), &ReadOptions::new()).unwrap();
    for (origin, shape) in [([3, 0, 0], [3, 3, 3]), ([0, 0, 7], [3, 3, 3]), ([usize::MAX, 0, 0], [3, 3, 3])] {
        let error = file.read_block(origin, shape).unwrap_err();
        assert!(matches!(error.error, VolumeError::OutsideVolume { volume: [5, 7, 9], .. }), "{error}");
    }
    let error = file.read_block([0, 0, 0], [5, 2, 9]).unwrap_err();
    assert!(matches!(error.error, VolumeError::TooSmall { shape: [5, 2, 9] }), "{error}");
    assert!(error.to_string().contains("read as NumPy array"), "{error}");
}

/// A box of an uncompressed file reads only what it needs: the rest of the file may be gone.
#[test]
fn a_box_does_not_need_the_whole_file() {
    let folder = Folder::new();
    let path = folder.write("a.raw", vec![7; 100 * 50 * 50]);
    let layout = RawLayout::new([100, 50, 50], SampleType::U8, Endian::Little);
    let mut file = VolumeFile::open(&path, &ReadOptions::new().raw(layout)).unwrap();
    fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(20 * 50 * 50).unwrap();
    assert!(file.read_block([10, 40, 40], [10, 10, 10]).is_ok());
    let error = file.read_block([15, 40, 40], [10, 10, 10]).unwrap_err();
    assert!(matches!(error.error, VolumeError::Truncated { expected: 250_000, .. }), "{error}");
}

/// A sample that is not finite is reported by its place in the volume, by the box that holds it.
#[test]
fn a_bad_sample_of_a_box_is_named_by_its_voxel() {
    let folder = Folder::new();
    let mut values = vec![1.0_f32; 6 * 7 * 8];
    values[(4 * 7 + 5) * 8 + 6] = f32::NAN;
    let path = folder.write("a.raw", values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>());
    let layout = RawLayout::new([6, 7, 8], SampleType::F32, Endian::Little);
    for (intensity, first) in [(Intensity::Window { lo: 0.0, hi: 1.0 }, true), (Intensity::Full, false)] {
        let options = ReadOptions::new().raw(layout).intensity(intensity);
        let mut file = VolumeFile::open(&path, &options).unwrap();
        assert_eq!(file.read_block([0, 0, 0], [3, 3, 3]).is_ok(), first, "{intensity}");
        let error = file.read_block([3, 4, 5], [3, 3, 3]).unwrap_err();
        assert!(matches!(error.error, VolumeError::NotFinite { position: [4, 5, 6], .. }), "{error}");
    }
}
