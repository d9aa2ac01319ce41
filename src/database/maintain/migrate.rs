//! Migration of a store of an older format.

use std::path::Path;

use crate::database::handle::Database;
use crate::error::{Error, MaintenanceError};
use crate::migrations::{MigrateOptions, MigrateReport, migrate};

impl Database {
    /// Brings the store at `path` to the current format, one hop per version. A store that is current already is not changed.
    ///
    /// # Errors
    /// [`MaintenanceError::Migration`]; if a hop fails, the store is as it was before that hop.
    pub fn migrate(path: &Path, options: &MigrateOptions) -> Result<MigrateReport, Error> {
        Ok(migrate(path, options).map_err(MaintenanceError::from)?)
    }
}
