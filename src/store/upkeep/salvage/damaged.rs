//! [`Damaged`]: a store that is read value by value, whatever has become of the pages around each of them.

use std::collections::{BTreeMap, BTreeSet};

use redb::{Key, Value};

use crate::store::access::blobs;
use crate::store::access::tables::Source;
use crate::store::error::StoreError;
use crate::store::format::blobs::{Blobs, parse};
use crate::store::format::descriptors::{DescriptorBlock, ViewCode};
use crate::store::format::header::{KEY_SETTINGS, KEY_STATE, Settings, State};
use crate::store::format::record::{Record, StoredRecord};
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock};
use crate::store::format::tables::{DESCRIPTORS, META, ROWS, TEXTURES, Table};

/// What there is at a key.
pub(crate) enum Found {
    /// Bytes, which may be damaged.
    Bytes(Vec<u8>),
    /// No entry.
    Nothing,
    /// A page that cannot be read.
    Unreadable,
}

impl Found {
    /// The bytes, if there are any.
    pub(crate) fn bytes(self) -> Option<Vec<u8>> {
        match self {
            Self::Bytes(bytes) => Some(bytes),
            Self::Nothing | Self::Unreadable => None,
        }
    }
}

/// A store that may be damaged anywhere.
#[derive(Clone, Copy)]
pub(crate) struct Damaged<'a> {
    pub(crate) source: Source<'a>,
}

impl Damaged<'_> {
    /// The bytes at `key`.
    pub(crate) fn get<K: Key + 'static, V: Value + 'static>(self, table: Table<K, V>, key: K::SelfType<'_>) -> Found {
        let read = || {
            let table = self.source.table(table)?;
            let Some(value) = table.get(key)? else { return Ok(None) };
            let value = value.get()?;
            Ok::<_, StoreError>(Some(V::as_bytes(&value).as_ref().to_vec()))
        };
        match read() {
            Ok(Some(bytes)) => Found::Bytes(bytes),
            Ok(None) => Found::Nothing,
            Err(_) => Found::Unreadable,
        }
    }

    /// Calls `visit` for every entry that can be reached from either end of the table; returns whether these are all. Entries
    /// may be visited twice.
    pub(crate) fn each<K: Key + 'static, V: Value + 'static>(
        self,
        table: Table<K, V>,
        mut visit: impl FnMut(K::SelfType<'_>, &[u8]),
    ) -> bool {
        let mut walk = |forward: bool| {
            let table = self.source.table(table)?;
            let mut entries = table.entries()?;
            while let Some(entry) = if forward { entries.next() } else { entries.next_back() } {
                let entry = entry?;
                let value = entry.value()?;
                visit(entry.key()?, V::as_bytes(&value).as_ref());
            }
            Ok::<_, StoreError>(())
        };
        if walk(true).is_ok() {
            return true;
        }
        // The entries before the damage are visited again; callers collect into maps and sets.
        let _ = walk(false);
        false
    }

    /// The counters, if they are intact.
    pub(crate) fn state(self) -> Option<State> {
        State::open(&self.get(META, KEY_STATE).bytes()?).ok()
    }

    /// The settings, if they are intact.
    pub(crate) fn intact_settings(self) -> Option<Settings> {
        Settings::open(&self.get(META, KEY_SETTINGS).bytes()?).ok()
    }

    /// The settings; if they are lost, the views that have descriptors.
    pub(crate) fn settings(self) -> Settings {
        self.intact_settings().unwrap_or_else(|| {
            let mut views = BTreeSet::new();
            self.each(DESCRIPTORS, |(view, _), _| {
                views.insert(ViewCode(view));
            });
            Settings { views: views.into_iter().collect(), ..Settings::default() }
        })
    }

    /// The names of the blobs of a table, `?` for a key that cannot be parsed; and whether these are all.
    pub(crate) fn names(self, blobs: Blobs) -> (BTreeSet<String>, bool) {
        let mut names = BTreeSet::new();
        let complete = self.each(blobs.table, |key, _| {
            names.insert(parse(key).map_or("?", |(name, _)| name).to_owned());
        });
        (names, complete)
    }

    /// A blob, if it is intact.
    pub(crate) fn blob(self, blobs: Blobs, name: &str) -> Option<Vec<u8>> {
        blobs::get(self.source, blobs, name).ok().flatten()
    }

    /// The record at the id, as bytes and, if it is intact, decoded.
    pub(crate) fn record(self, id: u64) -> (Found, Option<Record>) {
        let found = self.get(TEXTURES, id);
        let record = match &found {
            Found::Bytes(bytes) => StoredRecord::open(id, bytes).ok(),
            _ => None,
        };
        (found, record)
    }

    /// The row blocks by number; `None` for a block that cannot be read.
    pub(crate) fn row_blocks(self, state: Option<State>) -> BTreeMap<u32, Option<RowBlock>> {
        let mut numbers = BTreeSet::new();
        let complete = self.each(ROWS, |block, _| {
            numbers.insert(block);
        });
        if let Some(state) = state {
            numbers.extend(0..state.rows.div_ceil(ROWS_PER_BLOCK as u64).min(u64::from(u32::MAX)) as u32);
        } else if !complete {
            numbers.extend(0..numbers.last().map_or(0, |last| last + 1));
        }
        let open = |block: u32| RowBlock::open(block, &self.get(ROWS, block).bytes()?).ok();
        numbers.into_iter().map(|block| (block, open(block))).collect()
    }

    /// A descriptor block; `None` if there is none.
    pub(crate) fn descriptors(self, view: ViewCode, block: u32) -> Result<Option<DescriptorBlock>, ()> {
        match self.get(DESCRIPTORS, (view.0, block)) {
            Found::Nothing => Ok(None),
            Found::Unreadable => Err(()),
            Found::Bytes(bytes) => DescriptorBlock::open(view, block, &bytes).map(Some).map_err(drop),
        }
    }
}
