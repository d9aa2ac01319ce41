//! [`Transaction`]: the changes of the one writer, committed together or not at all.

mod checks;
mod points;
mod rows;
mod textures;

pub use textures::NewTexture;

use std::borrow::Borrow;
use std::cell::Cell;
use std::marker::PhantomData;

use redb::{Key, Value, WriteTransaction};

use crate::store::access::reads::{Reads, sealed};
use crate::store::access::tables::{Source, Tables, WriteTable};
use crate::store::access::write_buffer::WriteBuffer;
use crate::store::access::{blobs, meta};
use crate::store::error::StoreError;
use crate::store::format::blobs::{Blobs, SPACES, STATISTICS};
use crate::store::format::header::{KEY_SETTINGS, KEY_STATE, Settings, State};
use crate::store::format::tables::{META, Table};

use checks::check_name;

/// The changes of the one writer. Either all of them are committed or none; dropping the transaction undoes everything.
///
/// It reads its own changes through [`Reads`]. After an error of the kinds [`StoreError::Invalid`],
/// [`StoreError::Duplicate`] and [`StoreError::NoSuchTexture`] it can still be used; after any other it can only be
/// dropped.
pub struct Transaction {
    transaction: WriteTransaction,
    state: State,
    settings: Settings,
    buffer: WriteBuffer,
    /// Set while an operation writes. It stays set if the operation fails half-way.
    broken: bool,
    /// The engine refuses to open a table twice, so that a transaction is used by one thread at a time.
    one_thread: PhantomData<Cell<()>>,
}

impl Transaction {
    pub(in crate::store) fn new(transaction: WriteTransaction) -> Result<Self, StoreError> {
        let (state, settings) = meta::read(Source::Write(&transaction))?;
        let buffer = WriteBuffer::default();
        Ok(Self { transaction, state, settings, buffer, broken: false, one_thread: PhantomData })
    }

    /// Replaces the settings.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] if they are too long.
    pub fn put_settings(&mut self, settings: Settings) -> Result<(), StoreError> {
        let value = settings.seal().ok_or_else(|| StoreError::invalid("the settings are too long"))?;
        self.writing(|this| this.insert(META, KEY_SETTINGS, &value[..]))?;
        self.settings = settings;
        Ok(())
    }

    /// Stores statistics under `key`, in place of earlier ones.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] for a key that is empty, contains NUL or is longer than
    /// [`MAX_NAME`](crate::store::MAX_NAME) bytes.
    pub fn put_statistics(&mut self, key: &str, bytes: &[u8]) -> Result<(), StoreError> {
        check_name(key)?;
        self.put_blob(STATISTICS, key, bytes)
    }

    /// Removes the statistics under `key`; returns whether there were any.
    ///
    /// # Errors
    /// [`StoreError::Damage`], [`StoreError::Engine`].
    pub fn drop_statistics(&mut self, key: &str) -> Result<bool, StoreError> {
        self.writing(|this| blobs::remove(&this.transaction, STATISTICS, key))
    }

    /// Stores a space under `name`, in place of an earlier one. Its points stay: [`Transaction::begin_points`] replaces
    /// them.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] for a malformed name, as [`Transaction::put_statistics`].
    pub fn put_space(&mut self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        check_name(name)?;
        self.put_blob(SPACES, name, bytes)
    }

    /// Removes a space and its points; returns whether there was one.
    ///
    /// # Errors
    /// [`StoreError::Damage`], [`StoreError::Engine`].
    pub fn drop_space(&mut self, name: &str) -> Result<bool, StoreError> {
        self.drop_points(name)?;
        self.writing(|this| blobs::remove(&this.transaction, SPACES, name))
    }

    /// Makes all changes durable and visible at once. Returns the new revision.
    ///
    /// # Errors
    /// [`StoreError::Broken`] after a failed operation. After any other error the changes may or may not have become
    /// durable, all together: the handle accepts no more changes, and reopening shows which.
    pub fn commit(mut self) -> Result<u64, StoreError> {
        self.flush()?;
        self.state.revision += 1;
        let value = self.state.seal().ok_or(StoreError::Broken)?;
        self.insert(META, KEY_STATE, &value[..])?;
        meta::commit(self.transaction)?;
        Ok(self.state.revision)
    }

    /// Writes every block of the buffer to its table.
    pub(in crate::store) fn flush(&mut self) -> Result<(), StoreError> {
        self.writing(|this| {
            this.flush_row_block()?;
            this.flush_descriptor_blocks()?;
            this.flush_points()
        })
    }

    /// Sets the number of rows, after compaction.
    pub(in crate::store) fn set_rows(&mut self, rows: u64) {
        self.state.rows = rows;
    }

    /// Sets the counters, after a salvage.
    pub(in crate::store) fn set_state(&mut self, state: State) {
        self.state = state;
    }

    /// Stores a blob.
    pub(in crate::store) fn put_blob(&mut self, table: Blobs, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        self.writing(|this| blobs::put(&this.transaction, table, name, bytes))
    }

    /// Runs an operation that writes. If it fails, the transaction is broken: the operation may be half done.
    pub(in crate::store) fn writing<T>(
        &mut self,
        operation: impl FnOnce(&mut Self) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        if self.broken {
            return Err(StoreError::Broken);
        }
        self.broken = true;
        let done = operation(self)?;
        self.broken = false;
        Ok(done)
    }

    /// Writes the value at `key` of a table.
    pub(in crate::store) fn insert<'k, 'v, K: Key + 'static, V: Value + 'static>(
        &self,
        table: Table<K, V>,
        key: impl Borrow<K::SelfType<'k>>,
        value: impl Borrow<V::SelfType<'v>>,
    ) -> Result<(), StoreError> {
        WriteTable::open(&self.transaction, table)?.insert(key, value)
    }

    /// Removes the entry at `key` of a table, if there is one.
    pub(in crate::store) fn delete<'k, K: Key + 'static, V: Value + 'static>(
        &self,
        table: Table<K, V>,
        key: impl Borrow<K::SelfType<'k>>,
    ) -> Result<(), StoreError> {
        WriteTable::open(&self.transaction, table)?.remove(key).map(drop)
    }
}

impl sealed::Source for Transaction {
    fn tables(&self) -> Tables<'_> {
        Tables { source: Source::Write(&self.transaction), state: &self.state, buffer: Some(&self.buffer) }
    }

    fn settings_ref(&self) -> &Settings {
        &self.settings
    }
}

impl Reads for Transaction {}

impl std::fmt::Debug for Transaction {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Transaction").field("state", &self.state).field("broken", &self.broken).finish_non_exhaustive()
    }
}
