//! [`Store`]: the file, open.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::ops::Bound;
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock, RwLockReadGuard};

use redb::backends::FileBackend;
use redb::{
    BackendError, Builder, ConcurrencyMode, Database, ReadOnlyDatabase, ReadableDatabase, StorageBackend,
    WriteTransaction,
};

use crate::store::access::snapshot::{self, Snapshot};
use crate::store::access::tables::Source;
use crate::store::access::transaction::Transaction;
use crate::store::error::Damage;
use crate::store::error::StoreError;
use crate::store::format::codec;
use crate::store::format::frame::{self, Kind};
use crate::store::format::header::Settings;
use crate::store::format::header::{
    FORMAT_VERSION, Header, KEY_FORMAT, KEY_SETTINGS, KEY_STATE, KNOWN_FEATURES, State,
};
use crate::store::format::keys;
use crate::store::open_error::OpenError;
use crate::store::os::lock_owner;
use crate::store::os::panic_boundary::guarded;

/// The first bytes of every file of the engine.
const ENGINE_MAGIC: [u8; 9] = *b"redb\x1A\x0A\xA9\x0D\x0A";

/// How a store is opened. `Options::default()` is what [`Store::open`] uses.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    cache_bytes: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { cache_bytes: Self::DEFAULT_CACHE_BYTES }
    }
}

impl Options {
    /// The default of [`Options::cache_bytes`]: 256 MiB.
    pub const DEFAULT_CACHE_BYTES: usize = 256 << 20;

    /// The memory that the engine may use to cache pages: [`Options::DEFAULT_CACHE_BYTES`] by default.
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
        if path.symlink_metadata().is_ok() {
            return Err(StoreError::Open(OpenError::Exists { path: path.into() }));
        }
        // The store grows under a passing name and gets its own when it is whole: nobody ever sees half of one.
        let passing = passing_name(path);
        let io = |doing| move |source| StoreError::Open(OpenError::Io { doing, path: path.into(), source });
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&passing).map_err(io("creating"))?;
        let made = FileBackend::new(file)
            .map_err(|error| self.refused(path, error))
            .and_then(|backend| self.create_on(path, backend, settings))
            .and_then(|store| match give_name(&passing, path) {
                Ok(()) => Ok(store),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                    Err(StoreError::Open(OpenError::Exists { path: path.into() }))
                }
                Err(source) => Err(StoreError::Open(OpenError::Io { doing: "creating", path: path.into(), source })),
            });
        if made.is_err() {
            // The failure is what matters; a passing file that cannot be removed is harmless.
            let _ = fs::remove_file(&passing);
        }
        made
    }

    /// See [`Store::open`].
    ///
    /// # Errors
    /// See [`Store::open`].
    pub fn open(&self, path: impl AsRef<Path>) -> Result<Store, StoreError> {
        let path = path.as_ref();
        let file = open_file(path, true)?;
        let backend = FileBackend::new(file).map_err(|error| self.refused(path, error))?;
        self.open_on(path, backend)
    }

    /// See [`Store::open_read_only`].
    ///
    /// # Errors
    /// See [`Store::open_read_only`].
    pub fn open_read_only(&self, path: impl AsRef<Path>) -> Result<Store, StoreError> {
        let path = path.as_ref();
        let file = open_file(path, false)?;
        let backend = FileBackend::new(file).map_err(|error| self.refused(path, error))?;
        whole(path, || {
            let opened = self.builder(&backend).open_read_only_with_backend(backend);
            let database = opened.map_err(|error| self.refused(path, error))?;
            check_version(path, &database, false)?;
            Ok(Store { path: path.into(), handle: RwLock::new(Handle::Reader(database)) })
        })
    }

    /// Opens a store that may be damaged, to salvage what is whole: for writing, so that nobody else writes meanwhile, or, where
    /// the engine refuses that, for reading. Its header is not looked at. Use it for [`Store::salvage`] only.
    ///
    /// # Errors
    /// As [`Store::open`], where neither way leads in.
    pub fn open_damaged(&self, path: impl AsRef<Path>) -> Result<Store, StoreError> {
        let path = path.as_ref();
        let opened = |writing: bool| {
            let backend = FileBackend::new(open_file(path, writing)?).map_err(|error| self.refused(path, error))?;
            guarded("(file)", || {
                let builder = self.builder(&backend);
                let handle = match writing {
                    true => builder.create_with_backend(backend).map(Handle::Writer),
                    false => builder.open_read_only_with_backend(backend).map(Handle::Reader),
                };
                let handle = RwLock::new(handle.map_err(|error| self.refused(path, error))?);
                Ok(Store { path: path.into(), handle })
            })
        };
        match opened(true) {
            Err(StoreError::Damage(_) | StoreError::Engine { .. } | StoreError::Open(OpenError::Io { .. })) => {
                opened(false)
            }
            opened => opened,
        }
    }

    /// Creates a store on a backend of the caller's own, which must be empty.
    ///
    /// # Errors
    /// [`StoreError::Engine`].
    pub fn create_with_backend(&self, backend: impl StorageBackend, settings: &Settings) -> Result<Store, StoreError> {
        self.create_on(Path::new("(backend)"), backend, settings)
    }

    /// Opens the store on a backend of the caller's own.
    ///
    /// # Errors
    /// As [`Store::open`].
    pub fn open_with_backend(&self, backend: impl StorageBackend) -> Result<Store, StoreError> {
        self.open_on(Path::new("(backend)"), backend)
    }

    fn create_on(&self, path: &Path, backend: impl StorageBackend, settings: &Settings) -> Result<Store, StoreError> {
        let database =
            self.builder(&backend).create_with_backend(backend).map_err(|error| self.refused(path, error))?;
        write_empty(&database, settings)?;
        Ok(Store { path: path.into(), handle: RwLock::new(Handle::Writer(database)) })
    }

    fn open_on(&self, path: &Path, backend: impl StorageBackend) -> Result<Store, StoreError> {
        whole(path, || {
            let opened = self.builder(&backend).create_with_backend(backend);
            let database = opened.map_err(|error| self.refused(path, error))?;
            check_version(path, &database, true)?;
            Ok(Store { path: path.into(), handle: RwLock::new(Handle::Writer(database)) })
        })
    }

    /// One writer and any number of readers, where the backend can lock; else (memory) the writer alone.
    fn builder(&self, backend: &impl StorageBackend) -> Builder {
        let byte = Bound::Included(1 << 62);
        let locks = !matches!(backend.query_lock_range(byte, byte), Err(BackendError::Unsupported));
        let mode = if locks { ConcurrencyMode::SingleWriter } else { ConcurrencyMode::ExclusiveWriter };
        let mut builder = Builder::new();
        builder.set_concurrency_mode(mode).set_cache_size(self.cache_bytes);
        builder
    }

    /// Why the engine did not open the file.
    fn refused(&self, path: &Path, error: redb::DatabaseError) -> StoreError {
        let path = path.to_path_buf();
        match error {
            redb::DatabaseError::DatabaseAlreadyOpen | redb::DatabaseError::LockProtocolMismatch => {
                StoreError::Open(OpenError::HeldByWriter { holder: lock_owner::of(&path), path })
            }
            redb::DatabaseError::RepairAborted => StoreError::Open(OpenError::NeedsRepair { path }),
            redb::DatabaseError::UpgradeRequired(version) => {
                StoreError::Open(OpenError::NotAStore { path, found: format!("a redb file of format {version}") })
            }
            redb::DatabaseError::Storage(redb::StorageError::Unsupported) => {
                StoreError::Open(OpenError::NoLocks { path })
            }
            redb::DatabaseError::Storage(redb::StorageError::Io(source)) => {
                StoreError::Open(OpenError::Io { doing: "opening", path, source })
            }
            other => StoreError::engine("opening the store", other),
        }
    }
}

/// A store, open: one file of textures and what is derived from them.
///
/// One handle at a time, in any process, has it open for writing; any number have it open read-only, and each of their
/// snapshots sees the writer's latest commit. A handle is shared by threads. Dropping it closes the file.
///
/// ```
/// use hlacdb::store::{NewTexture, Reads, Settings, Store};
/// # let dir = std::env::temp_dir().join(format!("hlacdb-doc-{}", std::process::id()));
/// # std::fs::create_dir_all(&dir)?;
/// let path = dir.join("textures.hlacdb");
/// let store = Store::create(&path, &Settings::default())?;
/// let mut transaction = store.write()?;
/// let id = transaction.add(NewTexture { name: "marble".into(), ..NewTexture::default() })?;
/// transaction.set_tag(id, "family", "stone")?;
/// transaction.commit()?;
/// assert_eq!(store.read()?.tagged("family", "stone")?, [id]);
/// # drop(store);
/// # std::fs::remove_dir_all(&dir)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Store {
    path: PathBuf,
    handle: RwLock<Handle>,
}

enum Handle {
    Writer(Database),
    Reader(ReadOnlyDatabase),
}

impl Store {
    /// Creates a store where there is no file, and opens it for writing. The file appears whole or not at all.
    ///
    /// # Errors
    /// [`OpenError::Exists`], [`OpenError::Io`], [`OpenError::NoLocks`].
    pub fn create(path: impl AsRef<Path>, settings: &Settings) -> Result<Self, StoreError> {
        Options::default().create(path, settings)
    }

    /// Opens a store for writing, and recovers it first where a crash left it. Creates nothing.
    ///
    /// # Errors
    /// [`OpenError::NoStore`], [`OpenError::NotAStore`], [`OpenError::Newer`],
    /// [`OpenError::UnknownFeatures`], [`OpenError::NeedsMigration`], [`OpenError::HeldByWriter`],
    /// [`OpenError::NoLocks`], [`StoreError::Damage`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, StoreError> {
        Options::default().open(path)
    }

    /// Opens a store for reading beside any writer. Writes nothing.
    ///
    /// # Errors
    /// As [`Store::open`], except that a writer is no hindrance; [`OpenError::NeedsRepair`] after a crash of the writer.
    pub fn open_read_only(path: impl AsRef<Path>) -> Result<Self, StoreError> {
        Options::default().open_read_only(path)
    }

    /// Options for opening.
    pub fn options() -> Options {
        Options::default()
    }

    /// The path as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether this handle is for reading only.
    pub fn is_read_only(&self) -> bool {
        matches!(*self.handle(), Handle::Reader(_))
    }

    /// The latest committed state.
    ///
    /// # Errors
    /// [`StoreError::Damage`], [`StoreError::Engine`].
    pub fn read(&self) -> Result<Snapshot, StoreError> {
        match &*self.handle() {
            Handle::Writer(database) => Snapshot::take(database),
            Handle::Reader(database) => Snapshot::take(database),
        }
    }

    /// Begins changes. Waits while another transaction of this handle is open: do not begin two on one thread.
    ///
    /// # Errors
    /// [`StoreError::ReadOnly`], [`StoreError::Poisoned`].
    pub fn write(&self) -> Result<Transaction, StoreError> {
        Transaction::new(self.begin()?)
    }

    fn handle(&self) -> RwLockReadGuard<'_, Handle> {
        // Nothing that holds the lock leaves the handle half-changed, so a panic elsewhere does not matter.
        self.handle.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Hands the engine's handle, whichever it is, to one of two closures.
    pub(in crate::store) fn with_engine<T>(
        &self,
        writer: impl FnOnce(&Database) -> Result<T, StoreError>,
        reader: impl FnOnce(&ReadOnlyDatabase) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        guarded("(file)", || match &*self.handle() {
            Handle::Writer(database) => writer(database),
            Handle::Reader(database) => reader(database),
        })
    }

    /// Begins changes of the bare tables.
    pub(in crate::store) fn begin(&self) -> Result<WriteTransaction, StoreError> {
        let Handle::Writer(database) = &*self.handle() else { return Err(StoreError::ReadOnly) };
        begin_write(database)
    }

    /// Moves all pages to the front of the file and cuts off the rest.
    pub(in crate::store) fn compact_pages(&self) -> Result<(), StoreError> {
        let mut handle = self.handle.write().unwrap_or_else(PoisonError::into_inner);
        let Handle::Writer(database) = &mut *handle else { return Err(StoreError::ReadOnly) };
        guarded("(file)", || {
            // Each round may free what the next one can move into.
            while database.compact().map_err(StoreError::when("compaction"))? {}
            Ok(())
        })
    }
}

impl std::fmt::Debug for Store {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Store").field("path", &self.path).finish_non_exhaustive()
    }
}

/// A write transaction whose commit is durable, and after whose crash the store opens at once.
fn begin_write(database: &Database) -> Result<WriteTransaction, StoreError> {
    let mut transaction = database.begin_write().map_err(StoreError::when("beginning a transaction"))?;
    transaction.set_quick_repair(true);
    Ok(transaction)
}

/// Makes every table and the three entries of `meta`, in one commit.
fn write_empty(database: &Database, settings: &Settings) -> Result<(), StoreError> {
    let transaction = begin_write(database)?;
    let state = State { revision: 1, ..State::EMPTY };
    let too_long = || StoreError::invalid("the settings are too long");
    let state = codec::encode(&state).ok_or_else(too_long)?;
    let settings = codec::encode(settings).ok_or_else(too_long)?;
    {
        let mut meta = transaction.open_table(keys::META).map_err(StoreError::when("creating a table"))?;
        let entries = [
            (KEY_FORMAT, Header::CURRENT.encode().to_vec()),
            (KEY_STATE, frame::seal(Kind::State, KEY_STATE, &state)),
            (KEY_SETTINGS, frame::seal(Kind::Settings, KEY_SETTINGS, &settings)),
        ];
        for (key, value) in entries {
            meta.insert(key, &value[..]).map_err(StoreError::when("writing the store"))?;
        }
    }
    keys::create_all(&transaction).map_err(StoreError::when("creating a table"))?;
    transaction.commit().map_err(StoreError::when("committing"))
}

/// Opens something; damage that is met so early is told of the whole file, by its name.
fn whole(path: &Path, open: impl FnOnce() -> Result<Store, StoreError>) -> Result<Store, StoreError> {
    let torn = |what: String| {
        StoreError::Open(OpenError::DamagedFile {
            path: path.into(),
            damage: Damage { table: "(file)", key: String::new(), what },
        })
    };
    guarded("(file)", open).map_err(|error| match error {
        StoreError::Damage(damage) => StoreError::Open(OpenError::DamagedFile { path: path.into(), damage }),
        // The engine asks for bytes that are not there: the file is shorter than it says.
        StoreError::Open(OpenError::Io { source, .. }) if source.kind() == io::ErrorKind::UnexpectedEof => {
            torn("it ends early".into())
        }
        StoreError::Engine { source, .. } => torn(source.to_string()),
        other => other,
    })
}

/// Refuses what is no store, and stores of other formats.
fn check_version(path: &Path, database: &impl ReadableDatabase, writing: bool) -> Result<(), StoreError> {
    let path = path.to_path_buf();
    let transaction = database.begin_read().map_err(StoreError::when("opening the store"))?;
    let source = Source::Read(&transaction);
    let foreign = || {
        StoreError::Open(OpenError::NotAStore { path: path.clone(), found: "a redb file of another program".into() })
    };
    let meta = source.table(keys::META).map_err(|_| foreign())?;
    if meta.get(KEY_FORMAT)?.is_none() {
        return Err(foreign());
    }
    drop(meta);
    let header = snapshot::read_header(source)?;
    let lowest = if writing { header.version } else { header.minimum_reader };
    if lowest > FORMAT_VERSION {
        return Err(StoreError::Open(OpenError::Newer { path, found: header.version, supported: FORMAT_VERSION }));
    }
    if header.version < FORMAT_VERSION {
        return Err(StoreError::Open(OpenError::NeedsMigration {
            path,
            found: header.version,
            current: FORMAT_VERSION,
        }));
    }
    match header.features & !KNOWN_FEATURES {
        0 => Ok(()),
        unknown => Err(StoreError::Open(OpenError::UnknownFeatures { path, unknown })),
    }
}

/// The file at `path`, if it looks like one of the engine's; nothing is created.
fn open_file(path: &Path, writing: bool) -> Result<File, StoreError> {
    let io = |source| StoreError::Open(OpenError::Io { doing: "opening", path: path.into(), source });
    let foreign = |found: String| StoreError::Open(OpenError::NotAStore { path: path.into(), found });
    // A FIFO would block the open below, so the kind is asked first.
    let kind = fs::metadata(path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => StoreError::Open(OpenError::NoStore { path: path.into() }),
        _ => io(source),
    })?;
    if kind.is_dir() {
        return Err(foreign("it is a folder".into()));
    }
    if !kind.is_file() {
        return Err(foreign("it is no regular file".into()));
    }
    let mut file = OpenOptions::new().read(true).write(writing).open(path).map_err(io)?;
    let mut head = Vec::new();
    Read::by_ref(&mut file).take(ENGINE_MAGIC.len() as u64).read_to_end(&mut head).map_err(io)?;
    if head.is_empty() {
        return Err(foreign("it is an empty file".into()));
    }
    if head != ENGINE_MAGIC {
        return Err(foreign(format!("it begins with \"{}\"", head.escape_ascii())));
    }
    Ok(file)
}

/// The name under which a store grows until it is whole: beside its own, so that one file system holds both.
pub(in crate::store) fn passing_name(path: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.creating", std::process::id()));
    path.with_file_name(name)
}

/// Gives the file its own name, unless there is something of that name already.
pub(in crate::store) fn give_name(passing: &Path, path: &Path) -> io::Result<()> {
    match fs::hard_link(passing, path) {
        Ok(()) => fs::remove_file(passing)?,
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Err(error),
        // A file system without hard links: the check in `create` is all there is.
        Err(_) => fs::rename(passing, path)?,
    }
    // The new name must outlive a power cut as well. Not every system lets a folder be opened or synced.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match File::open(folder) {
        Ok(folder) => folder.sync_all().or(Ok(())),
        Err(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn handles_and_snapshots_are_shared_by_threads() {
        fn shared<T: Send + Sync + 'static>() {}
        fn sent<T: Send + 'static>() {}
        shared::<Store>();
        shared::<Snapshot>();
        shared::<StoreError>();
        sent::<Transaction>();
    }
}
