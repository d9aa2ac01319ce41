//! Errors of importing and exporting.

use std::path::{Path, PathBuf};

use super::query::names;
use crate::hlac::View;
use crate::volume::display_path;

/// Why arrays or archives cannot be imported or exported.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExchangeError {
    /// An array, or a list that belongs to it, has another shape or type than is needed.
    #[error("{}: found {found}, expected {expected}", display_path(path))]
    Array {
        /// The file.
        path: PathBuf,
        /// What was found.
        found: String,
        /// What is needed.
        expected: String,
    },
    /// The moments are of other views than the store has.
    #[error(
        "{}: the array has moments of {}, but the store has the views {}",
        display_path(path),
        names(found),
        names(stored)
    )]
    Views {
        /// The file.
        path: PathBuf,
        /// The views of the array.
        found: Vec<View>,
        /// The views of the store.
        stored: Vec<View>,
    },
    /// A folder or file is not a complete archive of textures.
    #[error("{}: {what}", display_path(path))]
    Archive {
        /// The folder or file.
        path: PathBuf,
        /// What was found and what was expected.
        what: String,
    },
}

impl ExchangeError {
    /// Replaces the path by `shown(path)`.
    pub(super) fn map_path(&mut self, shown: &dyn Fn(&Path) -> PathBuf) {
        match self {
            Self::Array { path, .. } | Self::Views { path, .. } | Self::Archive { path, .. } => *path = shown(path),
        }
    }
}
