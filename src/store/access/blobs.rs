//! Blobs: named bytes of any length in pieces (statistics, spaces).

use redb::TableDefinition;

use crate::store::access::tables::{AnyTable, Source, Tables};
use crate::store::error::StoreError;
use crate::store::format::chunks;
use crate::store::format::frame::{self, Kind};
use crate::store::format::keys;

/// Payload bytes of a piece before its share of the blob: total length (`u64`), pieces (`u32`), 0 (`u32`).
const HEAD: usize = 16;

/// One of the tables that keep blobs.
#[derive(Clone, Copy)]
pub(in crate::store) struct Blobs {
    pub(in crate::store) table: TableDefinition<'static, &'static [u8], &'static [u8]>,
    pub(in crate::store) name: &'static str,
    pub(in crate::store) kind: Kind,
}

/// The `statistics` table.
pub(in crate::store) const STATISTICS: Blobs =
    Blobs { table: keys::STATISTICS, name: "statistics", kind: Kind::Statistics };
/// The `spaces` table.
pub(in crate::store) const SPACES: Blobs = Blobs { table: keys::SPACES, name: "spaces", kind: Kind::Space };

impl Blobs {
    /// The names of the blobs, ascending.
    pub(in crate::store) fn names(self, tables: Tables<'_>) -> Result<Vec<String>, StoreError> {
        names(&tables.source.table(self.table)?, self.name)
    }

    /// The blob `name`; `None` where there is none.
    pub(in crate::store) fn get(self, tables: Tables<'_>, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
        let table = tables.source.table(self.table)?;
        let mut blob = Vec::new();
        let (mut number, mut expected) = (0, None);
        loop {
            let key = keys::piece(name, number);
            let Some(value) = table.get(&key[..])? else { break };
            let payload = frame::open(self.kind, &key, value.value()).map_err(|what| self.damage(name, what))?;
            let Some((&[t0, t1, t2, t3, t4, t5, t6, t7, p0, p1, p2, p3, 0, 0, 0, 0], share)) =
                payload.split_first_chunk::<HEAD>()
            else {
                return Err(self.damage(name, format!("piece {number} has an odd head")));
            };
            let total = (u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]), u32::from_le_bytes([p0, p1, p2, p3]));
            if *expected.get_or_insert(total) != total {
                return Err(self.damage(name, format!("piece {number} belongs to another blob")));
            }
            blob.extend_from_slice(share);
            number += 1;
        }
        match expected {
            None => Ok(None),
            Some((bytes, pieces)) if bytes == blob.len() as u64 && pieces == number => Ok(Some(blob)),
            Some((bytes, pieces)) => Err(self.damage(
                name,
                format!("{number} pieces with {} bytes are there, expected {pieces} with {bytes}", blob.len()),
            )),
        }
    }

    /// Writes the blob `name` in place of what was there.
    pub(in crate::store) fn put(self, source: Source<'_>, name: &str, blob: &[u8]) -> Result<(), StoreError> {
        let Source::Write(transaction) = source else { return Err(StoreError::ReadOnly) };
        let lengths = chunks::cut(blob.len(), HEAD);
        let mut table = transaction.open_table(self.table).map_err(StoreError::when("opening a table"))?;
        let mut rest = blob;
        for (number, &length) in lengths.iter().enumerate() {
            let (share, after) = rest.split_at_checked(length).unwrap_or((rest, &[]));
            rest = after;
            let key = keys::piece(name, number as u32);
            let mut builder = frame::Builder::new(self.kind, HEAD + length);
            builder.payload().extend((blob.len() as u64).to_le_bytes());
            builder.payload().extend((lengths.len() as u32).to_le_bytes());
            builder.payload().extend([0; 4]);
            builder.payload().extend_from_slice(share);
            table.insert(&key[..], &builder.seal(&key)[..]).map_err(StoreError::when("writing the store"))?;
        }
        for number in lengths.len() as u32.. {
            let gone = table.remove(&keys::piece(name, number)[..]).map_err(StoreError::when("writing the store"))?;
            if gone.is_none() {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Removes the blob `name`; whether there was one.
    pub(in crate::store) fn remove(self, source: Source<'_>, name: &str) -> Result<bool, StoreError> {
        let Source::Write(transaction) = source else { return Err(StoreError::ReadOnly) };
        let mut table = transaction.open_table(self.table).map_err(StoreError::when("opening a table"))?;
        for number in 0.. {
            let gone = table.remove(&keys::piece(name, number)[..]).map_err(StoreError::when("writing the store"))?;
            if gone.is_none() {
                return Ok(number > 0);
            }
        }
        Ok(true)
    }

    fn damage(self, key: &str, what: impl Into<String>) -> StoreError {
        StoreError::damage(self.name, key, what)
    }
}

/// The names that the keys of a table begin with, up to the first NUL, ascending. Looks at one key per name.
pub(in crate::store) fn names(
    table: &AnyTable<'_, &'static [u8], &'static [u8]>,
    label: &'static str,
) -> Result<Vec<String>, StoreError> {
    let mut names = Vec::new();
    let mut from = Some(Vec::new());
    while let Some(start) = from {
        let Some(entry) = table.range(&start[..]..)?.next() else { break };
        let (key, _) = entry.map_err(StoreError::when("reading the store"))?;
        let name = key.value().split(|&byte| byte == 0).next().unwrap_or_default();
        let Ok(text) = std::str::from_utf8(name) else {
            return Err(StoreError::damage(label, key.value().escape_ascii().to_string(), "the key is malformed"));
        };
        names.push(text.to_owned());
        from = keys::after(&keys::tag_prefix(text, None));
    }
    Ok(names)
}
