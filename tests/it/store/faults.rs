//! What a handle does after its storage failed, recovery, and threads that share a store. How every operation survives a
//! failing disk is tested with the database (`trust::faults`).

use std::sync::atomic::{AtomicBool, Ordering};

use hlacdb::internals::store::{NewTexture, OpenError, Reads, Store, StoreError, ViewCode};

use super::{Scratch, moments, settings, texture};
use crate::disk::{Disk, Fault};

fn small(seed: u64) -> NewTexture {
    NewTexture { descriptors: vec![(ViewCode(0), moments(seed))], ..texture(seed) }
}

#[test]
fn a_failed_commit_poisons_the_handle_and_reopening_recovers() {
    let disk = Disk::default();
    let store = Store::options().create_with_backend(disk.clone(), &settings()).unwrap();
    let mut transaction = store.write().unwrap();
    transaction.add(small(1)).unwrap();
    transaction.commit().unwrap();
    let mut transaction = store.write().unwrap();
    transaction.add(small(2)).unwrap();
    disk.fail(Some(Fault::Gone));
    transaction.commit().unwrap_err();
    disk.fail(None);
    let error = store.write().unwrap_err();
    assert!(matches!(error, StoreError::Poisoned), "{error}");
    // What was committed can still be read.
    assert!(store.read().unwrap().record(1).unwrap().is_some());
    let recovered = Store::options().open_with_backend(Disk::with(&disk.bytes(), None)).unwrap();
    assert!(recovered.read().unwrap().verify(None, &()).unwrap().is_ok());
    recovered.write().unwrap().add(small(3)).unwrap();
}

#[test]
fn an_interrupted_writer_leaves_a_store_that_a_writer_recovers() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let mut transaction = store.write().unwrap();
    transaction.add(texture(1)).unwrap();
    transaction.commit().unwrap();
    // The file as a kill would leave it: copied while the writer has it open.
    let copy = scratch.path().with_extension("killed");
    std::fs::copy(scratch.path(), &copy).unwrap();
    let error = Store::open_read_only(&copy).unwrap_err();
    assert!(matches!(error, StoreError::Open(OpenError::NeedsRepair { .. })), "{error}");
    drop(Store::open(&copy).unwrap());
    assert_eq!(Store::open_read_only(&copy).unwrap().read().unwrap().record(1).unwrap().unwrap().name, "texture 1");
}

#[test]
fn threads_read_whole_states_while_one_writes() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let mut last = 0;
                while !done.load(Ordering::SeqCst) {
                    let state = store.read().unwrap();
                    assert!(state.revision() >= last);
                    last = state.revision();
                    // Every commit adds two textures and writes their ids into the statistics.
                    let ids: Vec<u64> = state.records().map(|record| record.unwrap().id).collect();
                    let newest = ids.iter().rev().take(2).sum::<u64>().to_string();
                    let told = state.statistics("newest").unwrap().unwrap_or_else(|| b"0".to_vec());
                    assert_eq!(newest.as_bytes(), told);
                    assert!(state.verify(None, &()).unwrap().is_ok());
                }
            });
        }
        for round in 0..40 {
            let mut transaction = store.write().unwrap();
            let ids = [2 * round, 2 * round + 1].map(|seed| transaction.add(small(seed)).unwrap());
            transaction.put_statistics("newest", ids.iter().sum::<u64>().to_string().as_bytes()).unwrap();
            if round > 5 {
                transaction.remove(round - 5).unwrap();
            }
            transaction.commit().unwrap();
        }
        done.store(true, Ordering::SeqCst);
    });
    assert_eq!(store.read().unwrap().counts().textures, 80 - 34);
}
