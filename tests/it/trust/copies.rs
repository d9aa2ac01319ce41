//! Copies: backups of a store in use, whole textures out and in.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use hlacdb::volume::Volume;
use hlacdb::{Database, Error, Meta, OpenError, OpenOptions, Query};

use super::{edit, filled, flip, told, volume};
use crate::tables::SUMS;

/// Backups while one thread adds and removes: each is whole, of one moment, and a store like any other.
#[test]
fn a_backup_beside_a_writer_is_one_consistent_state() {
    let folder = tempfile::tempdir().unwrap();
    let database = Database::open(filled(folder.path(), 9, 9)).unwrap();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            for n in 100..110 {
                let id = database.add(&volume(n, 9), Meta::named("guest")).unwrap().id();
                database.remove([id]).unwrap();
            }
            done.store(true, Ordering::SeqCst);
        });
        let mut number = 0;
        while !done.load(Ordering::SeqCst) || number == 0 {
            let path = folder.path().join(format!("copy{number}"));
            let report = database.backup(&path, &()).unwrap();
            assert!((9..=10).contains(&report.textures));
            let copy = Database::open(&path).unwrap();
            assert_eq!((copy.len().unwrap(), copy.verify(true, &()).unwrap().ok()), (report.textures, true));
            number += 1;
        }
    });
    let path = folder.path().join("last");
    database.backup(&path, &()).unwrap();
    assert!(matches!(database.backup(&path, &()), Err(Error::Open(OpenError::Exists { .. }))));
    let original = database.path().to_path_buf();
    drop(database);
    assert_eq!(told(&path), told(&original));
    assert_eq!(Database::open(&path).unwrap().add(&volume(777, 9), Meta::default()).unwrap().id(), 20, "ids go on");
}

#[test]
fn a_damaged_store_has_no_backup() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 5, 9);
    edit(&path, flip(SUMS, 1, 900));
    let copy = folder.path().join("copy");
    let error = Database::open(&path).unwrap().backup(&copy, &()).unwrap_err();
    assert!(error.is_damage() && error.to_string().contains("sums at id 2"), "{error}");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left of the attempt");
}

/// Everything but ids comes back: voxels, colours, names that are no UTF-8, tags, provenance, cuts, moments without voxels.
#[test]
fn exported_textures_are_imported_unchanged() {
    let folder = tempfile::tempdir().unwrap();
    let path = filled(folder.path(), 6, 9);
    let database = Database::open(&path).unwrap();
    let colours = Volume::new([5, 6, 7], 3, (0..5 * 6 * 7 * 3).map(|i| (i * 7 % 251) as u8).collect()).unwrap();
    database.add(&colours, Meta::named("colours").tag("a,b", "c\n\u{e9}")).unwrap();
    let bare = database.prepare(volume(50, 12), Meta::named("no voxels"), hlacdb::Volumes::None).unwrap();
    database.commit(vec![bare]).unwrap();
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        let odd = Path::new(std::ffi::OsStr::from_bytes(b"/scans/\xff\xfe.nrrd"));
        database.add(&volume(51, 9), Meta::named("odd").path(odd)).unwrap();
    }
    database.remove([2]).unwrap();
    for target in ["out", "out.tar"].map(|name| folder.path().join(name)) {
        let report = database.export_textures(&target, &()).unwrap();
        assert_eq!((report.textures, report.with_voxels, report.damaged.len()), (8, 7, 0));
        let there = folder.path().join("there.hlacdb");
        let copy = Database::open(&there).unwrap();
        let imported = copy.import_textures(&target, &()).unwrap();
        assert_eq!((imported.added, imported.duplicates, imported.ids.len()), (8, 0, 8));
        assert_eq!(copy.import_textures(&target, &()).unwrap().duplicates, 8, "a second time adds nothing");
        assert!(copy.verify(true, &()).unwrap().ok());
        for (before, after) in database.textures(&[]).unwrap().iter().zip(copy.textures(&[]).unwrap()) {
            let old = before.id;
            let mut expected = after.clone();
            expected.id = old;
            assert_eq!(expected, *before);
            assert_eq!(database.volume(old).unwrap(), copy.volume(after.id).unwrap());
            assert_eq!(database.sums(old).unwrap(), copy.sums(after.id).unwrap());
            assert_eq!(database.descriptor(old).unwrap(), copy.descriptor(after.id).unwrap());
        }
        copy.query(&Query::texture(1)).unwrap();
        drop(copy);
        fs::remove_file(there).unwrap();
        assert!(database.export_textures(&target, &()).is_err(), "nothing is overwritten");
    }
    // The same store makes the same file.
    let again = folder.path().join("again.tar");
    database.export_textures(&again, &()).unwrap();
    assert_eq!(fs::read(again).unwrap(), fs::read(folder.path().join("out.tar")).unwrap());
}

#[test]
fn a_list_that_lies_is_refused_in_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let database = Database::open(filled(folder.path(), 3, 9)).unwrap();
    let out = folder.path().join("out");
    database.export_textures(&out, &()).unwrap();
    let list = fs::read_to_string(out.join("textures.jsonl")).unwrap();
    let refused = |list: &str, says: &str| {
        fs::write(out.join("textures.jsonl"), list).unwrap();
        let copy = OpenOptions::new().open(folder.path().join("copy.hlacdb")).unwrap();
        let said = hlacdb::chain(&copy.import_textures(&out, &()).unwrap_err());
        assert!(said.contains(says) && !said.contains('\n'), "{said}");
        assert!(copy.verify(false, &()).unwrap().ok());
    };
    refused("", "is empty");
    refused("{\"format\":\"x\",\"version\":1}\n", "'x' version 1");
    refused(&list.replacen("\"version\":1", "\"version\":2", 1), "up to version 1");
    refused(&list.replace("voxels/00000002.npy", "../textures.hlacdb"), "not an array of an archive");
    refused(&list.replace("voxels/00000002.npy", "voxels/.."), "not an array of an archive");
    refused(&list.replace("voxels/00000002.npy", "voxels/00000001.npy"), "hash");
    refused(&list[..list.len() - 9], "cannot be read");
    let voxels = out.join("voxels/00000003.npy");
    let whole = fs::read(&voxels).unwrap();
    fs::write(&voxels, &whole[..whole.len() - 1]).unwrap();
    refused(&list, "texture 3: its array cannot be read: the data ends after 728 of the 729 bytes");
}
