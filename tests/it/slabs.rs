//! Volumes larger than memory: slab by slab a file gives what it gives whole, and `extract` lets nobody see the difference.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use hlacdb::hlac::{Extraction, MASKS, MaskSpacing, SlabExtractor, Voxels};
use hlacdb::volume::{Intensity, ReadOptions, SlabReader, Volume, read};
use serde_json::Value;

use crate::support::{stripes, write_npy};

/// The readers are tested in their own package; here their slabs go into the extractor.
#[test]
fn slabs_of_files_have_the_sums_of_the_whole() {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/volume/tests/fixtures");
    for name in ["volumes/deep_nifti1_gz.nii.gz", "volumes/rgb_sitk.nrrd", "pictures/tiles.tif", "pictures/png16"] {
        let (path, options) = (fixtures.join(name), ReadOptions::new().intensity(Intensity::Auto));
        let (volume, _) = read(&path, &options).unwrap();
        for planes in [1, 2, 9] {
            let mut reader = SlabReader::open(&path, &options).unwrap().unwrap();
            let mut extractor = SlabExtractor::new(reader.shape()).unwrap();
            while let Some(slab) = reader.read(planes).unwrap() {
                extractor.push(&slab.grey()).unwrap();
            }
            assert_eq!(extractor.finish().unwrap(), hlacdb::octant_sums(&volume), "{name} by {planes}");
        }
    }
}

fn run(arguments: &[&str]) -> Output {
    Command::cargo_bin("hlacdb").unwrap().args(arguments).output().unwrap()
}

/// The files that `extract` answers.
fn extract(arguments: &[&str]) -> Value {
    let output = run(&[&["--json", "extract"], arguments].concat());
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice::<Value>(&output.stdout).unwrap()["files"].clone()
}

/// What `extract` says on stderr about files that it refuses.
fn refused(status: i32, arguments: &[&str]) -> String {
    let output = run(&[&["extract"], arguments].concat());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

/// Answers without the time that they took.
fn timeless(mut files: Value) -> Value {
    for file in files.as_array_mut().unwrap() {
        assert!(file.as_object_mut().unwrap().remove("elapsed_us").is_some_and(|time| time.is_u64()));
    }
    files
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn numbers(value: &Value) -> Vec<u64> {
    value.as_array().unwrap().iter().map(|number| number.as_u64().unwrap()).collect()
}

/// A volume of 16-bit samples in a bare file, and the words that read it.
fn bare(folder: &Path) -> (PathBuf, [String; 6]) {
    let path = folder.join("bare.raw");
    let bytes: Vec<u8> = (0..20 * 21 * 22_u32).flat_map(|i| (i.wrapping_mul(40_503) as u16).to_be_bytes()).collect();
    fs::write(&path, bytes).unwrap();
    let words = ["--raw-shape", "20,21,22", "--raw-type", "u16be", "--intensity", "auto"].map(String::from);
    (path, words)
}

#[test]
fn the_program_answers_alike_with_little_memory() {
    let folder = tempfile::tempdir().unwrap();
    let (path, words) = bare(folder.path());
    let (region, colour) = (folder.path().join("region.npy"), folder.path().join("colour.npy"));
    write_npy(&region, &Volume::from_fn([20, 21, 22], |z, y, x| u8::from((z + y * x) % 5 != 0)).unwrap());
    let colours = (0..3 * 20 * 21 * 22).map(|index| (index * 37 % 251) as u8).collect();
    write_npy(&colour, &Volume::new([20, 21, 22], 3, colours).unwrap());
    let words: Vec<&str> = [text(&path), text(&colour)].into_iter().chain(words.iter().map(String::as_str)).collect();
    for options in [&[][..], &["--spacing", "2"], &["--region", text(&region), "--spacing", "4"]] {
        let whole = timeless(extract(&[&words, options].concat()));
        assert_eq!(whole.as_array().unwrap().len(), 2);
        for memory in ["0", "9000"] {
            let slabs = timeless(extract(&[&words, options, &["--slab-memory", memory]].concat()));
            assert_eq!(slabs, whole, "{options:?} in {memory}");
        }
    }
}

#[test]
fn spacing_and_region_are_those_of_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let (path, mask) = (folder.path().join("a.npy"), folder.path().join("labels.raw"));
    let volume = stripes(16, 3);
    write_npy(&path, &volume);
    // Labels of 32 bits, small and negative ones among large ones: all but 0 are inside.
    let label = |index: usize| [0_i32, 1, -1, 2_000_000_000, -5, 0, 7][index % 7];
    fs::write(&mask, (0..4096).flat_map(|index| label(index).to_le_bytes()).collect::<Vec<u8>>()).unwrap();
    let region = Volume::from_fn([16; 3], |z, y, x| u8::from(label((z * 16 + y) * 16 + x) != 0)).unwrap();
    let labels = ["--region", text(&mask), "--raw-shape", "16,16,16", "--raw-type", "i32"];
    for (spacing, word) in MaskSpacing::ALL.into_iter().zip(["1", "2", "4"]) {
        let extraction = Extraction::new().spacing(spacing);
        let all = &extract(&[text(&path), "--spacing", word])[0];
        let voxels = Voxels::new(volume.voxels(), volume.shape()).unwrap();
        let expected = extraction.sums(voxels).unwrap().total();
        assert_eq!(
            (numbers(&all["sums"]), all["windows"].as_u64()),
            (expected.values.to_vec(), Some(expected.windows))
        );
        assert!(all.get("counts").is_none());
        for memory in ["0", "1000000"] {
            let words = [&[text(&path), "--spacing", word, "--slab-memory", memory], &labels[..]].concat();
            let within = &extract(&words)[0];
            let expected =
                extraction.sums_in(voxels, Voxels::new(region.voxels(), region.shape()).unwrap()).unwrap().total();
            assert_eq!(numbers(&within["counts"]), expected.windows, "{word}");
            assert_eq!(numbers(&within["sums"]), expected.values, "{word}");
            for (moment, expected) in within["moments"].as_array().unwrap().iter().zip(expected.moments()) {
                assert!((moment.as_f64().unwrap() - expected).abs() < 1e-15, "{moment} is not {expected}");
            }
            assert_eq!(within["windows"], all["windows"]);
        }
    }
    let output = run(&[&["extract", text(&path), "--values"], &labels[..]].concat());
    let printed = String::from_utf8(output.stdout).unwrap();
    assert!(printed.contains("mask") && printed.contains("moment") && printed.lines().count() > MASKS.len());
}

#[test]
fn what_does_not_fit_is_told_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npy");
    write_npy(&path, &stripes(16, 3));
    let region = folder.path().join("region.npy");
    write_npy(&region, &stripes(15, 1));
    for memory in ["0", "1000000"] {
        let said = refused(1, &[text(&path), "--region", text(&region), "--slab-memory", memory]);
        assert!(said.contains("a.npy: the region is 15 x 15 x 15 (Z, Y, X), but the volume is 16"), "{said}");
        let small = folder.path().join("small.npy");
        write_npy(&small, &stripes(8, 1));
        let said = refused(1, &[text(&small), "--spacing", "4", "--slab-memory", memory]);
        assert!(said.contains("small.npy: the volume is 8 x 8 x 8") && said.contains("smaller --spacing"), "{said}");
    }
    assert!(refused(1, &[text(&path), "--region", "nowhere.npy"]).contains("nowhere.npy: opening the file failed"));
    for variant in ["sampled", "hit-sum"] {
        let said = refused(2, &[text(&path), "--variant", variant, "--spacing", "2"]);
        assert!(said.contains("--spacing and --region need --variant exact"), "{said}");
    }
    refused(2, &[text(&path), "--spacing", "3"]);
    let (bare, words) = bare(folder.path());
    fs::OpenOptions::new().write(true).open(&bare).unwrap().set_len(9001).unwrap();
    let words: Vec<&str> =
        [text(&bare), "--slab-memory", "0"].into_iter().chain(words.iter().map(String::as_str)).collect();
    assert!(refused(1, &words).contains("bare.raw: read as raw samples: the data ends after 9001 of the 18480 bytes"));
}
