//! Backups: a consistent copy of a store that may be in use.

use std::path::Path;

use serde::Serialize;

use super::verify::ProgressAdapter;
use crate::database::handle::Database;
use crate::database::open::OpenOptions;
use crate::error::Error;
use crate::progress::Progress;
use crate::store::Reads;
use crate::volume::display_path;

/// What [`Database::backup`] wrote.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct BackupReport {
    /// Textures in the copy.
    pub textures: u64,
    /// The revision it is of.
    pub revision: u64,
    /// The length of the file.
    pub bytes: u64,
    /// The file.
    pub file: String,
}

impl Database {
    /// Writes the newest committed state as a store of its own to `path`, where nothing may be. Others may read and write
    /// meanwhile: the copy is of one moment. It is verified, statistics and points recomputed, before this returns.
    ///
    /// The copy is a store like any other: to go back to it, put it in the place of the store.
    ///
    /// # Errors
    /// [`Error::Cancelled`]; [`Error::Store`] where there is something at `path`, it cannot be written, or this store is
    /// damaged: then there is no copy.
    pub fn backup(&self, path: &Path, progress: &dyn Progress) -> Result<BackupReport, Error> {
        let snapshot = self.store().read()?;
        let mut bridge = ProgressAdapter::new(progress);
        let copied = snapshot.copy_to(path, &mut |step| bridge.tell(step))?;
        let copy = OpenOptions::new().read_only(true).open(path)?;
        let found = copy.verify(false, progress).and_then(|report| match report.damage.into_iter().next() {
            Some(damage) => Err(damage.into_error()),
            None => Ok(()),
        });
        if let Err(error) = found {
            drop(copy);
            // A copy that is not known to be whole is worse than none.
            let _ = std::fs::remove_file(path);
            return Err(error);
        }
        Ok(BackupReport {
            textures: snapshot.counts().textures,
            revision: snapshot.revision(),
            bytes: copied.bytes,
            file: display_path(path),
        })
    }
}
