//! [`Snapshot`]: one state of the store, as it was when the snapshot was taken.

use std::sync::Arc;

use redb::{ReadTransaction, ReadableDatabase};

use crate::store::access::meta;
use crate::store::access::reads::{Reads, sealed};
use crate::store::access::tables::{Source, Tables};
use crate::store::access::values;
use crate::store::damage::FILE;
use crate::store::error::StoreError;
use crate::store::format::header::{Settings, State};
use crate::store::os::panic_boundary::contained;

/// One consistent state of the store. It is cheap to take and to clone; any number may be open at once, on any threads,
/// beside a writer. The space of what it sees is not reused while it is open, so do not keep it longer than needed.
#[derive(Clone)]
pub struct Snapshot {
    inner: Arc<Inner>,
}

struct Inner {
    transaction: ReadTransaction,
    state: State,
    settings: Settings,
}

impl Snapshot {
    pub(in crate::store) fn take(database: &impl ReadableDatabase) -> Result<Self, StoreError> {
        let transaction = contained(FILE, "taking a snapshot", || database.begin_read())?;
        let (state, settings) = meta::read(Source::Read(&transaction))?;
        Ok(Self { inner: Arc::new(Inner { transaction, state, settings }) })
    }

    /// Reads the stored voxels of the texture `id` and verifies their checksums, without decompressing them.
    ///
    /// # Errors
    /// [`StoreError::Damage`] if they are damaged.
    pub fn check_voxels(&self, id: u64) -> Result<(), StoreError> {
        use sealed::Source as _;
        match self.record(id)?.and_then(|record| record.voxels) {
            Some(stored) => values::voxel_stream(self.tables(), id, stored.chunks, stored.bytes).map(drop),
            None => Ok(()),
        }
    }

    pub(in crate::store) fn transaction(&self) -> &ReadTransaction {
        &self.inner.transaction
    }
}

impl std::fmt::Debug for Snapshot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Snapshot").field("state", &self.inner.state).finish_non_exhaustive()
    }
}

impl sealed::Source for Snapshot {
    fn tables(&self) -> Tables<'_> {
        Tables { source: Source::Read(&self.inner.transaction), state: &self.inner.state, buffer: None }
    }

    fn settings_ref(&self) -> &Settings {
        &self.inner.settings
    }
}

impl Reads for Snapshot {}
