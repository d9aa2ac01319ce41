//! The stamp: 32 bytes under `format` in the table `meta`, with the same layout in every version.

use std::path::Path;

use redb::{ReadTransaction, ReadableTable, TableDefinition, WriteTransaction};
use xxhash_rust::xxh3::xxh3_64;

use super::MigrationError;

const META: TableDefinition<&[u8], &[u8]> = TableDefinition::new("meta");
const KEY: &[u8] = b"format";
const MAGIC: &[u8; 8] = b"hlacdb\r\n";

/// The format that a store declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Stamp {
    pub(super) version: u32,
    pub(super) minimum_reader: u32,
    pub(super) features: u64,
}

impl Stamp {
    /// Magic, version, minimum reader, features, XXH3-64 of these 24 bytes.
    pub(super) fn encode(self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(self.version.to_le_bytes());
        bytes.extend(self.minimum_reader.to_le_bytes());
        bytes.extend(self.features.to_le_bytes());
        bytes.extend(xxh3_64(&bytes).to_le_bytes());
        bytes
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (body, sum) = bytes.split_last_chunk::<8>().filter(|(body, _)| body.len() == 24)?;
        let body = body.strip_prefix(MAGIC).filter(|_| xxh3_64(body) == u64::from_le_bytes(*sum))?;
        let (version, body) = body.split_first_chunk()?;
        let (minimum_reader, body) = body.split_first_chunk()?;
        Some(Self {
            version: u32::from_le_bytes(*version),
            minimum_reader: u32::from_le_bytes(*minimum_reader),
            features: u64::from_le_bytes(*body.first_chunk()?),
        })
    }
}

/// The stamp of a committed state.
pub(super) fn read_committed(path: &Path, transaction: &ReadTransaction) -> Result<Stamp, MigrationError> {
    let foreign = || MigrationError::NotAStore { path: path.into() };
    let table = transaction.open_table(META).map_err(|_| foreign())?;
    let value = table.get(KEY).map_err(MigrationError::engine)?.ok_or_else(foreign)?;
    Stamp::decode(value.value()).ok_or_else(damaged)
}

/// The stamp as a hop sees it.
pub(super) fn read(transaction: &WriteTransaction) -> Result<Stamp, MigrationError> {
    let table = transaction.open_table(META).map_err(MigrationError::engine)?;
    let value = ReadableTable::get(&table, KEY).map_err(MigrationError::engine)?;
    value.and_then(|value| Stamp::decode(value.value())).ok_or_else(damaged)
}

/// Writes the stamp in a hop.
pub(super) fn write(transaction: &WriteTransaction, stamp: Stamp) -> Result<(), MigrationError> {
    let mut table = transaction.open_table(META).map_err(MigrationError::engine)?;
    table.insert(KEY, &stamp.encode()[..]).map(drop).map_err(MigrationError::engine)
}

fn damaged() -> MigrationError {
    MigrationError::invalid("meta", "format", "the stamp is damaged")
}
