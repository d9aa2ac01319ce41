//! [`Store`]: the open file.

use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use redb::{Database, ReadOnlyDatabase, WriteTransaction};

use crate::store::access::meta;
use crate::store::access::snapshot::Snapshot;
use crate::store::access::transaction::Transaction;
use crate::store::damage::FILE;
use crate::store::error::StoreError;
use crate::store::os::panic_boundary::contained;

/// An open store: one file of textures and everything derived from them.
///
/// One handle at a time, in any process, has the file open for writing; any number have it open read-only, and each of
/// their snapshots sees the latest commit of the writer. A handle is shared by threads. Dropping it closes the file.
pub struct Store {
    path: PathBuf,
    handle: RwLock<Handle>,
}

/// The engine's handle.
pub(crate) enum Handle {
    Writer(Database),
    Reader(ReadOnlyDatabase),
}

impl Store {
    pub(in crate::store) fn new(path: &Path, handle: Handle) -> Self {
        Self { path: path.into(), handle: RwLock::new(handle) }
    }

    /// The path as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether this handle is read-only.
    pub fn is_read_only(&self) -> bool {
        matches!(*self.handle(), Handle::Reader(_))
    }

    /// The latest committed state.
    ///
    /// # Errors
    /// [`StoreError::Damage`], [`StoreError::Engine`].
    pub fn read(&self) -> Result<Snapshot, StoreError> {
        match &*self.handle() {
            Handle::Writer(database) => Snapshot::take(database),
            Handle::Reader(database) => Snapshot::take(database),
        }
    }

    /// Begins a transaction. Blocks while another transaction of this handle is open: do not begin two on one thread.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], [`StoreError::Poisoned`].
    pub fn write(&self) -> Result<Transaction, StoreError> {
        Transaction::new(self.begin()?)
    }

    pub(in crate::store) fn handle(&self) -> RwLockReadGuard<'_, Handle> {
        // Nothing that holds the lock leaves the handle half changed, so that a panic elsewhere does not matter.
        self.handle.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a transaction of the engine.
    pub(in crate::store) fn begin(&self) -> Result<WriteTransaction, StoreError> {
        let Handle::Writer(database) = &*self.handle() else { return Err(StoreError::ReadOnly) };
        meta::begin(database)
    }

    /// Moves all pages to the front of the file and truncates it.
    pub(in crate::store) fn compact_pages(&self) -> Result<(), StoreError> {
        let mut handle = self.handle.write().unwrap_or_else(PoisonError::into_inner);
        let Handle::Writer(database) = &mut *handle else { return Err(StoreError::ReadOnly) };
        // Each round may free space that the next one can move pages into.
        while contained(FILE, "compaction", || database.compact())? {}
        Ok(())
    }
}

impl std::fmt::Debug for Store {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Store").field("path", &self.path).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_and_snapshots_are_shared_by_threads() {
        fn shared<T: Send + Sync + 'static>() {}
        fn sent<T: Send + 'static>() {}
        shared::<Store>();
        shared::<Snapshot>();
        shared::<StoreError>();
        sent::<Transaction>();
    }
}
