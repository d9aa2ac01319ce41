//! Why a store was not migrated.

use std::path::{Path, PathBuf};

/// Why a store was not migrated; it is as it was before the hop that failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MigrationError {
    /// The path leads to something that is no store.
    #[error("{} is not a hlacdb store: nothing was changed", show(path))]
    NotAStore {
        /// The path as it was given.
        path: PathBuf,
    },
    /// The store is newer than this library.
    #[error(
        "the store {} has format version {found}, but this hlacdb knows up to version {supported}: use a newer hlacdb",
        show(path)
    )]
    Newer {
        /// The store.
        path: PathBuf,
        /// Its version.
        found: u32,
        /// The highest version known here.
        supported: u32,
    },
    /// Another process has the store open for writing.
    #[error(
        "the store {} is held by another writer: end that process or wait for it to finish, then migrate",
        show(path)
    )]
    HeldByWriter {
        /// The store.
        path: PathBuf,
    },
    /// A crash left the store, and a check must not write.
    #[error(
        "the store {} was not closed properly: open it once with the hlacdb that wrote it, or migrate without the check",
        show(path)
    )]
    NeedsRepair {
        /// The store.
        path: PathBuf,
    },
    /// The operating system refused a file.
    #[error("{doing} {} failed", show(path))]
    Io {
        /// What was being done.
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's own words.
        #[source]
        source: std::io::Error,
    },
    /// The old store holds what its version does not allow.
    #[error("table {table} at {key}: {what}; the store was left as it was")]
    Odd {
        /// The table of the old version.
        table: &'static str,
        /// The key, readable.
        key: String,
        /// What was found and what was expected.
        what: String,
    },
    /// The storage engine failed.
    #[error("the storage engine failed while migrating")]
    Engine {
        /// The engine's own words.
        #[source]
        source: Box<redb::Error>,
    },
}

impl MigrationError {
    pub(super) fn odd(table: &'static str, key: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Odd { table, key: key.into(), what: what.into() }
    }

    pub(super) fn engine(error: impl Into<redb::Error>) -> Self {
        Self::Engine { source: Box::new(error.into()) }
    }

    pub(super) fn opening(path: &Path, error: redb::DatabaseError) -> Self {
        let path = path.to_path_buf();
        match error {
            redb::DatabaseError::DatabaseAlreadyOpen | redb::DatabaseError::LockProtocolMismatch => {
                Self::HeldByWriter { path }
            }
            redb::DatabaseError::RepairAborted => Self::NeedsRepair { path },
            redb::DatabaseError::UpgradeRequired(_) => Self::NotAStore { path },
            redb::DatabaseError::Storage(redb::StorageError::Io(source)) => Self::Io { doing: "opening", path, source },
            other => Self::engine(other),
        }
    }
}

/// A path on one line, control characters escaped.
fn show(path: &Path) -> String {
    path.display().to_string().escape_debug().to_string()
}
