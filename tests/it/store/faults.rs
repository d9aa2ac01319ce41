//! Storage that fails, and threads that meet.

use std::io;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::sync::{Arc, Mutex};

use hlacdb::store::{NewTexture, OpenError, Reads, Store, StoreError, ViewCode, silent};
use redb::StorageBackend;

use super::{Scratch, moments, settings, texture};

/// A disk in memory that outlives its handles, and fails at the n-th operation and ever after.
#[derive(Clone, Debug, Default)]
struct Disk {
    bytes: Arc<Mutex<Vec<u8>>>,
    left: Arc<AtomicI64>,
}

impl Disk {
    fn with(bytes: Vec<u8>, left: i64) -> Self {
        Self { bytes: Arc::new(Mutex::new(bytes)), left: Arc::new(AtomicI64::new(left)) }
    }

    fn bytes(&self) -> Vec<u8> {
        self.bytes.lock().unwrap().clone()
    }

    fn step(&self) -> io::Result<()> {
        match self.left.fetch_sub(1, Ordering::SeqCst) {
            left if left > 0 => Ok(()),
            _ => Err(io::Error::other("the disk is gone")),
        }
    }
}

impl StorageBackend for Disk {
    fn len(&self) -> io::Result<u64> {
        Ok(self.bytes.lock().unwrap().len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let bytes = self.bytes.lock().unwrap();
        let from = bytes.get(offset as usize..offset as usize + out.len());
        out.copy_from_slice(from.ok_or_else(|| io::Error::from(io::ErrorKind::UnexpectedEof))?);
        Ok(())
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        self.step()?;
        self.bytes.lock().unwrap().resize(len as usize, 0);
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        self.step()
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        self.step()?;
        self.bytes.lock().unwrap()[offset as usize..offset as usize + data.len()].copy_from_slice(data);
        Ok(())
    }
}

const FOREVER: i64 = i64::MAX;

fn small(seed: u64) -> NewTexture {
    NewTexture { descriptors: vec![(ViewCode(0), moments(seed))], ..texture(seed) }
}

/// Two textures, committed.
fn start() -> Vec<u8> {
    let disk = Disk::with(Vec::new(), FOREVER);
    let store = Store::options().create_with_backend(disk.clone(), &settings()).unwrap();
    let mut transaction = store.write().unwrap();
    transaction.add(small(1)).unwrap();
    transaction.add(small(2)).unwrap();
    transaction.commit().unwrap();
    drop(store);
    disk.bytes()
}

/// Adds, tags, removes and compacts; how many commits were acknowledged.
fn scenario(store: &Store) -> Result<u64, (u64, StoreError)> {
    let change = |step: u64| -> Result<(), StoreError> {
        let mut transaction = store.write()?;
        match step {
            0 => drop(transaction.add(small(3))?),
            1 => transaction.set_tag(1, "mood", "calm")?,
            _ => drop(transaction.remove(2)?),
        }
        transaction.put_statistics("full", &[step as u8; 5000])?;
        transaction.commit().map(drop)
    };
    for step in 0..3 {
        change(step).map_err(|error| (step, error))?;
    }
    store.compact(&mut silent).map(|_| 3).map_err(|error| (3, error))
}

/// How far the scenario got, as the state shows it.
fn progress(store: &Store) -> u64 {
    let state = store.read().unwrap();
    assert_eq!(state.verify(Some(&|_, _, _| Vec::new()), &mut silent).unwrap().damage, []);
    let steps = [
        state.record(3).unwrap().is_some(),
        state.tagged("mood", "calm").unwrap() == [1],
        state.record(2).unwrap().is_none(),
    ];
    let done = steps.iter().take_while(|&&done| done).count();
    assert!(steps[done..].iter().all(|&done| !done), "{steps:?}");
    let statistics = state.statistics("full").unwrap();
    assert_eq!(statistics, done.checked_sub(1).map(|step| vec![step as u8; 5000]));
    done as u64
}

#[test]
fn wherever_the_disk_fails_the_state_is_the_one_before_or_after() {
    let start = start();
    let mut operations = 0;
    loop {
        let disk = Disk::with(start.clone(), operations);
        let outcome = match Store::options().open_with_backend(disk.clone()) {
            Ok(store) => {
                let outcome = scenario(&store);
                if let Err((acknowledged, _)) = outcome
                    && acknowledged < 3
                {
                    // What was committed can still be read, but the handle takes no more changes.
                    assert!(store.read().and_then(|state| state.record(1)).is_ok());
                    let refused = store.write().and_then(|transaction| transaction.commit());
                    assert!(refused.is_err(), "{refused:?}");
                }
                outcome
            }
            Err(error) => Err((0, error)),
        };
        disk.left.store(FOREVER, Ordering::SeqCst);
        let store = Store::options().open_with_backend(Disk::with(disk.bytes(), FOREVER)).unwrap();
        let done = progress(&store);
        match outcome {
            Ok(_) => {
                assert_eq!(done, 3);
                break;
            }
            Err((acknowledged, _)) => {
                assert!(done == acknowledged || done == acknowledged + 1, "{done} {acknowledged}")
            }
        }
        // The work can be resumed: the steps that are missing, then a compaction.
        if done == 0 {
            assert_eq!(scenario(&store).unwrap(), 3);
            assert_eq!(progress(&store), 3);
        }
        operations += 1;
    }
    assert!(operations > 30, "{operations}");
}

#[test]
fn a_failed_commit_poisons_the_handle_and_reopening_heals() {
    let disk = Disk::with(start(), FOREVER);
    let store = Store::options().open_with_backend(disk.clone()).unwrap();
    let mut transaction = store.write().unwrap();
    transaction.add(small(3)).unwrap();
    disk.left.store(0, Ordering::SeqCst);
    transaction.commit().unwrap_err();
    disk.left.store(FOREVER, Ordering::SeqCst);
    let error = store.write().unwrap_err();
    assert!(matches!(error, StoreError::Poisoned), "{error}");
    assert!(store.read().unwrap().record(1).unwrap().is_some());
    let healed = Store::options().open_with_backend(Disk::with(disk.bytes(), FOREVER)).unwrap();
    healed.write().unwrap().add(small(4)).unwrap();
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
                    assert!(state.verify(None, &mut |_| ControlFlow::Continue(())).unwrap().is_ok());
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
