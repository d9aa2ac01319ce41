//! [`Hint`]: the kind of remedy for an error.

use std::fmt;

use super::{Error, ExchangeError, IngestError, MaintenanceError, QueryError};
use crate::migrations::MigrationError;
use crate::space::SpaceError;
use crate::store::{OpenError, StoreError};
use crate::volume::Hint as ReadHint;

/// What can be done about an [`Error`].
///
/// Errors state facts. What to do about them depends on where the library is used: the program names a flag, a server its
/// settings, a library user a method. The display of a hint is a remedy that names none of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Hint {
    /// Create a store, or give the path of another one.
    CreateStore,
    /// Give another path, or remove what is there.
    ChooseAnotherPath,
    /// Use a newer version of hlacdb.
    UpgradeHlacdb,
    /// Migrate the store to the current format.
    MigrateStore,
    /// Wait for the writer or end it. The store can be opened read-only in the meantime.
    WaitForWriter,
    /// Open the store for writing once.
    OpenForWriting,
    /// Move the store to a local disk.
    UseLocalDisk,
    /// Close other readers and try again.
    CloseReaders,
    /// Repair the store, or restore a backup.
    RepairStore,
    /// Restore a backup, or ingest the volumes into a new store.
    RestoreBackup,
    /// Close the store and open it again.
    ReopenStore,
    /// List the textures to find the id.
    ListTextures,
    /// Query in a space that uses other views, or give moments of the views that are missing.
    ChooseSpace,
    /// Give the space another name, or remove the one that has it. Built-in spaces cannot be removed.
    RenameSpace,
    /// Tag textures with this key, or evaluate another tag.
    TagTextures,
    /// Evaluate another tag, or add textures with other values of this one.
    ChooseLabel,
    /// Cut the volumes into smaller blocks.
    SmallerBlock,
    /// Give a path inside the folder.
    StayInFolder,
    /// Reindex the store: statistics, spaces and points are rebuilt.
    Reindex,
    /// Import a folder or tar file that was exported from a store.
    UseArchive,
    /// Keep the voxels of textures when they are ingested.
    KeepVoxels,
    /// What to do about a file that could not be read.
    Read(ReadHint),
}

impl fmt::Display for Hint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::CreateStore => "create a store, or give the path of another one",
            Self::ChooseAnotherPath => "give another path, or remove what is there",
            Self::UpgradeHlacdb => "use a newer version of hlacdb",
            Self::MigrateStore => "migrate the store",
            Self::WaitForWriter => "wait for the writer or end it; the store can be read in the meantime",
            Self::OpenForWriting => "open the store for writing",
            Self::UseLocalDisk => "move the store to a local disk",
            Self::CloseReaders => "close other readers and try again",
            Self::RepairStore => "repair the store, or restore a backup",
            Self::RestoreBackup => "restore a backup, or ingest the volumes into a new store",
            Self::ReopenStore => "close the store and open it again",
            Self::ListTextures => "list the textures to find the id",
            Self::ChooseSpace => "choose another space",
            Self::RenameSpace => "choose another name, or remove that space unless it is built in",
            Self::TagTextures => "tag textures with this key, or choose another tag",
            Self::ChooseLabel => "choose another tag, or add textures with other values",
            Self::SmallerBlock => "use smaller blocks",
            Self::StayInFolder => "give a path inside the folder",
            Self::Reindex => "reindex the store",
            Self::UseArchive => "use a folder or tar file that was exported from a store",
            Self::KeepVoxels => "keep the voxels of textures when they are ingested",
            Self::Read(hint) => return hint.fmt(f),
        })
    }
}

impl Error {
    /// The kind of remedy that applies; `None` where the error itself says what is needed, or none is known.
    ///
    /// ```
    /// use hlacdb::{Hint, OpenOptions};
    /// let error = OpenOptions::new().create(false).open("none.hlacdb").unwrap_err();
    /// assert_eq!(error.hint(), Some(Hint::CreateStore));
    /// ```
    pub fn hint(&self) -> Option<Hint> {
        match self {
            Self::Open(error) => of_open(error),
            Self::Query(error) => of_query(error),
            Self::Ingest(error) => of_ingest(error),
            Self::Exchange(error) => of_exchange(error),
            Self::Maintenance(error) => of_maintenance(error),
            Self::Store(error) => of_store(error),
            Self::Space(error) => of_space(error),
            Self::Io { .. } | Self::Cancelled => None,
        }
    }
}

fn of_open(error: &OpenError) -> Option<Hint> {
    Some(match error {
        OpenError::NoStore { .. } => Hint::CreateStore,
        OpenError::NotAStore { .. } | OpenError::Exists { .. } => Hint::ChooseAnotherPath,
        OpenError::Newer { .. } | OpenError::UnknownFeatures { .. } => Hint::UpgradeHlacdb,
        OpenError::NeedsMigration { .. } => Hint::MigrateStore,
        OpenError::HeldByWriter { .. } => Hint::WaitForWriter,
        OpenError::NeedsRepair { .. } => Hint::OpenForWriting,
        OpenError::NoLocks { .. } => Hint::UseLocalDisk,
        OpenError::DamagedFile { .. } => Hint::RepairStore,
        OpenError::Io { .. } => return None,
    })
}

fn of_query(error: &QueryError) -> Option<Hint> {
    Some(match error {
        QueryError::MissingViews { .. } => Hint::ChooseSpace,
        QueryError::TooFewLabels { .. } => Hint::TagTextures,
        QueryError::SingleLabel { .. } | QueryError::UniqueLabels { .. } => Hint::ChooseLabel,
        QueryError::ZeroK
        | QueryError::NoExample
        | QueryError::Distance { .. }
        | QueryError::NoSuchSpace { .. }
        | QueryError::Index(_) => return None,
    })
}

fn of_ingest(error: &IngestError) -> Option<Hint> {
    Some(match error {
        IngestError::BlockTooLarge { .. } => Hint::SmallerBlock,
        IngestError::OutsideFolder { .. } | IngestError::NotFound { .. } => Hint::StayInFolder,
        IngestError::Read(error) => Hint::Read(error.hint()?),
        IngestError::Volume(error) => Hint::Read(error.hint()?),
        IngestError::Recipe(_) => return None,
    })
}

fn of_exchange(error: &ExchangeError) -> Option<Hint> {
    match error {
        ExchangeError::Archive { .. } => Some(Hint::UseArchive),
        ExchangeError::Array { .. } | ExchangeError::Views { .. } => None,
    }
}

fn of_maintenance(error: &MaintenanceError) -> Option<Hint> {
    Some(match error {
        MaintenanceError::BeyondRepair { .. } => Hint::RestoreBackup,
        MaintenanceError::Migration(error) => return of_migration(error),
        MaintenanceError::NoVoxels => Hint::KeepVoxels,
        MaintenanceError::SpaceExists { .. } => Hint::RenameSpace,
        MaintenanceError::NotUserDefined { .. } | MaintenanceError::ViewsNotStored { .. } => return None,
    })
}

fn of_migration(error: &MigrationError) -> Option<Hint> {
    Some(match error {
        MigrationError::NotAStore { .. } => Hint::ChooseAnotherPath,
        MigrationError::Newer { .. } => Hint::UpgradeHlacdb,
        MigrationError::HeldByWriter { .. } => Hint::WaitForWriter,
        MigrationError::NeedsRepair { .. } => Hint::MigrateStore,
        MigrationError::Io { .. } | MigrationError::Invalid { .. } | MigrationError::Engine { .. } => return None,
    })
}

fn of_store(error: &StoreError) -> Option<Hint> {
    Some(match error {
        StoreError::Open(error) => return of_open(error),
        StoreError::ReadOnly => Hint::OpenForWriting,
        StoreError::Busy { .. } => Hint::CloseReaders,
        StoreError::Damage(_) => Hint::RepairStore,
        StoreError::NoSuchTexture { .. } => Hint::ListTextures,
        StoreError::Poisoned => Hint::ReopenStore,
        StoreError::Duplicate { .. }
        | StoreError::Invalid { .. }
        | StoreError::Broken
        | StoreError::Cancelled { .. }
        | StoreError::Engine { .. } => return None,
    })
}

fn of_space(error: &SpaceError) -> Option<Hint> {
    match error {
        SpaceError::Overdrawn { .. } | SpaceError::Damaged { .. } | SpaceError::Version { .. } => Some(Hint::Reindex),
        _ => None,
    }
}
