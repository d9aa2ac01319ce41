//! [`Database`]: what a process holds of an open store.

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
    /// The statistics in memory, and the lock that makes writers take turns.
    pub(crate) statistics: Mutex<StatisticsCache>,
    /// The spaces that were queried.
    pub(crate) spaces: LiveSpaces,
    /// Held while points are loaded, so that several threads that need them load them once.
    pub(crate) loading: Mutex<()>,
    /// The textures that the last filter let through.
    pub(crate) filters: FilterCache,
    /// The newest list of textures that was asked for.
    pub(crate) catalogue: RwLock<Option<Arc<Catalogue>>>,
    /// Held while a list is read, so that threads that ask at once read it once.
    pub(crate) listing: Mutex<()>,
}

impl Database {
    /// Where the store is.
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

    /// True where there is no texture.
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
    fn a_database_is_shared_by_threads() {
        fn shared<T: Send + Sync>() {}
        shared::<Database>();
        shared::<Error>();
    }
}
