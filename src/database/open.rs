//! [`OpenOptions`]: how a database is opened and created.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, RwLock};

use super::filter::FilterCache;
use super::handle::Database;
use super::points::live::LiveSpaces;
use super::points::statistics_cache::StatisticsCache;
use crate::error::Error;
use crate::hlac::View;
use crate::store::{OpenError, Settings, Store, StoreOptions, ViewCode, Volumes};

/// How a database is opened, and how a new store is created.
///
/// ```no_run
/// use hlacdb::OpenOptions;
/// let database = OpenOptions::new().read_only(true).open("textures.hlacdb")?;
/// # Ok::<(), hlacdb::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct OpenOptions {
    read_only: bool,
    create: bool,
    views: Vec<View>,
    volumes: Volumes,
    cache_bytes: usize,
}

impl Default for OpenOptions {
    fn default() -> Self {
        let views = View::STANDARD.to_vec();
        let cache_bytes = Self::DEFAULT_CACHE_BYTES;
        Self { read_only: false, create: true, views, volumes: Volumes::Keep, cache_bytes }
    }
}

impl OpenOptions {
    /// The default of [`OpenOptions::cache_bytes`].
    ///
    /// ```
    /// assert_eq!(hlacdb::OpenOptions::DEFAULT_CACHE_BYTES, 256 << 20);
    /// ```
    pub const DEFAULT_CACHE_BYTES: usize = StoreOptions::DEFAULT_CACHE_BYTES;

    /// For reading and writing. A store is created if there is none, with the default views and with voxels.
    pub fn new() -> Self {
        Self::default()
    }

    /// Opens for reading only. Any number of processes may read while one writes, and they see its commits. The default is
    /// false.
    #[must_use]
    pub fn read_only(mut self, read_only: bool) -> Self {
        self.read_only = read_only;
        self
    }

    /// Whether a store is created if there is none. The default is true; a read-only database never creates one.
    #[must_use]
    pub fn create(mut self, create: bool) -> Self {
        self.create = create;
        self
    }

    /// The views of a new store. An existing store keeps those it was created with.
    #[must_use]
    pub fn views(mut self, views: &[View]) -> Self {
        self.views = views.to_vec();
        self
    }

    /// Whether a new store keeps voxels. An existing store keeps its setting.
    #[must_use]
    pub fn volumes(mut self, volumes: Volumes) -> Self {
        self.volumes = volumes;
        self
    }

    /// The memory, in bytes, that may be used to cache pages of the file. The default is
    /// [`OpenOptions::DEFAULT_CACHE_BYTES`], 256 MiB.
    #[must_use]
    pub fn cache_bytes(mut self, bytes: usize) -> Self {
        self.cache_bytes = bytes;
        self
    }

    /// Opens the store at `path`.
    ///
    /// # Errors
    /// [`Error::Open`]: there is no store and none is to be created; the file is not a store, or has a newer or older
    /// format; another writer has it open; or (read-only) it must be recovered first ([`Error::needs_repair`]).
    pub fn open(&self, path: impl AsRef<Path>) -> Result<Database, Error> {
        let path = path.as_ref();
        let options = self.store_options();
        let exists = path.try_exists().map_err(|source| Error::file("opening", path, source))?;
        let store = match (exists, self.read_only, self.create) {
            (true, true, _) => options.open_read_only(path)?,
            (true, false, _) => options.open(path)?,
            (false, false, true) => options.create(path, &self.settings())?,
            (false, ..) => return Err(OpenError::NoStore { path: path.to_path_buf() }.into()),
        };
        Ok(Self::database(path, store))
    }

    /// Opens the store in a storage backend, or creates one if the backend is empty. Tests simulate faulty disks in this way.
    ///
    /// # Errors
    /// As [`OpenOptions::open`].
    #[cfg(feature = "unstable-internals")]
    #[doc(hidden)]
    pub fn open_with_backend(&self, backend: impl redb::StorageBackend) -> Result<Database, Error> {
        let empty = backend.len().map_err(|source| Error::io("reading the length of the backend", source))? == 0;
        let options = self.store_options();
        let store = match empty {
            true => options.create_with_backend(backend, &self.settings())?,
            false => options.open_with_backend(backend)?,
        };
        Ok(Self::database(Path::new("(backend)"), store))
    }

    fn store_options(&self) -> StoreOptions {
        StoreOptions::default().cache_bytes(self.cache_bytes)
    }

    fn database(path: &Path, store: Store) -> Database {
        Database {
            path: path.to_path_buf(),
            store,
            statistics: Mutex::new(StatisticsCache::default()),
            spaces: LiveSpaces::default(),
            loading: Mutex::new(()),
            filters: FilterCache::default(),
            catalogue: RwLock::default(),
            reading_catalogue: Mutex::new(()),
        }
    }

    fn settings(&self) -> Settings {
        let views = self.views.iter().map(|view| ViewCode(view.code())).collect();
        Settings { views, volumes: self.volumes, further: BTreeMap::new() }
    }
}

impl Database {
    /// Opens the store at `path` for reading and writing, and creates it if there is none. [`OpenOptions`] has other ways
    /// to open it.
    ///
    /// # Errors
    /// [`Error::Open`]: the file is not a store, has a newer or older format, or is open for writing elsewhere.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, Error> {
        OpenOptions::new().open(path)
    }
}
