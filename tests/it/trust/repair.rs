//! Repair: what can be derived is as it was before, to the bit; what cannot is named and kept.

use std::path::Path;

use hlacdb::hlac::View;
use hlacdb::space::Definition;
use hlacdb::{Database, Error, Hint, OpenError, Query, ReindexOptions, RepairOptions, TagEdit};
use redb::WriteTransaction;

use super::{drop_first, edit, filled, flip, told};
use crate::tables::{CHUNKS, DESCRIPTORS, HASHES, META, POINTS, ROWS, SPACES, STATISTICS, SUMS, TAGS, TEXTURES};

/// What is done to a store behind its back.
type Change = Box<dyn FnOnce(&WriteTransaction)>;

fn repair(path: &Path) -> hlacdb::RepairReport {
    Database::repair(path, &RepairOptions::default(), &()).unwrap()
}

/// Every change is found, repaired, and leaves what was there before; the damaged file is kept.
#[test]
fn repair_restores_everything_derivable_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 9, 9);
    // Rows with a tombstone among them are the harder case.
    Database::open(&path).unwrap().remove([4]).unwrap();
    let whole = std::fs::read(&path).unwrap();
    let before = told(&path);
    let changes: Vec<(&str, Change)> = vec![
        ("sums", Box::new(flip(SUMS, 2, 3000))),
        ("sums", Box::new(drop_first(SUMS))),
        ("hashes", Box::new(drop_first(HASHES))),
        ("tags", Box::new(drop_first(TAGS))),
        ("rows", Box::new(flip(ROWS, 0, 90))),
        ("rows", Box::new(drop_first(ROWS))),
        ("descriptors", Box::new(flip(DESCRIPTORS, 0, 70_000))),
        ("descriptors", Box::new(flip(DESCRIPTORS, 2, 5000))),
        ("statistics", Box::new(flip(STATISTICS, 1, 5000))),
        ("statistics", Box::new(drop_first(STATISTICS))),
        ("points", Box::new(flip(POINTS, 0, 30))),
        ("points", Box::new(drop_first(POINTS))),
        ("meta", Box::new(flip(META, 2, 77))),
    ];
    for (what, change) in changes {
        std::fs::write(&path, &whole).unwrap();
        edit(&path, change);
        let report = repair(&path);
        assert!(
            report.damage.iter().any(|damage| damage.table == what || damage.table == "(file)"),
            "{what}: {report:?}"
        );
        assert_eq!(report.quarantined, [], "{what}");
        assert!(Database::open(&path).unwrap().verify(true, &()).unwrap().ok(), "{what}");
        assert_eq!(told(&path), before, "{what}");
        let kept = path.with_file_name("textures.hlacdb.damaged");
        let again = Database::repair(&kept, &RepairOptions::new().check_only(true), &());
        assert!(again.map_or(true, |kept| !kept.damage.is_empty()), "{what}: the damaged file is kept, damaged");
        std::fs::remove_file(kept).unwrap();
        assert_eq!(Database::open(&path).unwrap().add(&super::volume(77, 9), Default::default()).unwrap().id(), 10);
        assert_eq!(repair(&path).original, None, "nothing is left to repair");
    }
}

#[test]
fn a_lost_space_is_refitted_on_all_textures() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 9, 9);
    Database::open(&path).unwrap().reindex(&ReindexOptions::default(), &()).unwrap();
    let before = told(&path);
    let names = Database::open(&path).unwrap().space_names().unwrap().len();
    for nth in 0..names {
        edit(&path, flip(SPACES, nth, 999));
        let report = repair(&path);
        assert_eq!(report.derived["spaces"], names as u64);
        assert_eq!(told(&path), before);
        std::fs::remove_file(path.with_file_name("textures.hlacdb.damaged")).unwrap();
    }
}

/// Regression: with the settings went the views that no texture is large enough for, and with them the meaning of a space.
#[test]
fn lost_settings_are_recovered_from_statistics_and_spaces() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 20, 9);
    let database = Database::open(&path).unwrap();
    let own = Definition::likeness("fine", &[View::LIKENESS[0], View::LIKENESS[3]], true, 0.5, 12).unwrap();
    database.add_space(&own, &()).unwrap();
    let (names, settings) = (database.space_names().unwrap(), database.statistics().unwrap().settings);
    drop(database);
    let before = told(&path);
    edit(&path, flip(META, 1, 500));
    let report = repair(&path);
    assert_eq!((report.derived.get("settings"), report.quarantined.len()), (Some(&1), 0), "{report:?}");
    let database = Database::open(&path).unwrap();
    assert_eq!(database.space_names().unwrap(), names);
    assert_eq!(database.statistics().unwrap().settings.views, settings.views);
    assert_eq!(database.space("fine").unwrap().definition(), &own);
    drop(database);
    assert!(told(&path) == before);
}

#[test]
fn reindex_replaces_damaged_statistics_spaces_and_points() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 9, 9);
    Database::open(&path).unwrap().reindex(&ReindexOptions::default(), &()).unwrap();
    let before = told(&path);
    for nth in 0..3 {
        edit(&path, flip(STATISTICS, nth, 4000));
        edit(&path, flip(SPACES, nth, 4000));
        edit(&path, flip(POINTS, nth, 40));
    }
    let database = Database::open(&path).unwrap();
    database.tag(1, &TagEdit::new().set("t", "u").unset("t")).unwrap();
    database.statistics().unwrap();
    let error = database.add(&super::volume(77, 9), Default::default()).unwrap_err();
    assert!(error.is_damage() && error.hint() == Some(Hint::RepairStore), "{error}");
    database.tag(1, &TagEdit::new().unset("t")).unwrap();
    database.reindex(&ReindexOptions::default(), &()).unwrap();
    assert!(database.verify(true, &()).unwrap().ok());
    drop(database);
    assert_eq!(told(&path), before);
}

/// A texture whose record or voxels are lost keeps its id and what is left of it, is named, and hinders nothing.
#[test]
fn damaged_textures_are_quarantined_and_the_rest_works() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 9, 9);
    edit(&path, flip(TEXTURES, 2, 500));
    edit(&path, flip(CHUNKS, 6, 500));
    for repaired in [false, true] {
        if repaired {
            let report = repair(&path);
            let lost: Vec<(u64, bool)> = report.quarantined.iter().map(|lost| (lost.id.get(), lost.left_out)).collect();
            assert_eq!(lost, [(3, true), (7, false)]);
        }
        let database = Database::open(&path).unwrap();
        let report = database.statistics().unwrap();
        let named: Vec<u64> = report.quarantined.iter().map(|lost| lost.id.get()).collect();
        assert_eq!(named, if repaired { vec![3, 7] } else { vec![3] });
        assert_eq!(database.textures(&[]).unwrap().len(), 8);
        for _ in 0..2 {
            // From the file, then from memory; k hits, though one of the nearest is left out.
            let answer = database.query(&Query::texture(1).k(8)).unwrap();
            let ids: Vec<u64> = answer.hits.iter().map(|hit| hit.id.get()).collect();
            assert!(ids.len() == 8 && !ids.contains(&3), "{ids:?}");
            assert!(answer.warnings.iter().any(|warning| warning.contains("id 3")), "{:?}", answer.warnings);
        }
        let error = database.texture(3).unwrap_err();
        assert!(error.to_string().contains("id 3"), "{error}");
        assert!(database.volume(7).unwrap_err().to_string().contains("id 7"));
        assert!(database.volume(8).unwrap().is_some());
        let damage = database.verify(true, &()).unwrap().damage;
        assert!(!damage.is_empty() && damage.iter().all(|one| matches!(one.texture(), Some(3 | 7))));
        database.tag(1, &TagEdit::new().set("n", repaired.to_string())).unwrap();
    }
    // Nothing more can be restored: no other copy is made.
    let whole = std::fs::read(&path).unwrap();
    let again = repair(&path);
    assert!(again.original.is_none() && again.quarantined.len() == 2 && !again.damage.is_empty(), "{again:?}");
    assert_eq!(Database::open(&path).unwrap().textures(&[]).unwrap().len(), 8);
    assert_eq!(std::fs::metadata(&path).unwrap().len(), whole.len() as u64);
    // Removed by its owner, the content can be added anew.
    let database = Database::open(&path).unwrap();
    assert_eq!(database.remove([3, 7]).unwrap(), [3, 7]);
    for n in [3, 7] {
        assert!(matches!(database.add(&super::volume(n, 9), Default::default()).unwrap(), hlacdb::Added::New(_)));
    }
    database.reindex(&ReindexOptions::new().reextract(true), &()).unwrap();
    let verified = database.verify(true, &()).unwrap();
    assert!(verified.ok(), "{:?}", verified.damage);
    assert_eq!(database.quarantined().unwrap(), []);
}

/// Points and moments that cannot be read: answers are as before where one tells the other, and say what is left out.
#[test]
fn damaged_points_and_moments_leave_answers_that_say_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 9, 9);
    let ask = |space: &str| {
        let database = Database::open(&path).unwrap();
        let first = database.query(&Query::texture(1).k(20).space(space)).unwrap();
        let second = database.query(&Query::texture(1).k(20).space(space)).unwrap();
        assert_eq!(first.hits, second.hits);
        (first.hits.iter().map(|hit| (hit.id, hit.distance)).collect::<Vec<_>>(), second.warnings)
    };
    let (before, warnings) = ask("default");
    assert_eq!(warnings, [""; 0]);
    // The codes alone: the first question does without them. The points too: they are made anew.
    edit(&path, flip(POINTS, 1, 300));
    assert_eq!(ask("default").0, before);
    edit(&path, flip(POINTS, 2, 300));
    let (after, warnings) = ask("default");
    assert_eq!(after, before);
    assert!(warnings.iter().any(|warning| warning.contains("points are recomputed")), "{warnings:?}");
    for nth in 0..6 {
        edit(&path, flip(DESCRIPTORS, nth, 5000));
    }
    let database = Database::open(&path).unwrap();
    let answer = database.query(&Query::volume(&super::volume(1, 9)).k(20)).unwrap();
    assert!(answer.hits.is_empty(), "one block holds all of them");
    assert!(answer.warnings.iter().any(|warning| warning.contains("9 textures are left out")), "{:?}", answer.warnings);
}

#[test]
fn a_file_that_is_no_store_is_not_repaired_and_not_touched() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("notes.txt");
    std::fs::write(&path, "not a store").unwrap();
    let error = Database::repair(&path, &RepairOptions::default(), &()).unwrap_err();
    assert!(matches!(error, Error::Open(OpenError::NotAStore { .. })), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let path = filled(folder.path(), 2, 9);
    let held = Database::open(&path).unwrap();
    let error = Database::repair(&path, &RepairOptions::default(), &()).unwrap_err();
    assert!(matches!(error, Error::Open(OpenError::HeldByWriter { .. })), "{error}");
    let _ = held.query(&Query::texture(1)).unwrap();
}
