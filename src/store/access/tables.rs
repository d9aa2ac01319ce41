//! Tables of the engine, read and written from behind the panic boundary.
//!
//! A state is a snapshot or an open transaction; both are read through [`Tables`]. Each call of the engine is contained by
//! itself, so that the code that decodes what it returns runs outside the boundary.

use std::borrow::Borrow;
use std::ops::RangeBounds;

use redb::{
    AccessGuard, Key, Range, ReadOnlyTable, ReadTransaction, ReadableTable, ReadableTableMetadata, StorageError, Value,
    WriteTransaction,
};

use crate::store::access::write_buffer::WriteBuffer;
use crate::store::error::StoreError;
use crate::store::format::header::State;
use crate::store::format::tables::Table;
use crate::store::os::panic_boundary::contained;

const OPENING: &str = "opening a table";
const READING: &str = "reading the store";
const WRITING: &str = "writing the store";

/// The tables of one state.
#[derive(Clone, Copy)]
pub struct Tables<'a> {
    pub(in crate::store) source: Source<'a>,
    /// The counters of this state.
    pub(in crate::store) state: &'a State,
    /// The blocks of an open transaction that are newer than those in the tables.
    pub(in crate::store) buffer: Option<&'a WriteBuffer>,
}

/// The transaction of the engine that a state is read from.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    Read(&'a ReadTransaction),
    Write(&'a WriteTransaction),
}

impl<'a> Source<'a> {
    /// Opens a table for reading.
    pub(crate) fn table<K: Key + 'static, V: Value + 'static>(
        self,
        table: Table<K, V>,
    ) -> Result<ReadTable<'a, K, V>, StoreError> {
        let inner = contained(table.name, OPENING, || match self {
            Self::Read(transaction) => transaction.open_table(table.definition()).map(Inner::Read),
            Self::Write(transaction) => transaction.open_table(table.definition()).map(Inner::Write),
        })?;
        Ok(ReadTable { name: table.name, inner })
    }
}

/// A table that is open for reading.
pub(crate) struct ReadTable<'a, K: Key + 'static, V: Value + 'static> {
    name: &'static str,
    inner: Inner<'a, K, V>,
}

enum Inner<'a, K: Key + 'static, V: Value + 'static> {
    Read(ReadOnlyTable<K, V>),
    Write(redb::Table<'a, K, V>),
}

impl<K: Key + 'static, V: Value + 'static> ReadTable<'_, K, V> {
    /// The name of the table.
    pub(crate) fn name(&self) -> &'static str {
        self.name
    }

    /// The value at `key`.
    pub(crate) fn get<'k>(&self, key: impl Borrow<K::SelfType<'k>>) -> Result<Option<Stored<'_, V>>, StoreError> {
        let found = contained(self.name, READING, || match &self.inner {
            Inner::Read(table) => table.get(key),
            Inner::Write(table) => ReadableTable::get(table, key),
        })?;
        Ok(found.map(|guard| Stored { table: self.name, guard }))
    }

    /// The entries of a range of keys, in key order.
    pub(crate) fn range<'k, KR>(&self, range: impl RangeBounds<KR> + 'k) -> Result<Entries<'_, K, V>, StoreError>
    where
        KR: Borrow<K::SelfType<'k>> + 'k,
    {
        let range = contained(self.name, READING, || match &self.inner {
            Inner::Read(table) => ReadableTable::range(table, range),
            Inner::Write(table) => ReadableTable::range(table, range),
        })?;
        Ok(Entries { table: self.name, range: Some(range) })
    }

    /// All entries, in key order.
    pub(crate) fn entries(&self) -> Result<Entries<'_, K, V>, StoreError> {
        self.range::<K::SelfType<'_>>(..)
    }

    /// The number of entries.
    pub(crate) fn len(&self) -> Result<u64, StoreError> {
        contained(self.name, READING, || match &self.inner {
            Inner::Read(table) => table.len(),
            Inner::Write(table) => table.len(),
        })
    }
}

/// A key or a value in a page of the engine.
pub(crate) struct Stored<'a, T: Value + 'static> {
    table: &'static str,
    guard: AccessGuard<'a, T>,
}

impl<T: Value + 'static> Stored<'_, T> {
    /// The key or value itself.
    pub(crate) fn get(&self) -> Result<T::SelfType<'_>, StoreError> {
        contained(self.table, READING, || Ok::<_, StorageError>(self.guard.value()))
    }
}

/// The entries of a range. It ends after the first error.
pub(crate) struct Entries<'a, K: Key + 'static, V: Value + 'static> {
    table: &'static str,
    range: Option<Range<'a, K, V>>,
}

/// An entry of a table.
pub(crate) struct Entry<'a, K: Key + 'static, V: Value + 'static> {
    key: Stored<'a, K>,
    value: Stored<'a, V>,
}

impl<K: Key + 'static, V: Value + 'static> Entry<'_, K, V> {
    pub(crate) fn key(&self) -> Result<K::SelfType<'_>, StoreError> {
        self.key.get()
    }

    pub(crate) fn value(&self) -> Result<V::SelfType<'_>, StoreError> {
        self.value.get()
    }
}

/// What the engine returns for the next entry of a range.
type Next<'a, K, V> = Option<Result<(AccessGuard<'a, K>, AccessGuard<'a, V>), StorageError>>;

impl<'a, K: Key + 'static, V: Value + 'static> Entries<'a, K, V> {
    fn step(
        &mut self,
        step: impl FnOnce(&mut Range<'a, K, V>) -> Next<'a, K, V>,
    ) -> Option<Result<Entry<'a, K, V>, StoreError>> {
        let (table, range) = (self.table, self.range.as_mut()?);
        let entry = contained(table, READING, || step(range).transpose()).transpose()?;
        if entry.is_err() {
            self.range = None;
        }
        let stored = |(key, value)| Entry { key: Stored { table, guard: key }, value: Stored { table, guard: value } };
        Some(entry.map(stored))
    }
}

impl<'a, K: Key + 'static, V: Value + 'static> Iterator for Entries<'a, K, V> {
    type Item = Result<Entry<'a, K, V>, StoreError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.step(Iterator::next)
    }
}

impl<K: Key + 'static, V: Value + 'static> DoubleEndedIterator for Entries<'_, K, V> {
    fn next_back(&mut self) -> Option<Self::Item> {
        self.step(DoubleEndedIterator::next_back)
    }
}

/// A table that is open for writing.
pub(crate) struct WriteTable<'a, K: Key + 'static, V: Value + 'static> {
    name: &'static str,
    inner: redb::Table<'a, K, V>,
}

impl<'a, K: Key + 'static, V: Value + 'static> WriteTable<'a, K, V> {
    /// Opens a table for writing. The engine fails if it is open in the same transaction already.
    pub(crate) fn open(transaction: &'a WriteTransaction, table: Table<K, V>) -> Result<Self, StoreError> {
        let inner = contained(table.name, OPENING, || transaction.open_table(table.definition()))?;
        Ok(Self { name: table.name, inner })
    }

    /// Writes the value at `key`, in place of an earlier one.
    pub(crate) fn insert<'k, 'v>(
        &mut self,
        key: impl Borrow<K::SelfType<'k>>,
        value: impl Borrow<V::SelfType<'v>>,
    ) -> Result<(), StoreError> {
        contained(self.name, WRITING, || self.inner.insert(key, value).map(drop))
    }

    /// Removes the entry at `key`; returns whether there was one.
    pub(crate) fn remove<'k>(&mut self, key: impl Borrow<K::SelfType<'k>>) -> Result<bool, StoreError> {
        contained(self.name, WRITING, || self.inner.remove(key).map(|removed| removed.is_some()))
    }

    /// Removes all entries of a range of keys.
    pub(crate) fn remove_range<'k, KR>(&mut self, range: impl RangeBounds<KR> + 'k) -> Result<(), StoreError>
    where
        KR: Borrow<K::SelfType<'k>> + 'k,
    {
        contained(self.name, WRITING, || self.inner.retain_in(range, |_, _| false))
    }
}
