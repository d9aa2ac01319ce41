//! Creating and opening stores.

use std::fs::File;
use std::io;
use std::ops::Bound;
use std::path::Path;

use redb::backends::FileBackend;
use redb::{BackendError, Builder, ConcurrencyMode, StorageBackend};

use crate::store::access::handle::{Handle, Store};
use crate::store::access::meta;
use crate::store::damage::{Damage, DamageKey, FILE};
use crate::store::error::StoreError;
use crate::store::format::header::Settings;
use crate::store::open_error::OpenError;
use crate::store::os::panic_boundary::contained;
use crate::store::os::{files, lock_owner};

const OPENING: &str = "opening the store";

/// How a store is opened. [`Store::open`] uses the default.
#[derive(Clone, Copy, Debug)]
pub struct StoreOptions {
    cache_bytes: usize,
}

impl Default for StoreOptions {
    fn default() -> Self {
        Self { cache_bytes: Self::DEFAULT_CACHE_BYTES }
    }
}

impl StoreOptions {
    /// The default of [`StoreOptions::cache_bytes`]: 256 MiB.
    pub const DEFAULT_CACHE_BYTES: usize = 256 << 20;

    /// The memory that the engine may use to cache pages, in bytes; [`StoreOptions::DEFAULT_CACHE_BYTES`] by default.
    #[must_use]
    pub fn cache_bytes(mut self, bytes: usize) -> Self {
        self.cache_bytes = bytes;
        self
    }

    /// See [`Store::create`].
    ///
    /// # Errors
    /// See [`Store::create`].
    pub fn create(&self, path: impl AsRef<Path>, settings: &Settings) -> Result<Store, StoreError> {
        let path = path.as_ref();
        files::create_whole(path, |file| self.create_in(path, file, settings))
    }

    /// See [`Store::open`].
    ///
    /// # Errors
    /// See [`Store::open`].
    pub fn open(&self, path: impl AsRef<Path>) -> Result<Store, StoreError> {
        let path = path.as_ref();
        let backend = self.file_backend(path, files::open(path, true)?)?;
        self.open_on(path, backend)
    }

    /// See [`Store::open_read_only`].
    ///
    /// # Errors
    /// See [`Store::open_read_only`].
    pub fn open_read_only(&self, path: impl AsRef<Path>) -> Result<Store, StoreError> {
        let path = path.as_ref();
        let backend = self.file_backend(path, files::open(path, false)?)?;
        whole(path, || {
            let handle = self.reader(path, backend)?;
            if let Handle::Reader(database) = &handle {
                meta::check_version(path, database, false)?;
            }
            Ok(Store::new(path, handle))
        })
    }

    /// Opens a store that may be damaged, without reading its header: for writing, so that nobody else writes meanwhile,
    /// or read-only if the engine refuses that. Use it for [`Store::salvage`] only.
    ///
    /// # Errors
    /// As [`Store::open`], if the file can be opened in neither way.
    pub fn open_damaged(&self, path: impl AsRef<Path>) -> Result<Store, StoreError> {
        let path = path.as_ref();
        let opened = |writing: bool| {
            let backend = self.file_backend(path, files::open(path, writing)?)?;
            let handle = if writing { self.writer(path, backend) } else { self.reader(path, backend) };
            Ok(Store::new(path, handle?))
        };
        match opened(true) {
            Err(StoreError::Damage(_) | StoreError::Engine { .. } | StoreError::Open(OpenError::Io { .. })) => {
                opened(false)
            }
            opened => opened,
        }
    }

    /// Creates a store on a storage backend, which must be empty.
    ///
    /// # Errors
    /// [`StoreError::Engine`].
    pub fn create_with_backend(&self, backend: impl StorageBackend, settings: &Settings) -> Result<Store, StoreError> {
        self.create_on(Path::new("(backend)"), backend, settings)
    }

    /// Opens the store on a storage backend.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_with_backend(&self, backend: impl StorageBackend) -> Result<Store, StoreError> {
        self.open_on(Path::new("(backend)"), backend)
    }

    /// Creates a store in an empty file, which will be named `path`.
    pub(in crate::store) fn create_in(
        &self,
        path: &Path,
        file: File,
        settings: &Settings,
    ) -> Result<Store, StoreError> {
        self.create_on(path, self.file_backend(path, file)?, settings)
    }

    fn create_on(&self, path: &Path, backend: impl StorageBackend, settings: &Settings) -> Result<Store, StoreError> {
        let handle = self.writer(path, backend)?;
        if let Handle::Writer(database) = &handle {
            meta::write_new(database, settings)?;
        }
        Ok(Store::new(path, handle))
    }

    fn open_on(&self, path: &Path, backend: impl StorageBackend) -> Result<Store, StoreError> {
        whole(path, || {
            let handle = self.writer(path, backend)?;
            if let Handle::Writer(database) = &handle {
                meta::check_version(path, database, true)?;
            }
            Ok(Store::new(path, handle))
        })
    }

    fn file_backend(&self, path: &Path, file: File) -> Result<FileBackend, StoreError> {
        FileBackend::new(file).map_err(|error| refused(path, error))
    }

    fn writer(&self, path: &Path, backend: impl StorageBackend) -> Result<Handle, StoreError> {
        let builder = self.builder(&backend);
        // The result of the engine passes the boundary as it is, so that an error keeps its type.
        let opened = contained(FILE, OPENING, || Ok::<_, redb::Error>(builder.create_with_backend(backend)))?;
        opened.map(Handle::Writer).map_err(|error| refused(path, error))
    }

    fn reader(&self, path: &Path, backend: impl StorageBackend) -> Result<Handle, StoreError> {
        let builder = self.builder(&backend);
        let opened = contained(FILE, OPENING, || Ok::<_, redb::Error>(builder.open_read_only_with_backend(backend)))?;
        opened.map(Handle::Reader).map_err(|error| refused(path, error))
    }

    /// One writer and any number of readers if the backend can lock; the writer alone if it cannot (memory).
    fn builder(&self, backend: &impl StorageBackend) -> Builder {
        let byte = Bound::Included(1 << 62);
        let locks = !matches!(backend.query_lock_range(byte, byte), Err(BackendError::Unsupported));
        let mode = if locks { ConcurrencyMode::SingleWriter } else { ConcurrencyMode::ExclusiveWriter };
        let mut builder = Builder::new();
        builder.set_concurrency_mode(mode).set_cache_size(self.cache_bytes);
        builder
    }
}

impl Store {
    /// Creates a store where there is no file, and opens it for writing. The file appears whole or not at all.
    ///
    /// # Errors
    /// [`OpenError::Exists`], [`OpenError::Io`], [`OpenError::NoLocks`].
    pub fn create(path: impl AsRef<Path>, settings: &Settings) -> Result<Self, StoreError> {
        StoreOptions::default().create(path, settings)
    }

    /// Opens a store for writing, and recovers it first if a crash has left it. Creates nothing.
    ///
    /// # Errors
    /// [`OpenError::Io`] if there is no file, [`OpenError::NotAStore`], [`OpenError::Newer`],
    /// [`OpenError::UnknownFeatures`], [`OpenError::NeedsMigration`], [`OpenError::HeldByWriter`],
    /// [`OpenError::NoLocks`], [`OpenError::DamagedFile`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, StoreError> {
        StoreOptions::default().open(path)
    }

    /// Opens a store for reading beside any writer. Writes nothing.
    ///
    /// # Errors
    /// As [`Store::open`], except that a writer does no harm; [`OpenError::NeedsRepair`] after a crash of the writer.
    pub fn open_read_only(path: impl AsRef<Path>) -> Result<Self, StoreError> {
        StoreOptions::default().open_read_only(path)
    }

    /// The default options.
    pub fn options() -> StoreOptions {
        StoreOptions::default()
    }
}

/// Opens something. Damage that is found while opening is reported as damage of the file at `path`.
fn whole(path: &Path, open: impl FnOnce() -> Result<Store, StoreError>) -> Result<Store, StoreError> {
    let damaged = |damage| StoreError::from(OpenError::DamagedFile { path: path.into(), damage });
    let torn = |what: String| damaged(Damage::new(FILE, DamageKey::Whole, what));
    open().map_err(|error| match error {
        StoreError::Damage(damage) => damaged(damage),
        // The engine reads beyond the end: the file is shorter than its header says.
        StoreError::Open(OpenError::Io { source, .. }) if source.kind() == io::ErrorKind::UnexpectedEof => {
            torn("it ends early".into())
        }
        StoreError::Engine { source, .. } => torn(source.to_string()),
        other => other,
    })
}

/// Why the engine did not open the file.
fn refused(path: &Path, error: redb::DatabaseError) -> StoreError {
    let path = path.to_path_buf();
    let error = match error {
        redb::DatabaseError::DatabaseAlreadyOpen | redb::DatabaseError::LockProtocolMismatch => {
            OpenError::HeldByWriter { owner: lock_owner::of(&path), path }
        }
        redb::DatabaseError::RepairAborted => OpenError::NeedsRepair { path },
        redb::DatabaseError::UpgradeRequired(version) => {
            OpenError::NotAStore { path, found: format!("a redb file of format {version}") }
        }
        redb::DatabaseError::Storage(redb::StorageError::Unsupported) => OpenError::NoLocks { path },
        redb::DatabaseError::Storage(redb::StorageError::Io(source)) => {
            OpenError::Io { doing: "opening", path, source }
        }
        other => return StoreError::engine(FILE, OPENING, other),
    };
    error.into()
}
