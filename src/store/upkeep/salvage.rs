//! Salvage: what is whole in a damaged store, as a new one.
//!
//! The damaged file is only read. Every value is asked for by its key, so that a page that cannot be read costs its own
//! values and no others. What other values tell (hashes, tags, rows, counters) is derived again; numbers that are not
//! whole are left out and named, for the caller to derive from voxels; what nothing else tells (records, voxels) is kept
//! as it was found, damaged, under its id, so that it stays named until it is removed.

use std::collections::{BTreeMap, BTreeSet};

use redb::{Key, ReadableDatabase, TableDefinition, Value};

use crate::store::access::blobs;
use crate::store::access::handle::Store;
use crate::store::access::reads;
use crate::store::access::tables::{Source, Tables};
use crate::store::access::transaction::Transaction;
use crate::store::error::StoreError;
use crate::store::format::codec;
use crate::store::format::descriptors::ViewCode;
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock};
use crate::store::format::frame::{self, Kind};
use crate::store::format::header::Settings;
use crate::store::format::header::{KEY_SETTINGS, KEY_STATE, State};
use crate::store::format::keys;
use crate::store::format::record::Record;
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock};
use crate::store::format::sums;
use crate::store::os::panic_boundary::guarded;
use crate::store::progress::{Report, tell};

const DOING: &str = "the repair";
/// The caller is told after as many textures.
const STEP: u64 = 64;
/// So many ids are tried one by one where no table lists them.
const MOST_TRIED: u64 = 1 << 24;
/// No texture has more pieces of voxels than this: where the record is lost they are counted up to here.
const MOST_PIECES: u32 = 1 << 20;

/// What [`Store::salvage`] found, and what is left to derive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Salvaged {
    /// Textures whose sums, moments or row were not whole: to be described anew from their voxels.
    pub undescribed: Vec<u64>,
    /// Textures whose record cannot be read.
    pub unreadable: Vec<u64>,
    /// Textures whose voxels are not whole.
    pub voxels_lost: Vec<u64>,
    /// How many entries of a table were derived from other tables.
    pub derived: BTreeMap<&'static str, u64>,
    /// Names of statistics and spaces that were there and not whole; a `?` where not even the names can be read.
    pub blobs_lost: BTreeSet<(&'static str, String)>,
}

/// What is told of the settings of a store that may be damaged.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SalvagedSettings {
    /// The settings; where they are lost, only the views that there are numbers of.
    pub settings: Settings,
    /// Whether they are lost.
    pub lost: bool,
    /// The names of all statistics that there are.
    pub statistics: BTreeSet<String>,
    /// The spaces that are whole, by name.
    pub spaces: BTreeMap<String, Vec<u8>>,
}

/// A value, as far as it can be had.
enum Found {
    /// Its bytes; whether they are whole is another question.
    Bytes(Vec<u8>),
    /// There is no such entry.
    Nothing,
    /// The page cannot be read.
    Torn,
}

impl Found {
    fn bytes(self) -> Option<Vec<u8>> {
        match self {
            Self::Bytes(bytes) => Some(bytes),
            Self::Nothing | Self::Torn => None,
        }
    }
}

impl Store {
    /// The settings of a store that may be damaged, and what else tells of them.
    ///
    /// # Errors
    /// [`StoreError::Damage`] where the engine cannot even begin to read the file.
    pub fn salvaged_settings(&self) -> Result<SalvagedSettings, StoreError> {
        self.with_damaged(|old| {
            let (statistics, _) = old.names(blobs::STATISTICS);
            let (spaces, _) = old.names(blobs::SPACES);
            let whole = |name: String| old.blob(blobs::SPACES, &name).map(|bytes| (name, bytes));
            let spaces = spaces.into_iter().filter_map(whole).collect();
            Ok(SalvagedSettings { settings: old.settings(), lost: old.kept_settings().is_none(), statistics, spaces })
        })
    }

    /// Copies what is whole of this store into `target`, which must be new and empty, in one transaction. Ids stay.
    ///
    /// # Errors
    /// [`StoreError::Cancelled`]; [`StoreError::Damage`] where the engine cannot even begin to read the file; what the
    /// target gives.
    pub fn salvage(&self, target: &Store, report: Report<'_>) -> Result<Salvaged, StoreError> {
        self.with_damaged(|old| {
            let mut transaction = target.write()?;
            let mut salvage = Salvage { old, found: Salvaged::default(), undescribed: BTreeSet::new() };
            salvage.everything(&mut transaction, report)?;
            transaction.commit()?;
            salvage.found.undescribed = salvage.undescribed.into_iter().collect();
            Ok(salvage.found)
        })
    }

    fn with_damaged<T>(&self, act: impl FnOnce(Damaged<'_>) -> Result<T, StoreError>) -> Result<T, StoreError> {
        let transaction = self.with_engine(
            |database| database.begin_read().map_err(StoreError::when("reading the store")),
            |database| database.begin_read().map_err(StoreError::when("reading the store")),
        )?;
        act(Damaged { source: Source::Read(&transaction) })
    }
}

/// A store of which nothing is sure.
#[derive(Clone, Copy)]
struct Damaged<'a> {
    source: Source<'a>,
}

impl Damaged<'_> {
    /// The bytes under `key`, whatever has become of the pages around them.
    fn get<K: Key + 'static, V: Value + 'static>(
        self,
        definition: TableDefinition<'static, K, V>,
        key: K::SelfType<'_>,
    ) -> Found {
        let read = guarded("(pages)", || {
            let table = self.source.table(definition)?;
            let value = table.get(key)?;
            Ok(value.map(|value| V::as_bytes(&value.value()).as_ref().to_vec()))
        });
        match read {
            Ok(Some(bytes)) => Found::Bytes(bytes),
            Ok(None) => Found::Nothing,
            Err(_) => Found::Torn,
        }
    }

    /// Shows every entry that can be reached from either end; whether that is all of them.
    fn each<K: Key + 'static, V: Value + 'static>(
        self,
        definition: TableDefinition<'static, K, V>,
        mut visit: impl FnMut(K::SelfType<'_>, &[u8]),
    ) -> bool {
        let mut walk = |forward: bool| {
            guarded("(pages)", || {
                let table = self.source.table(definition)?;
                let mut range = table.range::<K::SelfType<'_>>(..)?;
                while let Some(entry) = if forward { range.next() } else { range.next_back() } {
                    let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
                    visit(key.value(), V::as_bytes(&value.value()).as_ref());
                }
                Ok(())
            })
        };
        if walk(true).is_ok() {
            return true;
        }
        // What was seen from the front is seen again; the callers gather in maps.
        let _ = walk(false);
        false
    }

    fn state(self) -> Option<State> {
        let bytes = self.get(keys::META, KEY_STATE).bytes()?;
        frame::open(Kind::State, KEY_STATE, &bytes).and_then(codec::decode).ok()
    }

    fn kept_settings(self) -> Option<Settings> {
        let bytes = self.get(keys::META, KEY_SETTINGS).bytes()?;
        frame::open(Kind::Settings, KEY_SETTINGS, &bytes).and_then(codec::decode).ok()
    }

    /// Those that are kept, else the views that there are numbers of.
    fn settings(self) -> Settings {
        self.kept_settings().unwrap_or_else(|| {
            let mut views = BTreeSet::new();
            self.each(keys::DESCRIPTORS, |(view, _), _| {
                views.insert(ViewCode(view));
            });
            Settings { views: views.into_iter().collect(), ..Settings::default() }
        })
    }

    /// The names of the blobs of a table; whether they are all.
    fn names(self, blobs: blobs::Blobs) -> (BTreeSet<String>, bool) {
        let mut names = BTreeSet::new();
        let whole = self.each(blobs.table, |key, _| {
            names.insert(keys::parse_piece(key).map_or("?", |(name, _)| name).to_owned());
        });
        (names, whole)
    }

    /// A blob that is whole.
    fn blob(self, blobs: blobs::Blobs, name: &str) -> Option<Vec<u8>> {
        let state = State::EMPTY;
        let tables = Tables { source: self.source, state: &state, open: None };
        guarded(blobs.name, || blobs.get(tables, name)).ok().flatten()
    }

    fn record(self, id: u64) -> (Found, Option<Record>) {
        let found = self.get(keys::TEXTURES, id);
        let record = match &found {
            Found::Bytes(bytes) => reads::read_record(id, bytes).ok(),
            _ => None,
        };
        (found, record)
    }

    /// The row blocks by number, `None` for one that cannot be read.
    fn row_blocks(self, state: Option<State>) -> BTreeMap<u32, Option<RowBlock>> {
        let mut numbers = BTreeSet::new();
        let whole = self.each(keys::ROWS, |block, _| {
            numbers.insert(block);
        });
        if let Some(state) = state {
            numbers.extend(0..state.rows.div_ceil(ROWS_PER_BLOCK as u64).min(u64::from(u32::MAX)) as u32);
        } else if !whole {
            numbers.extend(0..numbers.last().map_or(0, |last| last + 1));
        }
        let open = |block: u32| {
            let bytes = self.get(keys::ROWS, block).bytes()?;
            frame::open(Kind::Rows, &block.to_le_bytes(), &bytes).and_then(RowBlock::decode).ok()
        };
        numbers.into_iter().map(|block| (block, open(block))).collect()
    }

    fn descriptors(self, view: ViewCode, block: u32) -> Result<Option<DescriptorBlock>, ()> {
        match self.get(keys::DESCRIPTORS, (view.0, block)) {
            Found::Nothing => Ok(None),
            Found::Torn => Err(()),
            Found::Bytes(bytes) => frame::open(Kind::Descriptors, &keys::descriptor_bytes(view.0, block), &bytes)
                .and_then(DescriptorBlock::decode)
                .map(Some)
                .map_err(drop),
        }
    }
}

struct Salvage<'a> {
    old: Damaged<'a>,
    found: Salvaged,
    undescribed: BTreeSet<u64>,
}

impl Salvage<'_> {
    fn everything(&mut self, new: &mut Transaction, report: Report<'_>) -> Result<(), StoreError> {
        let state = self.old.state();
        if state.is_none() {
            self.found.derived.insert("meta", 1);
        }
        let blocks = self.old.row_blocks(state);
        let (textures, highest) = self.textures(state, &blocks);
        let total = textures.len() as u64;
        for (number, &id) in (0..).zip(textures.keys()) {
            if u64::is_multiple_of(number, STEP) {
                tell(report, DOING, "saving textures", number, total)?;
            }
            self.texture(new, id)?;
        }
        self.lost_links(new)?;
        for view in self.old.settings().views {
            tell(report, DOING, "saving descriptors", 0, total)?;
            self.view(new, view, &textures)?;
        }
        self.blobs(new, blobs::STATISTICS)?;
        self.blobs(new, blobs::SPACES)?;
        let next_id = state.map_or(0, |state| state.next_id).max(highest.saturating_add(1));
        let revision = state.map_or(1, |state| state.revision);
        new.set_state(State { revision, next_id, live: total, rows: total });
        Ok(())
    }

    /// The row of every texture where it is known, and the highest id that was ever given.
    fn textures(
        &mut self,
        state: Option<State>,
        blocks: &BTreeMap<u32, Option<RowBlock>>,
    ) -> (BTreeMap<u64, Option<u64>>, u64) {
        let mut ids = BTreeSet::new();
        let listed = self.old.each(keys::TEXTURES, |id, _| {
            ids.insert(id);
        });
        let mut rows: BTreeMap<u64, Option<u64>> = BTreeMap::new();
        let mut dead = BTreeSet::new();
        for (&block, rows_of) in blocks {
            for (at, &id) in rows_of.iter().flat_map(|block| block.ids.iter().enumerate()) {
                let row = u64::from(block) * ROWS_PER_BLOCK as u64 + at as u64;
                if rows_of.as_ref().is_some_and(|block| block.live.get(at)) {
                    rows.insert(id, Some(row));
                } else {
                    dead.insert(id);
                }
            }
        }
        if !listed && blocks.values().any(Option::is_none) {
            // Neither table lists all of them: try every id that may have been given.
            let last = state.map_or(MOST_TRIED, |state| state.next_id).min(MOST_TRIED);
            ids.extend((1..last).filter(|&id| !matches!(self.old.get(keys::TEXTURES, id), Found::Nothing)));
        }
        // A record under an id that has no row, and which cannot be read there, is a record whose key was hit.
        ids.retain(|&id| rows.contains_key(&id) || !dead.contains(&id) && self.old.record(id).1.is_some());
        let highest = ids.last().copied().max(rows.keys().last().copied()).max(dead.last().copied()).unwrap_or(0);
        self.place(&ids, &mut rows, blocks, &dead, state);
        (rows, highest)
    }

    /// Rows of the textures whose row block cannot be read: ids ascend with rows, so where a gap between whole blocks has as
    /// many textures as rows, each has its own.
    fn place(
        &mut self,
        ids: &BTreeSet<u64>,
        rows: &mut BTreeMap<u64, Option<u64>>,
        blocks: &BTreeMap<u32, Option<RowBlock>>,
        dead: &BTreeSet<u64>,
        state: Option<State>,
    ) {
        let full = ROWS_PER_BLOCK as u64;
        let mut lost = blocks.iter().filter(|(_, block)| block.is_none()).map(|(&number, _)| number).peekable();
        while let Some(first) = lost.next() {
            let mut last = first;
            while lost.next_if_eq(&(last + 1)).is_some() {
                last += 1;
            }
            let edge = |number: Option<u32>, pick: fn(&RowBlock) -> Option<u64>| {
                number.and_then(|number| blocks.get(&number)?.as_ref().and_then(pick))
            };
            let above = edge(first.checked_sub(1), |block| block.ids.last().copied()).map_or(0, |id| id + 1);
            let below = edge(last.checked_add(1), |block| block.ids.first().copied()).unwrap_or(u64::MAX);
            let from = u64::from(first) * full;
            let until = ((u64::from(last) + 1) * full).min(state.map_or(u64::MAX, |state| state.rows));
            let there: Vec<u64> = ids.range(above..below.max(above)).copied().collect();
            let sure = state.is_some() && there.len() as u64 == until.saturating_sub(from);
            for (row, &id) in (from..).zip(&there) {
                rows.entry(id).or_insert(sure.then_some(row));
            }
            *self.found.derived.entry("rows").or_default() += u64::from(last - first) + 1;
        }
        for &id in ids {
            if !dead.contains(&id) {
                rows.entry(id).or_insert(None);
            }
        }
    }

    /// Record, hash, tags, voxels, sums and a row for the texture.
    fn texture(&mut self, new: &mut Transaction, id: u64) -> Result<(), StoreError> {
        let (found, record) = self.old.record(id);
        let (found, record) = match record {
            Some(record) => (found.bytes().unwrap_or_default(), Some(record)),
            None => self.stray(id).unwrap_or((found.bytes().unwrap_or_default(), None)),
        };
        new.insert(keys::TEXTURES, id, &*found)?;
        new.add_row(id, &[])?;
        match &record {
            None => self.found.unreadable.push(id),
            Some(record) => {
                if let Some(content) = &record.content {
                    let value = reads::hash_value(&content.hash, id);
                    let kept = self.old.get(keys::HASHES, &content.hash).bytes();
                    self.count("hashes", kept.as_deref() != Some(&value[..]));
                    new.insert(keys::HASHES, &content.hash, &value)?;
                }
                for (key, value) in &record.tags {
                    let entry = keys::tag(key, value, id);
                    let kept = self.old.get(keys::TAGS, &*entry).bytes();
                    self.count("tags", kept.as_deref() != Some(&frame::short_sum(&entry)[..]));
                    new.insert_tag(id, key, value)?;
                }
            }
        }
        self.voxels(new, id, record.as_ref())?;
        let kept = self.old.get(keys::SUMS, id).bytes();
        let whole = kept.as_deref().is_some_and(|bytes| sums::decode(id, bytes).is_ok());
        if !whole && record.as_ref().is_some_and(|record| record.has_sums) {
            self.undescribed.insert(id);
        }
        match kept {
            Some(bytes) if whole || record.as_ref().is_none_or(|record| record.has_sums) => {
                new.insert(keys::SUMS, id, &*bytes)
            }
            _ => Ok(()),
        }
    }

    fn count(&mut self, table: &'static str, derived: bool) {
        if derived {
            *self.found.derived.entry(table).or_default() += 1;
        }
    }

    /// The record of `id` where it lies under another key: checksums cover the key, so it is known by its own.
    fn stray(&self, id: u64) -> Option<(Vec<u8>, Option<Record>)> {
        if !matches!(self.old.get(keys::TEXTURES, id), Found::Nothing) {
            return None;
        }
        let mut found = None;
        self.old.each(keys::TEXTURES, |_, value| {
            if let Ok(record) = reads::read_record(id, value) {
                found = Some((value.to_vec(), Some(record)));
            }
        });
        found
    }

    fn voxels(&mut self, new: &Transaction, id: u64, record: Option<&Record>) -> Result<(), StoreError> {
        let kept = record.map(|record| record.voxels);
        let pieces = kept.map_or(MOST_PIECES, |kept| kept.map_or(0, |kept| kept.pieces));
        let mut bytes = 0;
        let mut whole = true;
        for n in 0..pieces {
            let piece = self.old.get(keys::CHUNKS, (id, n));
            if matches!((&piece, record), (Found::Nothing, None)) {
                break;
            }
            let Some(piece) = piece.bytes() else {
                whole = false;
                continue;
            };
            match frame::open(Kind::Voxels, &keys::chunk_bytes(id, n), &piece) {
                Ok(share) => bytes += share.len() as u64,
                Err(_) => whole = false,
            }
            new.insert(keys::CHUNKS, (id, n), &*piece)?;
        }
        if let Some(Some(kept)) = kept
            && (!whole || bytes != kept.bytes)
        {
            self.found.voxels_lost.push(id);
        }
        Ok(())
    }

    /// Hashes and tags of textures whose records are lost: what of them is whole stays.
    fn lost_links(&mut self, new: &Transaction) -> Result<(), StoreError> {
        let lost: BTreeSet<u64> = self.found.unreadable.iter().copied().collect();
        if lost.is_empty() {
            return Ok(());
        }
        let mut hashes: BTreeMap<[u8; 32], u64> = BTreeMap::new();
        self.old.each(keys::HASHES, |hash, value| {
            if let Ok(value) = value.try_into()
                && let Ok(id) = reads::read_hash(hash, value)
                && lost.contains(&id)
            {
                hashes.insert(*hash, id);
            }
        });
        for (hash, id) in hashes {
            new.insert(keys::HASHES, &hash, &reads::hash_value(&hash, id))?;
        }
        let mut tags: BTreeSet<Vec<u8>> = BTreeSet::new();
        self.old.each(keys::TAGS, |key, value| {
            if keys::parse_tag(key).is_some_and(|(_, _, id)| lost.contains(&id)) && frame::short_sum(key) == *value {
                tags.insert(key.to_vec());
            }
        });
        tags.iter().try_for_each(|key| new.insert(keys::TAGS, &**key, &frame::short_sum(key)))
    }

    /// The moments of one view, from the old rows to the new ones.
    fn view(
        &mut self,
        new: &mut Transaction,
        view: ViewCode,
        textures: &BTreeMap<u64, Option<u64>>,
    ) -> Result<(), StoreError> {
        let mut held: Option<(u32, Result<Option<DescriptorBlock>, ()>)> = None;
        for (row, (&id, old_row)) in (0..).zip(textures) {
            let Some(old_row) = *old_row else {
                self.undescribed.insert(id);
                continue;
            };
            let block = (old_row / DESCRIPTOR_ROWS as u64) as u32;
            if held.as_ref().is_none_or(|(number, _)| *number != block) {
                let read = self.old.descriptors(view, block);
                self.count("descriptors", read.is_err());
                held = Some((block, read));
            }
            match held.as_ref().map(|(_, read)| read) {
                Some(Ok(Some(rows))) => {
                    if let Some(moments) = rows.row((old_row % DESCRIPTOR_ROWS as u64) as usize) {
                        new.set_descriptor(row, view, Some(moments))?;
                    }
                }
                Some(Err(())) => {
                    self.undescribed.insert(id);
                }
                Some(Ok(None)) | None => {}
            }
        }
        Ok(())
    }

    fn blobs(&mut self, new: &mut Transaction, blobs: blobs::Blobs) -> Result<(), StoreError> {
        let (names, whole) = self.old.names(blobs);
        if !whole {
            self.found.blobs_lost.insert((blobs.name, "?".into()));
        }
        for name in names {
            match self.old.blob(blobs, &name) {
                Some(bytes) => new.put_blob(blobs, &name, &bytes)?,
                None => {
                    self.found.blobs_lost.insert((blobs.name, name));
                }
            }
        }
        Ok(())
    }
}
