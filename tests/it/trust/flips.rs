//! Bytes that change by themselves: every one is found or harmless; and files that are cut or overwritten.

use std::fs::{self, OpenOptions};
use std::os::unix::fs::FileExt;
use std::path::Path;

use hlacdb::{Database, Hint, OpenOptions as Open};

use super::{Told, filled, long, told};
use crate::support::noise;

/// What one change of the file did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// Opening or `verify` told of it.
    Found,
    /// Every answer and every texture is as it was.
    Harmless,
    /// Neither: something is wrong, and nothing said so.
    Missed,
}

/// Opens, verifies, and compares with what was told before.
fn look(path: &Path, before: &Told) -> Outcome {
    let verified = Open::new().create(false).open(path).and_then(|database| database.verify(false, &()));
    match verified {
        Err(error) => {
            let said = hlacdb::chain(&error);
            assert!(!said.contains('\n') && said.len() < 1000, "{said}");
            Outcome::Found
        }
        Ok(report) if !report.ok() => Outcome::Found,
        Ok(_) if told(path) == *before => Outcome::Harmless,
        Ok(_) => Outcome::Missed,
    }
}

/// Flips random bytes, one at a time, in a store of 100 textures.
#[test]
fn a_changed_byte_is_found_or_harmless() {
    let mut next = noise(hlacdb_testing::seed());
    let rounds = if long() { 2000 } else { 40 };
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), if long() { 100 } else { 30 }, 9);
    let whole = fs::read(&path).unwrap();
    let before = told(&path);
    // Opening a store for writing and closing it again changes it: from here on each round begins with the same bytes.
    let (mut found, mut harmless, mut missed) = (0, 0, Vec::new());
    for _ in 0..rounds {
        let at = next() % whole.len() as u64;
        let flip = 1 + (next() % 255) as u8;
        fs::write(&path, &whole).unwrap();
        let file = OpenOptions::new().write(true).open(&path).unwrap();
        file.write_all_at(&[whole[at as usize] ^ flip], at).unwrap();
        drop(file);
        match look(&path, &before) {
            Outcome::Found => found += 1,
            Outcome::Harmless => harmless += 1,
            Outcome::Missed => missed.push((at, flip)),
        }
    }
    eprintln!("{rounds} flipped bytes of {}: {found} found, {harmless} harmless, {} missed", whole.len(), missed.len());
    assert!(missed.is_empty(), "{missed:?}");
    assert!(found > 0);
}

/// Pages that hold what another page held, zeros, or noise; and a repair after each where the file can be read at all.
#[test]
fn an_overwritten_page_is_found_or_harmless_and_repair_never_panics() {
    let mut next = noise(hlacdb_testing::seed());
    let rounds = if long() { 300 } else { 9 };
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 20, 9);
    let whole = fs::read(&path).unwrap();
    let before = told(&path);
    let pages = whole.len() as u64 / 4096;
    let (mut found, mut harmless, mut repaired, mut lost) = (0, 0, 0, 0);
    for round in 0..rounds {
        let page = (next() % pages * 4096) as usize;
        let mut bytes = whole.clone();
        let with: Vec<u8> = match round % 3 {
            0 => vec![0; 4096],
            1 => (0..4096).map(|_| next() as u8).collect(),
            _ => {
                let other = (next() % pages * 4096) as usize;
                whole[other..other + 4096].to_vec()
            }
        };
        bytes[page..page + 4096].copy_from_slice(&with);
        fs::write(&path, &bytes).unwrap();
        match look(&path, &before) {
            Outcome::Found => found += 1,
            Outcome::Harmless => harmless += 1,
            Outcome::Missed => panic!("page {} of {pages}, round {round}: missed", page / 4096),
        }
        fs::write(&path, &bytes).unwrap();
        match Database::repair(&path, &Default::default(), &()) {
            Ok(report) if report.quarantined.is_empty() => {
                // Not both in full: they are megabytes.
                assert!(told(&path) == before, "page {} of {pages}, round {round}: {:?}", page / 4096, report.derived);
                repaired += 1;
            }
            Ok(report) => {
                lost += 1;
                let left = Database::open(&path).unwrap().textures(&[]).unwrap().len();
                let unreadable = report.quarantined.iter().filter(|lost| lost.left_out).count();
                assert!(left + unreadable >= 20, "{report:?}");
            }
            Err(error) => assert!(error.is_damage() || error.to_string().contains("not a hlacdb store"), "{error}"),
        }
        for entry in fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()) {
            if entry != path {
                fs::remove_file(entry).unwrap();
            }
        }
    }
    eprintln!(
        "{rounds} overwritten pages of {pages}: {found} found, {harmless} harmless; {repaired} as before after a repair, {lost} with textures lost"
    );
}

/// Regression: the panic message of the engine was printed like a crash, before the sentence.
#[test]
fn the_program_reports_damaged_pages_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 20, 9);
    let whole = fs::read(&path).unwrap();
    let mut contained = 0;
    for page in (1..30).map(|page| 4096 * page) {
        let mut bytes = whole.clone();
        bytes[page..page + 4096].fill(0);
        fs::write(&path, &bytes).unwrap();
        let mut program = std::process::Command::new(assert_cmd::cargo::cargo_bin("hlacdb"));
        let output = program.arg("-s").arg(&path).arg("verify").output().unwrap();
        let said = [output.stdout, output.stderr].map(|said| String::from_utf8_lossy(&said).into_owned()).concat();
        assert!(!said.contains("panicked at") && !said.contains("internal error, please report it"), "{said}");
        contained += usize::from(said.contains("panicked on a damaged page"));
    }
    assert!(contained > 0);
}

/// A file that was cut says so, with its name and what to do, in one sentence, when it is opened.
#[test]
fn a_truncated_store_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 20, 9);
    let whole = fs::read(&path).unwrap();
    for length in [9, 64, 319, 320, 4095, 4096, 4097, 8192, whole.len() / 3, whole.len() / 2, whole.len() - 4096] {
        for read_only in [true, false] {
            fs::write(&path, &whole[..length]).unwrap();
            let opened = Open::new().create(false).read_only(read_only).open(&path);
            let error = match opened {
                Ok(database) => {
                    // What was cut off was free space, or `verify` finds what is missing.
                    assert!(length > whole.len() / 2, "{length} of {}", whole.len());
                    let report = database.verify(false, &()).unwrap();
                    assert!(!report.ok() || report.checked["textures"] == 20, "{length} of {}", whole.len());
                    continue;
                }
                Err(error) => error,
            };
            let said = hlacdb::chain(&error);
            assert!(said.contains("textures.hlacdb") && !said.contains('\n'), "{length}: {said}");
            let remedies = [Some(Hint::RepairStore), Some(Hint::ChooseAnotherPath)];
            assert!(remedies.contains(&error.hint()), "{length}: {said}");
        }
    }
}
