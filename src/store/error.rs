//! [`StoreError`]: what can go wrong with an open store. [`OpenError`] is about opening one.

use std::error::Error;
use std::path::{Path, PathBuf};

use super::open_error::OpenError;

/// A value that is not what was written: named by table and key, so that it can be contained and repaired.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[error("damage in table {table}{}{key}: {what}", if key.is_empty() { "" } else { " at " })]
pub struct Damage {
    /// The table, as docs/format.md names it.
    pub table: &'static str,
    /// The key, readable: `id 7`, `view 3, block 12`; empty where the table as a whole is meant.
    pub key: String,
    /// What was found and what was expected.
    pub what: String,
}

/// Why the store cannot do what was asked. `Display` is one sentence; [`source`](Error::source) gives the causes below it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The file cannot be opened or created.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The handle was opened for reading only.
    #[error("the store was opened for reading only")]
    ReadOnly,
    /// The whole file is to be rewritten while somebody still reads an older state.
    #[error("{doing} needs exclusive access to the store, but a snapshot or transaction is still open")]
    Busy {
        /// What was to be done.
        doing: &'static str,
    },
    /// A value is not what was written.
    #[error("{0}")]
    Damage(Damage),
    /// No texture has this id.
    #[error("there is no texture with id {id}")]
    NoSuchTexture {
        /// The id that was asked for.
        id: u64,
    },
    /// The content is in the store already.
    #[error("texture {id} has the same content")]
    Duplicate {
        /// The texture that has it.
        id: u64,
    },
    /// The caller gave a value that cannot be stored.
    #[error("{what}")]
    Invalid {
        /// A sentence: what was given and what is expected.
        what: String,
    },
    /// An earlier operation of this transaction failed, so that it can only be dropped.
    #[error("an earlier operation of this transaction failed, so it cannot be committed")]
    Broken,
    /// An earlier write or commit failed. What is on disk is whole, but this handle accepts no more changes.
    #[error("an earlier write to the store failed, so this handle accepts no more changes")]
    Poisoned,
    /// The caller's progress function cancelled the operation.
    #[error("{doing} was cancelled")]
    Cancelled {
        /// What was cancelled.
        doing: &'static str,
    },
    /// The storage engine failed.
    #[error("{doing} failed")]
    Engine {
        /// What was being done.
        doing: &'static str,
        /// The engine's own words.
        #[source]
        source: Box<dyn Error + Send + Sync>,
    },
}

impl From<Damage> for StoreError {
    fn from(damage: Damage) -> Self {
        Self::Damage(damage)
    }
}

impl Damage {
    /// The texture that is hit, where the damage is of one.
    pub fn texture(&self) -> Option<u64> {
        self.key.strip_prefix("id ")?.split(',').next()?.parse().ok()
    }
}

impl StoreError {
    /// Replaces the path, where there is one, by `shown(path)`.
    pub(crate) fn map_path(&mut self, shown: &dyn Fn(&Path) -> PathBuf) {
        match self {
            Self::Open(error) => error.map_path(shown),
            // Without paths. No wildcard: a new variant says here whether it has one.
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

    pub(in crate::store) fn damage(table: &'static str, key: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Damage(Damage { table, key: key.into(), what: what.into() })
    }

    /// The error of the engine while `doing` something; what it knows as damage or as a dead handle is told as such.
    pub(in crate::store) fn engine(doing: &'static str, error: impl Into<redb::Error>) -> Self {
        match error.into() {
            redb::Error::PreviousIo | redb::Error::DatabaseClosed => Self::Poisoned,
            redb::Error::Corrupted(what) => Self::damage("(pages)", "", format!("{what} (while {doing})")),
            redb::Error::TableDoesNotExist(name) => Self::damage("(tables)", name, "the table is missing"),
            redb::Error::TransactionInProgress => Self::Busy { doing },
            other => Self::Engine { doing, source: Box::new(other) },
        }
    }

    /// For `map_err`: [`StoreError::engine`] while `doing` something.
    pub(in crate::store) fn when<E: Into<redb::Error>>(doing: &'static str) -> impl Fn(E) -> Self {
        move |error| Self::engine(doing, error)
    }
}

/// A path on one line, control characters escaped.
pub(in crate::store) fn show(path: &Path) -> String {
    path.display().to_string().escape_debug().to_string()
}
