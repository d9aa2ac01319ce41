//! The `meta` table: header, settings and counters of a state, and the checks that opening makes.

use std::path::Path;

use redb::{Database, ReadableDatabase, WriteTransaction};

use crate::store::access::tables::{Source, WriteTable};
use crate::store::damage::{DamageKey, FILE};
use crate::store::error::StoreError;
use crate::store::format::header::{
    FORMAT_VERSION, Header, KEY_FORMAT, KEY_SETTINGS, KEY_STATE, KNOWN_FEATURES, Settings, State,
};
use crate::store::format::tables::{META, create_all};
use crate::store::open_error::OpenError;
use crate::store::os::panic_boundary::contained;

/// Reads counters and settings, and checks the header.
pub(crate) fn read(source: Source<'_>) -> Result<(State, Settings), StoreError> {
    if read_header(source)?.version != Header::CURRENT.version {
        // The handle was opened on the current version: another process has migrated the store since.
        return Err(StoreError::invalid("the format of the store was changed while it was open: open it again"));
    }
    Ok((entry(source, KEY_STATE, State::open)?, entry(source, KEY_SETTINGS, Settings::open)?))
}

/// Reads the header.
pub(crate) fn read_header(source: Source<'_>) -> Result<Header, StoreError> {
    entry(source, KEY_FORMAT, Header::decode)
}

fn entry<T>(source: Source<'_>, key: &[u8], open: impl FnOnce(&[u8]) -> Result<T, String>) -> Result<T, StoreError> {
    let table = source.table(META)?;
    let read = match table.get(key)? {
        Some(value) => open(value.get()?),
        None => Err("the entry is missing".into()),
    };
    let name = || DamageKey::Name(String::from_utf8_lossy(key).into_owned());
    read.map_err(|what| StoreError::damage(META.name, name(), what))
}

/// Creates every table and the three entries of `meta`, in one commit.
pub(crate) fn write_new(database: &Database, settings: &Settings) -> Result<(), StoreError> {
    let too_long = || StoreError::invalid("the settings are too long");
    let state = State { revision: 1, ..State::EMPTY }.seal().ok_or_else(too_long)?;
    let settings = settings.seal().ok_or_else(too_long)?;
    let transaction = begin(database)?;
    {
        let mut meta = WriteTable::open(&transaction, META)?;
        meta.insert(KEY_FORMAT, &Header::CURRENT.encode()[..])?;
        meta.insert(KEY_STATE, &state[..])?;
        meta.insert(KEY_SETTINGS, &settings[..])?;
    }
    contained(FILE, "creating tables", || create_all(&transaction))?;
    commit(transaction)
}

/// Begins a transaction whose commit is durable, and after whose crash the store opens at once.
pub(crate) fn begin(database: &Database) -> Result<WriteTransaction, StoreError> {
    let mut transaction = contained(FILE, "beginning a transaction", || database.begin_write())?;
    transaction.set_quick_repair(true);
    Ok(transaction)
}

/// Commits.
pub(crate) fn commit(transaction: WriteTransaction) -> Result<(), StoreError> {
    contained(FILE, "committing", || transaction.commit())
}

/// Refuses files that are not stores, and stores of other formats.
pub(crate) fn check_version(path: &Path, database: &impl ReadableDatabase, writing: bool) -> Result<(), StoreError> {
    let path = path.to_path_buf();
    let transaction = contained(FILE, "opening the store", || database.begin_read())?;
    let source = Source::Read(&transaction);
    let foreign = || {
        StoreError::from(OpenError::NotAStore { path: path.clone(), found: "a redb file of another program".into() })
    };
    let meta = source.table(META).map_err(|_| foreign())?;
    if meta.get(KEY_FORMAT)?.is_none() {
        return Err(foreign());
    }
    drop(meta);
    let header = read_header(source)?;
    let lowest = if writing { header.version } else { header.minimum_reader };
    if lowest > FORMAT_VERSION {
        return Err(OpenError::Newer { path, found: header.version, supported: FORMAT_VERSION }.into());
    }
    if header.version < FORMAT_VERSION {
        return Err(OpenError::NeedsMigration { path, found: header.version, current: FORMAT_VERSION }.into());
    }
    match header.features & !KNOWN_FEATURES {
        0 => Ok(()),
        unknown => Err(OpenError::UnknownFeatures { path, unknown }.into()),
    }
}
