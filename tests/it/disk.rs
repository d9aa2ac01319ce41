//! A disk in memory that outlives its handles and fails as it is told.

use std::io;
use std::sync::{Arc, Mutex, MutexGuard};

use redb::StorageBackend;

use crate::support::noise;

/// How the disk fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Fault {
    /// From the n-th operation on nothing works; what was written is there.
    Gone,
    /// The n-th operation alone fails.
    Once,
    /// The power fails at the n-th operation: each unsynced write is there, torn, or missing.
    Power,
    /// From the n-th operation on the disk is full: nothing is written, but reads and syncs work.
    Full,
}

#[derive(Debug, Default)]
struct State {
    /// What a reader sees.
    bytes: Vec<u8>,
    /// What survives a power cut for sure.
    synced: Vec<u8>,
    /// Since then: place and bytes of writes, and new lengths.
    pending: Vec<(u64, Option<Vec<u8>>)>,
    operations: u64,
    fail_at: Option<(u64, Fault)>,
}

/// A disk in memory that outlives its handles.
#[derive(Clone, Debug, Default)]
pub(crate) struct Disk(Arc<Mutex<State>>);

impl Disk {
    pub(crate) fn with(bytes: &[u8], fail_at: Option<(u64, Fault)>) -> Self {
        let (bytes, synced) = (bytes.to_vec(), bytes.to_vec());
        Self(Arc::new(Mutex::new(State { bytes, synced, fail_at, ..State::default() })))
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.state().bytes.clone()
    }

    /// The number of operations so far.
    pub(crate) fn operations(&self) -> u64 {
        self.state().operations
    }

    /// From now on the disk fails in this way, or not at all.
    pub(crate) fn fail(&self, fault: Option<Fault>) {
        let mut state = self.state();
        state.fail_at = fault.map(|fault| (state.operations, fault));
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    /// Counts an operation; an error where it fails.
    fn step(&self, takes_room: bool) -> io::Result<MutexGuard<'_, State>> {
        let mut state = self.state();
        let number = state.operations;
        state.operations += 1;
        let fails = state.fail_at.is_some_and(|(at, fault)| match fault {
            Fault::Gone | Fault::Power => number >= at,
            Fault::Once => number == at,
            Fault::Full => number >= at && takes_room,
        });
        match (fails, state.fail_at) {
            (false, _) => Ok(state),
            (true, Some((_, Fault::Full))) => Err(io::Error::from(io::ErrorKind::StorageFull)),
            (true, _) => Err(io::Error::other("the disk is gone")),
        }
    }

    /// What is on the disk when the machine is started again.
    pub(crate) fn after(&self, seed: u64) -> Vec<u8> {
        let state = self.state();
        if !matches!(state.fail_at, Some((_, Fault::Power))) {
            return state.bytes.clone();
        }
        let mut next = noise(seed);
        let mut bytes = state.synced.clone();
        for (place, data) in &state.pending {
            let place = *place as usize;
            match (data, next() % 4) {
                (_, 0) => {}
                (None, _) => bytes.resize(place, 0),
                (Some(data), 1) => {
                    // Torn: some sectors of it, from either end.
                    let cut = next() as usize % (data.len() + 1);
                    let part = if next().is_multiple_of(2) { 0..cut } else { cut..data.len() };
                    put(&mut bytes, place + part.start, &data[part]);
                }
                (Some(data), _) => put(&mut bytes, place, data),
            }
        }
        bytes
    }
}

fn put(bytes: &mut Vec<u8>, at: usize, data: &[u8]) {
    if bytes.len() < at + data.len() {
        bytes.resize(at + data.len(), 0);
    }
    bytes[at..at + data.len()].copy_from_slice(data);
}

impl StorageBackend for Disk {
    fn len(&self) -> io::Result<u64> {
        Ok(self.state().bytes.len() as u64)
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let state = self.step(false)?;
        let from = state.bytes.get(offset as usize..offset as usize + out.len());
        out.copy_from_slice(from.ok_or_else(|| io::Error::from(io::ErrorKind::UnexpectedEof))?);
        Ok(())
    }

    fn set_len(&self, len: u64) -> io::Result<()> {
        let grows = len > self.state().bytes.len() as u64;
        let mut state = self.step(grows)?;
        state.bytes.resize(len as usize, 0);
        state.pending.push((len, None));
        Ok(())
    }

    fn sync_data(&self) -> io::Result<()> {
        let mut state = self.step(false)?;
        state.synced = state.bytes.clone();
        state.pending.clear();
        Ok(())
    }

    fn write(&self, offset: u64, data: &[u8]) -> io::Result<()> {
        let mut state = self.step(true)?;
        put(&mut state.bytes, offset as usize, data);
        state.pending.push((offset, Some(data.to_vec())));
        Ok(())
    }
}
