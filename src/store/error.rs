//! [`StoreError`]: why an operation of an open store failed. [`OpenError`] is about opening one.

use std::error::Error;
use std::path::{Path, PathBuf};

use crate::store::damage::{Damage, DamageKey, FILE};
use crate::store::open_error::OpenError;

/// Why an operation of the store failed. `Display` states the fact in one sentence, and [`source`](Error::source) gives the
/// causes below it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The file cannot be opened or created.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The handle is read-only.
    #[error("the store is open read-only")]
    ReadOnly,
    /// The operation requires exclusive access, but an older state is still being read.
    #[error("{doing} requires exclusive access to the store, but a snapshot or transaction is still open")]
    Busy {
        /// The operation.
        doing: &'static str,
    },
    /// A stored value is not what was written.
    #[error("{0}")]
    Damage(Damage),
    /// No texture has this id.
    #[error("there is no texture with id {id}")]
    NoSuchTexture {
        /// The requested id.
        id: u64,
    },
    /// The store already has a texture with the same content.
    #[error("the same content is already stored as texture {id}")]
    Duplicate {
        /// The texture that has the content.
        id: u64,
    },
    /// The caller passed a value that cannot be stored.
    #[error("{what}")]
    Invalid {
        /// A sentence: what was passed, what is expected.
        what: String,
    },
    /// An operation of this transaction failed half-way, so that it cannot be committed.
    #[error("an earlier operation of this transaction failed, so it cannot be committed")]
    Broken,
    /// A commit or write failed earlier. The file is intact, but this handle accepts no more changes.
    #[error("an earlier write to the store failed, so this handle accepts no more changes")]
    Poisoned,
    /// The caller cancelled the operation.
    #[error("{doing} was cancelled")]
    Cancelled {
        /// The operation.
        doing: &'static str,
    },
    /// The storage engine failed.
    #[error("{doing} failed")]
    Engine {
        /// The operation.
        doing: &'static str,
        /// The error of the engine.
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
}

impl From<Damage> for StoreError {
    fn from(damage: Damage) -> Self {
        Self::Damage(damage)
    }
}

impl StoreError {
    /// Replaces the path, if the error has one, by `shown(path)`.
    pub(crate) fn map_path(&mut self, shown: &dyn Fn(&Path) -> PathBuf) {
        match self {
            Self::Open(error) => error.map_path(shown),
            // Without paths. No wildcard: a new variant must say here whether it has one.
            Self::ReadOnly
            | Self::Busy { .. }
            | Self::Damage(_)
            | Self::NoSuchTexture { .. }
            | Self::Duplicate { .. }
            | Self::Invalid { .. }
            | Self::Broken
            | Self::Poisoned
            | Self::Cancelled { .. }
            | Self::Engine { .. } => {}
        }
    }

    pub(in crate::store) fn invalid(what: impl Into<String>) -> Self {
        Self::Invalid { what: what.into() }
    }

    pub(in crate::store) fn damage(table: &'static str, key: DamageKey, what: impl Into<String>) -> Self {
        Damage::new(table, key, what).into()
    }

    /// The error of the engine while `doing` something to `table`. Damage and a dead handle get variants of their own.
    pub(in crate::store) fn engine(table: &'static str, doing: &'static str, error: impl Into<redb::Error>) -> Self {
        match error.into() {
            redb::Error::PreviousIo | redb::Error::DatabaseClosed => Self::Poisoned,
            redb::Error::Corrupted(what) => Self::damage(table, DamageKey::Pages, format!("{what} (while {doing})")),
            redb::Error::TableDoesNotExist(name) => Self::damage(FILE, DamageKey::Name(name), "the table is missing"),
            redb::Error::TransactionInProgress => Self::Busy { doing },
            other => Self::Engine { doing, source: Box::new(other) },
        }
    }
}
