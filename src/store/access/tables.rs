//! One way to read tables, whether the state is a snapshot or an open transaction.

use std::borrow::Borrow;
use std::ops::RangeBounds;

use redb::{
    AccessGuard, Key, Range, ReadOnlyTable, ReadTransaction, ReadableTable, ReadableTableMetadata, Table,
    TableDefinition, Value, WriteTransaction,
};

use crate::store::access::write_buffer::WriteBuffer;
use crate::store::error::StoreError;
use crate::store::format::header::State;

/// Where tables are read from.
#[derive(Clone, Copy)]
pub struct Tables<'a> {
    pub(in crate::store) source: Source<'a>,
    /// The counters of this state.
    pub(in crate::store) state: &'a State,
    /// Blocks of an open transaction that are newer than what the tables hold.
    pub(in crate::store) open: Option<&'a WriteBuffer>,
}

#[derive(Clone, Copy)]
pub(in crate::store) enum Source<'a> {
    Read(&'a ReadTransaction),
    Write(&'a WriteTransaction),
}

impl<'a> Source<'a> {
    pub(in crate::store) fn table<K: Key + 'static, V: Value + 'static>(
        self,
        definition: TableDefinition<K, V>,
    ) -> Result<AnyTable<'a, K, V>, StoreError> {
        match self {
            Self::Read(transaction) => transaction.open_table(definition).map(AnyTable::Read),
            Self::Write(transaction) => transaction.open_table(definition).map(AnyTable::Write),
        }
        .map_err(StoreError::when("opening a table"))
    }
}

/// A table of either.
pub(in crate::store) enum AnyTable<'a, K: Key + 'static, V: Value + 'static> {
    Read(ReadOnlyTable<K, V>),
    Write(Table<'a, K, V>),
}

impl<K: Key + 'static, V: Value + 'static> AnyTable<'_, K, V> {
    pub(in crate::store) fn get<'k>(
        &self,
        key: impl Borrow<K::SelfType<'k>>,
    ) -> Result<Option<AccessGuard<'_, V>>, StoreError> {
        match self {
            Self::Read(table) => table.get(key),
            Self::Write(table) => ReadableTable::get(table, key),
        }
        .map_err(StoreError::when("reading the store"))
    }

    pub(in crate::store) fn range<'k, KR>(
        &self,
        range: impl RangeBounds<KR> + 'k,
    ) -> Result<Range<'_, K, V>, StoreError>
    where
        KR: Borrow<K::SelfType<'k>> + 'k,
    {
        match self {
            Self::Read(table) => ReadableTable::range(table, range),
            Self::Write(table) => ReadableTable::range(table, range),
        }
        .map_err(StoreError::when("reading the store"))
    }

    pub(in crate::store) fn len(&self) -> Result<u64, StoreError> {
        match self {
            Self::Read(table) => table.len(),
            Self::Write(table) => table.len(),
        }
        .map_err(StoreError::when("reading the store"))
    }
}
