//! Reading and writing blobs (statistics, spaces), and the names that keys begin with.

use redb::{Value, WriteTransaction};

use crate::store::access::tables::{ReadTable, Source, WriteTable};
use crate::store::damage::DamageKey;
use crate::store::error::StoreError;
use crate::store::format::blobs::{self, Blobs};
use crate::store::format::keys;

/// The names of the blobs of a table, ascending.
pub(crate) fn names(source: Source<'_>, blobs: Blobs) -> Result<Vec<String>, StoreError> {
    names_of(&source.table(blobs.table)?)
}

/// The blob `name`; `None` if there is none.
pub(crate) fn get(source: Source<'_>, blobs: Blobs, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
    let damage = |what: String| StoreError::damage(blobs.table.name, DamageKey::Name(name.to_owned()), what);
    let table = source.table(blobs.table)?;
    let mut blob = Vec::new();
    let (mut number, mut expected) = (0, None);
    loop {
        let key = blobs::key(name, number);
        let Some(value) = table.get(&key[..])? else { break };
        let chunk = blobs.open(&key, value.get()?).map_err(damage)?;
        if *expected.get_or_insert(chunk.total) != chunk.total {
            return Err(damage(format!("chunk {number} belongs to another blob")));
        }
        blob.extend_from_slice(chunk.share);
        number += 1;
    }
    match expected {
        None => Ok(None),
        Some((bytes, chunks)) if bytes == blob.len() as u64 && chunks == number => Ok(Some(blob)),
        Some((bytes, chunks)) => {
            Err(damage(format!("found {number} chunks with {} bytes, expected {chunks} with {bytes}", blob.len())))
        }
    }
}

/// Writes the blob `name`, in place of an earlier one.
pub(crate) fn put(transaction: &WriteTransaction, blobs: Blobs, name: &str, blob: &[u8]) -> Result<(), StoreError> {
    let mut table = WriteTable::open(transaction, blobs.table)?;
    let chunks = blobs.seal(name, blob);
    let count = chunks.len() as u32;
    for (key, value) in chunks {
        table.insert(&key[..], &value[..])?;
    }
    remove_from(&mut table, name, count).map(drop)
}

/// Removes the blob `name`; returns whether there was one.
pub(crate) fn remove(transaction: &WriteTransaction, blobs: Blobs, name: &str) -> Result<bool, StoreError> {
    remove_from(&mut WriteTable::open(transaction, blobs.table)?, name, 0)
}

/// Removes the chunks of a blob from number `first` on; returns whether there were any.
fn remove_from(
    table: &mut WriteTable<'_, &'static [u8], &'static [u8]>,
    name: &str,
    first: u32,
) -> Result<bool, StoreError> {
    for number in first.. {
        if !table.remove(&blobs::key(name, number)[..])? {
            return Ok(number > first);
        }
    }
    Ok(true)
}

/// The names that the keys of a table begin with, up to the first NUL, ascending. Reads one key per name.
pub(crate) fn names_of<V: Value + 'static>(table: &ReadTable<'_, &'static [u8], V>) -> Result<Vec<String>, StoreError> {
    let mut names = Vec::new();
    let mut from = Some(Vec::new());
    while let Some(start) = from {
        let Some(entry) = table.range(&start[..]..)?.next() else { break };
        let entry = entry?;
        let key = entry.key()?;
        let name = key.split(|&byte| byte == 0).next().unwrap_or_default();
        let Ok(text) = std::str::from_utf8(name) else {
            return Err(StoreError::damage(table.name(), DamageKey::Bytes(key.to_vec()), "the key is malformed"));
        };
        names.push(text.to_owned());
        from = keys::after(&keys::prefix(text));
    }
    Ok(names)
}
