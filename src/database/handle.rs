//! [`Database`]: an open store and what a process keeps of it in memory.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, RwLock};

use super::catalogue::Catalogue;
use super::filter::FilterCache;
use super::points::live::LiveSpaces;
use super::points::statistics_cache::StatisticsCache;
use crate::error::Error;
use crate::store::{Reads, Store};

/// A database of solid textures in one file.
///
/// ```
/// use hlacdb::{Database, Meta, Query, volume::Volume};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("textures.hlacdb");
/// let database = Database::open(&path)?;
/// for step in 1..=8 {
///     let stripes = Volume::from_fn([16, 16, 16], |z, y, x| ((z + y * step + x) * 8) as u8)?;
///     database.add(&stripes, Meta::named(format!("stripes {step}")).tag("family", "stripes"))?;
/// }
/// let like = Volume::from_fn([16, 16, 16], |z, y, x| ((z + y * 3 + x) * 8) as u8)?;
/// let answer = database.query(&Query::volume(&like).k(3).filter("family", "stripes"))?;
/// assert_eq!((answer.hits[0].name.as_str(), answer.hits[0].distance), ("stripes 3", 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Database {
    pub(crate) path: PathBuf,
    pub(crate) store: Store,
    /// The statistics in memory. Writers hold the lock, so that they take turns.
    pub(crate) statistics: Mutex<StatisticsCache>,
    /// The spaces that were queried, with their points.
    pub(crate) spaces: LiveSpaces,
    /// Held while points are loaded, so that several threads that need them load them once.
    pub(crate) loading: Mutex<()>,
    /// The textures that matched the last filters.
    pub(crate) filters: FilterCache,
    /// The newest catalogue that was read.
    pub(crate) catalogue: RwLock<Option<Arc<Catalogue>>>,
    /// Held while a catalogue is read, so that several threads that need it read it once.
    pub(crate) reading_catalogue: Mutex<()>,
}

impl std::fmt::Debug for Database {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Database").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Database {
    /// The path of the store.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The number of textures.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn len(&self) -> Result<u64, Error> {
        Ok(self.store().read()?.counts().textures)
    }

    /// True if there is no texture.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn is_empty(&self) -> Result<bool, Error> {
        Ok(self.len()? == 0)
    }

    pub(crate) fn store(&self) -> &Store {
        &self.store
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_database_can_be_shared_by_threads() {
        fn shared<T: Send + Sync>() {}
        shared::<Database>();
        shared::<Error>();
    }
}
