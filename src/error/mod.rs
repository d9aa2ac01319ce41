//! [`Error`]: everything that can go wrong with a database, grouped by what was being done.
//!
//! A sentence states what was found and what was expected. What to do about it is [`Error::hint`], which the program, the
//! server and the Python package put into their own words.

mod exchange;
mod hint;
mod ingest;
mod maintenance;
mod query;

use std::path::{Path, PathBuf};

pub use exchange::ExchangeError;
pub use hint::Hint;
pub use ingest::IngestError;
pub use maintenance::MaintenanceError;
pub use query::{ExampleKind, QueryError};

use crate::index::IndexError;
use crate::space::SpaceError;
use crate::store::{OpenError, StoreError};
use crate::synth::RecipeError;
use crate::volume::{ReadError, VolumeError, display_path};

/// Why a call of the database failed. `Display` is one sentence; `source()` gives the causes below it, and [`chain`] writes
/// both on one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The store cannot be opened or created.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The query, or another question about likeness, has no answer.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// A file, a volume or a recipe gave no texture.
    #[error(transparent)]
    Ingest(#[from] IngestError),
    /// Arrays or archives cannot be imported or exported.
    #[error(transparent)]
    Exchange(#[from] ExchangeError),
    /// The store cannot be repaired or reindexed, or its spaces cannot be changed.
    #[error(transparent)]
    Maintenance(#[from] MaintenanceError),
    /// The open store cannot do what was asked, or is damaged.
    #[error(transparent)]
    Store(StoreError),
    /// Moments, statistics or the definition of a space are not valid.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// The operating system reported an error.
    #[error("{doing}{} failed", path.as_deref().map_or_else(String::new, |path| format!(" {}", display_path(path))))]
    Io {
        /// What was being done, e.g. `reading`.
        doing: &'static str,
        /// The file or folder, if the operation was on one.
        path: Option<PathBuf>,
        /// What the operating system reported.
        #[source]
        source: std::io::Error,
    },
    /// The caller cancelled the operation; nothing was changed.
    #[error("cancelled; nothing was changed")]
    Cancelled,
}

impl From<StoreError> for Error {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Open(error) => Self::Open(error),
            StoreError::Cancelled { .. } => Self::Cancelled,
            error => Self::Store(error),
        }
    }
}

impl From<IndexError> for Error {
    fn from(error: IndexError) -> Self {
        QueryError::from(error).into()
    }
}

impl From<ReadError> for Error {
    fn from(error: ReadError) -> Self {
        IngestError::from(error).into()
    }
}

impl From<VolumeError> for Error {
    fn from(error: VolumeError) -> Self {
        IngestError::from(error).into()
    }
}

impl From<RecipeError> for Error {
    fn from(error: RecipeError) -> Self {
        IngestError::from(error).into()
    }
}

impl Error {
    /// True where the last writer did not close the store, so that it must be opened for writing once before it can be
    /// opened read-only.
    pub fn needs_repair(&self) -> bool {
        matches!(self, Self::Open(OpenError::NeedsRepair { .. }))
    }

    /// True where the store holds something else than what was written. Repairing may restore it.
    pub fn is_damage(&self) -> bool {
        matches!(
            self,
            Self::Open(OpenError::DamagedFile { .. })
                | Self::Store(StoreError::Damage(_))
                | Self::Space(SpaceError::Damaged { .. } | SpaceError::Version { .. })
        )
    }

    /// This error with each of its paths replaced by `shown(path)`.
    ///
    /// Errors name files as the caller named them, or by their full paths. Where an error is shown to somebody who must
    /// not see the folders of this machine, make its paths relative first.
    ///
    /// ```
    /// use hlacdb::OpenOptions;
    /// use std::path::{Path, PathBuf};
    /// let error = OpenOptions::new().create(false).open("/data/cores/none.hlacdb").unwrap_err();
    /// assert!(error.to_string().contains("/data/cores/none.hlacdb"));
    /// let error = error.map_paths(&|path: &Path| path.file_name().map_or_else(PathBuf::new, PathBuf::from));
    /// assert!(!error.to_string().contains("/data") && error.to_string().contains("none.hlacdb"));
    /// ```
    #[must_use]
    pub fn map_paths(mut self, shown: &dyn Fn(&Path) -> PathBuf) -> Self {
        match &mut self {
            Self::Open(error) => error.map_path(shown),
            Self::Ingest(error) => error.map_path(shown),
            Self::Exchange(error) => error.map_path(shown),
            Self::Maintenance(error) => error.map_path(shown),
            Self::Store(error) => error.map_path(shown),
            Self::Io { path, .. } => *path = path.as_deref().map(shown),
            // Without paths. No wildcard: a new variant says here whether it has one.
            Self::Query(_) | Self::Space(_) | Self::Cancelled => {}
        }
        self
    }

    pub(crate) fn io(doing: &'static str, source: std::io::Error) -> Self {
        Self::Io { doing, path: None, source }
    }

    pub(crate) fn file(doing: &'static str, path: &Path, source: std::io::Error) -> Self {
        Self::Io { doing, path: Some(path.to_owned()), source }
    }
}

/// An error's sentence and its causes, joined by `: `.
pub fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str(": ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    text
}
