//! [`MigrationError`]: why a store was not migrated.

use std::path::{Path, PathBuf};

/// Why a store was not migrated. It is as it was before the hop that failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MigrationError {
    /// The path leads to something that is not a store.
    #[error("{} is not a hlacdb store", show(path))]
    NotAStore {
        /// The path as it was given.
        path: PathBuf,
    },
    /// The store was written by a newer version of hlacdb.
    #[error(
        "the store {} has format version {found}, but this version of hlacdb knows up to version {supported}",
        show(path)
    )]
    Newer {
        /// The store.
        path: PathBuf,
        /// Its format version.
        found: u32,
        /// The highest version that this library knows.
        supported: u32,
    },
    /// Another handle has the store open for writing.
    #[error("the store {} is locked by another writer", show(path))]
    HeldByWriter {
        /// The store.
        path: PathBuf,
    },
    /// The store is as a crash left it, and a check must not write.
    #[error(
        "the store {} was not closed cleanly and must be recovered by a writer before it can be checked",
        show(path)
    )]
    NeedsRepair {
        /// The store.
        path: PathBuf,
    },
    /// An operation on a file failed.
    #[error("{doing} {} failed", show(path))]
    Io {
        /// The operation.
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        #[source]
        source: std::io::Error,
    },
    /// The store holds a value that its format version does not allow.
    #[error("table {table} at {key}: {what}")]
    Invalid {
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
        /// The error of the engine.
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl MigrationError {
    /// Replaces the path, if the error has one, by `shown(path)`.
    pub(crate) fn map_path(&mut self, shown: &dyn Fn(&Path) -> PathBuf) {
        match self {
            Self::NotAStore { path }
            | Self::Newer { path, .. }
            | Self::HeldByWriter { path }
            | Self::NeedsRepair { path }
            | Self::Io { path, .. } => *path = shown(path),
            // Without paths. No wildcard: a new variant must say here whether it has one.
            Self::Invalid { .. } | Self::Engine { .. } => {}
        }
    }

    pub(super) fn invalid(table: &'static str, key: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Invalid { table, key: key.into(), what: what.into() }
    }

    pub(super) fn engine(error: impl Into<redb::Error>) -> Self {
        Self::Engine { source: Box::new(error.into() as redb::Error) }
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
