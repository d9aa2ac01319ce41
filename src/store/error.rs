//! What can go wrong with a store, by whose fault and what to do.

use std::error::Error;
use std::path::{Path, PathBuf};

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

/// Why the store refused. Display is one sentence; [`source`](Error::source) gives the causes below it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The path leads to something that is no store.
    #[error("{} is not a hlacdb store ({found}): name another file, or create a store where there is none", show(path))]
    NotAStore {
        /// The path as it was given.
        path: PathBuf,
        /// What is there instead.
        found: String,
    },
    /// A store is to be created where something is already.
    #[error("{} already exists: name another file, or remove that one first", show(path))]
    Exists {
        /// The path as it was given.
        path: PathBuf,
    },
    /// The operating system refused the file.
    #[error("{doing} {} failed", show(path))]
    Io {
        /// What was being done, e.g. `opening`.
        doing: &'static str,
        /// The path as it was given.
        path: PathBuf,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// The store was written by a newer hlacdb.
    #[error(
        "the store {} has format version {found}, but this hlacdb reads up to version {supported}: use a newer hlacdb",
        show(path)
    )]
    Newer {
        /// The store.
        path: PathBuf,
        /// Its format version.
        found: u32,
        /// The highest version that this library reads.
        supported: u32,
    },
    /// The store needs features that this library does not know.
    #[error(
        "the store {} needs features (bits {unknown:#x}) that this hlacdb does not know: use a newer hlacdb",
        show(path)
    )]
    UnknownFeatures {
        /// The store.
        path: PathBuf,
        /// The required-feature bits without a meaning here.
        unknown: u64,
    },
    /// The store has an older format.
    #[error(
        "the store {} has the older format version {found}, and this hlacdb works on version {current}: run `hlacdb migrate` on it once",
        show(path)
    )]
    NeedsMigration {
        /// The store.
        path: PathBuf,
        /// Its format version.
        found: u32,
        /// The version that this library works on.
        current: u32,
    },
    /// Another handle has the store open for writing.
    #[error(
        "the store {} is held by another writer{}: end that process (`hlacdb serve` writes until it ends, with --read-only it does not) or wait for it to finish; reading (query, list, stats, ...) works meanwhile",
        show(path),
        holder.map_or_else(String::new, |id| format!(" (process {id})"))
    )]
    HeldByWriter {
        /// The store.
        path: PathBuf,
        /// The process, where the system tells.
        holder: Option<u32>,
    },
    /// A read-only handle found the store as a crash left it.
    #[error(
        "the store {} was not closed properly and must be recovered by a writer before it can be read: open it once for writing, e.g. with `hlacdb verify`",
        show(path)
    )]
    NeedsRepair {
        /// The store.
        path: PathBuf,
    },
    /// The file system gives no byte-range locks, without which readers and a writer cannot share the file.
    #[error(
        "the file system of {} supports no byte-range locks, which a store needs: keep it on a local disk",
        show(path)
    )]
    NoLocks {
        /// The store.
        path: PathBuf,
    },
    /// The handle was opened for reading only.
    #[error("the store was opened for reading only: open it for writing to change it")]
    ReadOnly,
    /// The whole file is to be rewritten while somebody still reads an older state.
    #[error("{doing} needs the store alone, but a snapshot or transaction is still open: close readers and try again")]
    Busy {
        /// What was to be done.
        doing: &'static str,
    },
    /// A value is not what was written.
    #[error("{0}: run `hlacdb repair`, or go back to a backup")]
    Damage(Damage),
    /// The file as a whole cannot be opened.
    #[error(
        "the store {} is damaged or cut short ({damage}): run `hlacdb repair` to save what is whole, or go back to a backup",
        show(path)
    )]
    DamagedFile {
        /// The store.
        path: PathBuf,
        /// What was met first.
        damage: Damage,
    },
    /// No texture has this id.
    #[error("there is no texture with id {id}: `hlacdb list` shows the ids")]
    NoSuchTexture {
        /// The id that was asked for.
        id: u64,
    },
    /// The content is in the store already.
    #[error("the same content is already in the store as texture {id}")]
    Duplicate {
        /// The texture that has it.
        id: u64,
    },
    /// The caller gave what cannot be stored.
    #[error("{what}")]
    Invalid {
        /// The sentence: what was given, what is expected.
        what: String,
    },
    /// An operation of this transaction failed half-way, so it can only be dropped.
    #[error("an earlier operation of this transaction failed, so it cannot be committed: drop it and begin anew")]
    Broken,
    /// A commit or write failed earlier: what is on disk is whole, but this handle must not go on.
    #[error(
        "an earlier write to the store failed, so this handle takes no more changes: close it and open the store again"
    )]
    Poisoned,
    /// The caller's progress function asked to stop.
    #[error("{doing} was cancelled; nothing is lost")]
    Cancelled {
        /// What was stopped.
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
            Self::NotAStore { path, .. }
            | Self::Exists { path }
            | Self::Io { path, .. }
            | Self::Newer { path, .. }
            | Self::UnknownFeatures { path, .. }
            | Self::NeedsMigration { path, .. }
            | Self::HeldByWriter { path, .. }
            | Self::NeedsRepair { path }
            | Self::NoLocks { path }
            | Self::DamagedFile { path, .. } => *path = shown(path),
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
