//! Migrations: stores of older formats are brought to the current one, one hop per format version.
//!
//! Vocabulary: the *stamp* is the 32-byte header entry of a store, which has the same layout in every version; a *hop* takes
//! a store from one version to the next. It rewrites data and stamp in one transaction, so that an interrupted migration
//! can be run again. The chain of hops is chosen here, never by the caller.
//!
//! A hop writes the layout of the version it leads to with code and types of its own, which never change again. Hops reject
//! invalid data; they repair nothing.

mod error;
mod stamp;
mod v0_to_v1;

pub use error::MigrationError;

use std::fs::{self, File, OpenOptions};
use std::io::Read;
use std::path::{Path, PathBuf};

use redb::backends::FileBackend;
use redb::{Builder, ConcurrencyMode, Database, ReadableDatabase, WriteTransaction};

use stamp::Stamp;

/// The version that the last hop leads to: the one that the store reads and writes.
pub const CURRENT_VERSION: u32 = HOPS.len() as u32;

/// One hop. The n-th leads from version n to n + 1.
struct Hop {
    what: &'static str,
    run: fn(&WriteTransaction) -> Result<(), MigrationError>,
}

const HOPS: &[Hop] = &[Hop { what: "items become framed records, rows and descriptor blocks", run: v0_to_v1::run }];

/// What `migrate` may do.
#[derive(Clone, Debug, Default)]
pub struct MigrateOptions {
    check_only: bool,
    backup: Option<PathBuf>,
}

impl MigrateOptions {
    /// Migrates without a backup.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether to report only the hops that would be run, and write nothing.
    #[must_use]
    pub fn check_only(mut self, check_only: bool) -> Self {
        self.check_only = check_only;
        self
    }

    /// Copies the store to this path first, where nothing may exist.
    #[must_use]
    pub fn backup(mut self, path: impl Into<PathBuf>) -> Self {
        self.backup = Some(path.into());
        self
    }
}

/// What `migrate` did, or would do with `check_only`.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MigrateReport {
    /// The version that the store had.
    pub from: u32,
    /// The version that it has now.
    pub to: u32,
    /// What each hop does, in order; empty if the store was current.
    pub hops: Vec<&'static str>,
    /// The backup that was written.
    pub backup: Option<PathBuf>,
}

/// Brings the store at `path` to the current format. A store that is current already is not changed.
///
/// # Errors
/// [`MigrationError`]; if a hop fails, the store is as it was before that hop.
pub fn migrate(path: &Path, options: &MigrateOptions) -> Result<MigrateReport, MigrationError> {
    let from = version(path, options.check_only)?;
    let hops = HOPS.get(from as usize..).unwrap_or_default();
    let mut report =
        MigrateReport { from, to: CURRENT_VERSION, hops: hops.iter().map(|hop| hop.what).collect(), backup: None };
    if options.check_only || hops.is_empty() {
        return Ok(report);
    }
    let database = open(path)?;
    if let Some(backup) = &options.backup {
        back_up(path, backup)?;
        report.backup = Some(backup.clone());
    }
    run_hops(database, from)?;
    Ok(report)
}

/// As [`migrate`], for a store on a storage backend: for tests of crashes.
///
/// # Errors
/// As [`migrate`].
pub fn migrate_with_backend(backend: impl redb::StorageBackend) -> Result<(), MigrationError> {
    let path = Path::new("(backend)");
    let mut builder = Builder::new();
    builder.set_concurrency_mode(ConcurrencyMode::ExclusiveWriter);
    let database = builder.create_with_backend(backend).map_err(|error| MigrationError::opening(path, error))?;
    let stamp = stamp::read_committed(path, &database.begin_read().map_err(MigrationError::engine)?)?;
    if stamp.version > CURRENT_VERSION {
        return Err(MigrationError::Newer { path: path.into(), found: stamp.version, supported: CURRENT_VERSION });
    }
    run_hops(database, stamp.version)
}

/// Runs every hop from version `from` on, each in a transaction, and closes the store.
fn run_hops(database: Database, from: u32) -> Result<(), MigrationError> {
    for (number, hop) in (from..).zip(HOPS.get(from as usize..).unwrap_or_default()) {
        let mut transaction = database.begin_write().map_err(MigrationError::engine)?;
        transaction.set_quick_repair(true);
        // The lock has been held since `open`; the stamp is read again where it is replaced all the same.
        let stamp = stamp::read(&transaction)?;
        if stamp.version != number {
            return Err(MigrationError::invalid(
                "meta",
                "format",
                format!("version {}, expected {number}", stamp.version),
            ));
        }
        (hop.run)(&transaction)?;
        stamp::write(&transaction, Stamp { version: number + 1, minimum_reader: number + 1, features: 0 })?;
        transaction.commit().map_err(MigrationError::engine)?;
        tracing::info!(from = number, to = number + 1, "migrated: {}", hop.what);
    }
    database.close().map_err(MigrationError::engine)
}

/// The version of the store at `path`.
fn version(path: &Path, check_only: bool) -> Result<u32, MigrationError> {
    check_magic(path)?;
    let stamp = if check_only {
        let database = builder().open_read_only(path).map_err(|error| MigrationError::opening(path, error))?;
        stamp::read_committed(path, &database.begin_read().map_err(MigrationError::engine)?)?
    } else {
        // For writing, so that a store that a crash has left is recovered.
        let database = open(path)?;
        stamp::read_committed(path, &database.begin_read().map_err(MigrationError::engine)?)?
    };
    if stamp.version > CURRENT_VERSION {
        return Err(MigrationError::Newer { path: path.into(), found: stamp.version, supported: CURRENT_VERSION });
    }
    Ok(stamp.version)
}

fn builder() -> Builder {
    let mut builder = Builder::new();
    builder.set_concurrency_mode(ConcurrencyMode::SingleWriter).set_cache_size(256 << 20);
    builder
}

fn open(path: &Path) -> Result<Database, MigrationError> {
    let io = |source| MigrationError::Io { doing: "opening", path: path.into(), source };
    let file = OpenOptions::new().read(true).write(true).open(path).map_err(io)?;
    FileBackend::new(file)
        .and_then(|backend| builder().create_with_backend(backend))
        .map_err(|error| MigrationError::opening(path, error))
}

/// Rejects a file that does not begin as those of the engine do: opening it for writing might initialise it.
fn check_magic(path: &Path) -> Result<(), MigrationError> {
    let io = |source| MigrationError::Io { doing: "opening", path: path.into(), source };
    let mut head = Vec::new();
    if fs::metadata(path).map_err(io)?.is_file() {
        File::open(path).and_then(|file| file.take(9).read_to_end(&mut head)).map_err(io)?;
    }
    match head == *b"redb\x1A\x0A\xA9\x0D\x0A" {
        true => Ok(()),
        false => Err(MigrationError::NotAStore { path: path.into() }),
    }
}

/// Copies the store while the lock is held, and opens the copy once to check that it is complete.
fn back_up(path: &Path, backup: &Path) -> Result<(), MigrationError> {
    let io = |source| MigrationError::Io { doing: "writing the backup", path: backup.into(), source };
    let mut from = File::open(path).map_err(io)?;
    let mut to = OpenOptions::new().write(true).create_new(true).open(backup).map_err(io)?;
    std::io::copy(&mut from, &mut to).and_then(|_| to.sync_all()).map_err(io)?;
    drop(to);
    open(backup)?.close().map_err(MigrationError::engine)
}
