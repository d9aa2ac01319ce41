//! Errors of fitting, user-defined spaces and repair.

use std::path::{Path, PathBuf};

use super::query::names;
use crate::hlac::View;
use crate::migrations::MigrationError;
use crate::store::StoreError;
use crate::volume::display_path;

/// Why a store cannot be repaired or reindexed, or its spaces cannot be changed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MaintenanceError {
    /// The file is so damaged that nothing of it can be read.
    #[error("nothing of the store {} can be restored: the file no longer holds a store", display_path(path))]
    BeyondRepair {
        /// The store.
        path: PathBuf,
        /// What the store reported.
        #[source]
        source: StoreError,
    },
    /// The store was not migrated.
    #[error(transparent)]
    Migration(#[from] MigrationError),
    /// No texture has its voxels stored, which are needed to estimate the effect of nuisances.
    #[error("the effect of nuisances is estimated from voxels, but the store has none")]
    NoVoxels,
    /// A space of this name exists.
    #[error("there is already a space '{name}'")]
    SpaceExists {
        /// The name.
        name: String,
    },
    /// The space is not user-defined: it is built in, or there is none of this name.
    #[error("there is no user-defined space '{name}'; user-defined spaces of the store: {}", list(user_defined))]
    NotUserDefined {
        /// The name given.
        name: String,
        /// The names of the user-defined spaces.
        user_defined: Vec<String>,
    },
    /// The space uses views that the store does not have.
    #[error("the space '{space}' needs the views {}, which the store does not have", names(needs))]
    ViewsNotStored {
        /// The space.
        space: String,
        /// The views that are missing.
        needs: Vec<View>,
    },
}

impl MaintenanceError {
    /// Replaces the path, where there is one, by `shown(path)`.
    pub(super) fn map_path(&mut self, shown: &dyn Fn(&Path) -> PathBuf) {
        match self {
            Self::BeyondRepair { path, source } => {
                *path = shown(path);
                source.map_path(shown);
            }
            Self::Migration(error) => error.map_path(shown),
            Self::NoVoxels | Self::SpaceExists { .. } | Self::NotUserDefined { .. } | Self::ViewsNotStored { .. } => {}
        }
    }
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
