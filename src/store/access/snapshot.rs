//! [`Snapshot`]: one state of the store, as it was when it was taken.

use std::sync::Arc;

use redb::{ReadTransaction, ReadableDatabase};

use crate::store::access::reads::sealed::Source as _;
use crate::store::access::reads::{Reads, read_stream, sealed};
use crate::store::access::tables::{Source, Tables};
use crate::store::error::StoreError;
use crate::store::format::codec;
use crate::store::format::frame::{self, Kind};
use crate::store::format::header::Settings;
use crate::store::format::header::{Header, KEY_FORMAT, KEY_SETTINGS, KEY_STATE, State};
use crate::store::format::keys;
use crate::store::os::panic_boundary::guarded;

/// One consistent state of the store. Cheap to take and to clone; many may be open at once, on any threads, beside a
/// writer. While one is open the space of what it sees is not used again, so do not keep it longer than needed.
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
        guarded("meta", || {
            let transaction = database.begin_read().map_err(StoreError::when("taking a snapshot"))?;
            let (state, settings) = read_meta(Source::Read(&transaction))?;
            Ok(Self { inner: Arc::new(Inner { transaction, state, settings }) })
        })
    }

    /// Reads the kept voxels of the texture `id` and checks them, without expanding them.
    ///
    /// # Errors
    /// [`StoreError::Damage`] where they are not whole.
    pub fn check_voxels(&self, id: u64) -> Result<(), StoreError> {
        guarded("chunks", || match self.record(id)?.and_then(|record| record.voxels) {
            Some(kept) => read_stream(self.tables(), id, kept.pieces, kept.bytes).map(drop),
            None => Ok(()),
        })
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
        Tables { source: Source::Read(&self.inner.transaction), state: &self.inner.state, open: None }
    }

    fn settings_ref(&self) -> &Settings {
        &self.inner.settings
    }
}

impl Reads for Snapshot {}

/// Counters and settings, the header checked.
pub(in crate::store) fn read_meta(source: Source<'_>) -> Result<(State, Settings), StoreError> {
    let header = read_header(source)?;
    if header.version != Header::CURRENT.version {
        // The handle was opened on the current version; another process has migrated the store since.
        return Err(StoreError::invalid("the store's format was changed while it was open: open it again"));
    }
    let table = source.table(keys::META)?;
    let state = match table.get(KEY_STATE)? {
        Some(value) => frame::open(Kind::State, KEY_STATE, value.value()).and_then(codec::decode),
        None => Err("the entry is missing".into()),
    };
    let settings = match table.get(KEY_SETTINGS)? {
        Some(value) => frame::open(Kind::Settings, KEY_SETTINGS, value.value()).and_then(codec::decode),
        None => Err("the entry is missing".into()),
    };
    Ok((
        state.map_err(|what| StoreError::damage("meta", "state", what))?,
        settings.map_err(|what| StoreError::damage("meta", "settings", what))?,
    ))
}

/// The header.
pub(in crate::store) fn read_header(source: Source<'_>) -> Result<Header, StoreError> {
    let table = source.table(keys::META)?;
    let header = match table.get(KEY_FORMAT)? {
        Some(value) => Header::decode(value.value()),
        None => Err("the entry is missing".into()),
    };
    header.map_err(|what| StoreError::damage("meta", "format", what))
}
