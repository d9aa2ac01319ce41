//! Backups: a consistent copy of a store that may be in use.

use std::path::Path;

use serde::Serialize;

use super::verify::verify;
use crate::database::handle::Database;
use crate::error::Error;
use crate::progress::Progress;
use crate::store::{Reads, StoreError};
use crate::volume::display_path;

/// What [`Database::backup`] wrote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct BackupReport {
    /// The number of textures in the copy.
    pub textures: u64,
    /// The revision of the copied state.
    pub revision: u64,
    /// The length of the file in bytes.
    pub bytes: u64,
    /// The path of the file.
    pub file: String,
}

impl Database {
    /// Writes the latest committed state as a store of its own to `path`, where nothing may exist. Other threads and processes
    /// may read and write meanwhile: the copy is of one state. It is verified, with statistics and points recomputed,
    /// before the file gets its name.
    ///
    /// The copy is an ordinary store. To restore it, put it in the place of the damaged one.
    ///
    /// # Errors
    /// [`Error::Cancelled`]; [`Error::Store`] if something exists at `path`, it cannot be written, or this store is damaged.
    /// Then there is no copy.
    pub fn backup(&self, path: &Path, progress: &dyn Progress) -> Result<BackupReport, Error> {
        let snapshot = self.store().read()?;
        let copied = snapshot.copy_to(path, progress, |copy| {
            match verify(copy, false, progress)?.damage.into_iter().next() {
                Some(damage) => Err(Error::Store(StoreError::Damage(damage))),
                None => Ok(()),
            }
        })?;
        Ok(BackupReport {
            textures: snapshot.counts().textures,
            revision: snapshot.revision(),
            bytes: copied.bytes,
            file: display_path(path),
        })
    }
}
