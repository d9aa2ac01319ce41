//! [`OpenError`]: why a store file cannot be opened or created.

use std::path::{Path, PathBuf};

use crate::store::damage::Damage;

/// Why a store cannot be opened or created.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OpenError {
    /// There is no file at the path.
    #[error("there is no store at {}", show(path))]
    NoStore {
        /// The path as the caller gave it.
        path: PathBuf,
    },
    /// The file at the path is not a store.
    #[error("{} is not a hlacdb store ({found})", show(path))]
    NotAStore {
        /// The path as the caller gave it.
        path: PathBuf,
        /// What is there instead.
        found: String,
    },
    /// A store cannot be created where a file exists.
    #[error("{} already exists", show(path))]
    Exists {
        /// The path as the caller gave it.
        path: PathBuf,
    },
    /// The operating system reported an error.
    #[error("{doing} {} failed", show(path))]
    Io {
        /// What was being done, e.g. `opening`.
        doing: &'static str,
        /// The path as the caller gave it.
        path: PathBuf,
        /// What the operating system reported.
        #[source]
        source: std::io::Error,
    },
    /// A newer version of hlacdb wrote the store.
    #[error(
        "the store {} has format version {found}, but this version of hlacdb reads up to version {supported}",
        show(path)
    )]
    Newer {
        /// The store.
        path: PathBuf,
        /// Its format version.
        found: u32,
        /// The highest format version that this library reads.
        supported: u32,
    },
    /// The store needs features that this library does not have.
    #[error("the store {} needs features (bits {unknown:#x}) that this version of hlacdb does not have", show(path))]
    UnknownFeatures {
        /// The store.
        path: PathBuf,
        /// The required-feature bits that are not known.
        unknown: u64,
    },
    /// The store has an older format and must be migrated first.
    #[error("the store {} has format version {found}, but this version of hlacdb needs version {current}", show(path))]
    NeedsMigration {
        /// The store.
        path: PathBuf,
        /// Its format version.
        found: u32,
        /// The format version that this library reads and writes.
        current: u32,
    },
    /// Another process, or another handle of this one, has the store open for writing.
    #[error(
        "the store {} is open for writing elsewhere{}",
        show(path),
        owner.map_or_else(String::new, |id| format!(" (process {id})"))
    )]
    HeldByWriter {
        /// The store.
        path: PathBuf,
        /// The id of the process that holds the lock, if the system tells.
        owner: Option<u32>,
    },
    /// The last writer did not close the store, so it must be opened for writing once before it can be read.
    #[error("the store {} was not closed properly and must be recovered before it can be read", show(path))]
    NeedsRepair {
        /// The store.
        path: PathBuf,
    },
    /// The file system has no byte-range locks, which readers and a writer need to share the file.
    #[error("the file system of {} has no byte-range locks, which a store needs", show(path))]
    NoLocks {
        /// The store.
        path: PathBuf,
    },
    /// The file is damaged or truncated.
    #[error("the store {} is damaged or truncated ({damage})", show(path))]
    DamagedFile {
        /// The store.
        path: PathBuf,
        /// The first damage that was found.
        damage: Damage,
    },
}

impl OpenError {
    /// Replaces the path by `shown(path)`.
    pub(crate) fn map_path(&mut self, shown: &dyn Fn(&Path) -> PathBuf) {
        match self {
            Self::NoStore { path }
            | Self::NotAStore { path, .. }
            | Self::Exists { path }
            | Self::Io { path, .. }
            | Self::Newer { path, .. }
            | Self::UnknownFeatures { path, .. }
            | Self::NeedsMigration { path, .. }
            | Self::HeldByWriter { path, .. }
            | Self::NeedsRepair { path }
            | Self::NoLocks { path }
            | Self::DamagedFile { path, .. } => *path = shown(path),
        }
    }
}

/// A path on one line, control characters escaped.
fn show(path: &Path) -> String {
    path.display().to_string().escape_debug().to_string()
}
