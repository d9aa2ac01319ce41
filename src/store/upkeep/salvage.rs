//! Salvage: the intact values of a damaged store, as a new store.
//!
//! The damaged file is only read. Every value is read by its key, so that an unreadable page costs its own values and no
//! others. What other values imply (hashes, tags, rows, counters) is derived from them. Numbers that are damaged are left
//! out and named, for the caller to derive from voxels. What nothing else implies (records, voxels) is copied as it was
//! found, damaged, under its id, so that it stays named until it is removed.

mod damaged;
mod places;

use std::collections::{BTreeMap, BTreeSet};

use redb::ReadableDatabase;

use crate::progress::Progress;
use crate::store::access::handle::{Handle, Store};
use crate::store::access::tables::Source;
use crate::store::access::transaction::Transaction;
use crate::store::damage::FILE;
use crate::store::error::StoreError;
use crate::store::format::blobs::{Blobs, SPACES, STATISTICS};
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
use crate::store::format::header::{Settings, State};
use crate::store::format::record::{Record, StoredRecord};
use crate::store::format::tables::{CHUNKS, DESCRIPTORS, HASHES, META, ROWS, SUMS, TAGS, TEXTURES};
use crate::store::format::{hashes, sums, tags, voxels};
use crate::store::os::panic_boundary::contained;
use crate::store::upkeep::job::Job;
use damaged::{Damaged, Found};
use places::Places;

/// The number of textures after which progress is reported.
const STEP: u64 = 64;
/// The number of chunks that are looked for if the record is lost. No texture has more.
const MAX_CHUNKS: u32 = 1 << 20;

/// What [`Store::salvage`] found, and what is left to derive.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SalvageReport {
    /// Textures whose sums, moments or row were damaged: to be described again from their voxels.
    pub undescribed: Vec<u64>,
    /// Textures whose record cannot be read.
    pub unreadable: Vec<u64>,
    /// Textures whose voxels are damaged.
    pub voxels_lost: Vec<u64>,
    /// The number of entries of each table that were derived from other tables.
    pub derived: BTreeMap<&'static str, u64>,
    /// The table and name of damaged statistics and spaces; `?` if not even the names can be read.
    pub blobs_lost: BTreeSet<(&'static str, String)>,
}

/// The settings of a store that may be damaged.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SalvagedSettings {
    /// The settings; if they are lost, only the views that have descriptors.
    pub settings: Settings,
    /// Whether they are lost.
    pub lost: bool,
    /// The names of all statistics.
    pub statistics: BTreeSet<String>,
    /// The intact spaces by name.
    pub spaces: BTreeMap<String, Vec<u8>>,
}

impl Store {
    /// The settings of a store that may be damaged, and what else implies them.
    ///
    /// # Errors
    /// [`StoreError::Damage`] if the engine cannot read the file at all.
    pub fn salvaged_settings(&self) -> Result<SalvagedSettings, StoreError> {
        self.with_damaged(|old| {
            let (statistics, _) = old.names(STATISTICS);
            let (spaces, _) = old.names(SPACES);
            let intact = |name: String| old.blob(SPACES, &name).map(|bytes| (name, bytes));
            let spaces = spaces.into_iter().filter_map(intact).collect();
            Ok(SalvagedSettings { settings: old.settings(), lost: old.intact_settings().is_none(), statistics, spaces })
        })
    }

    /// Copies the intact values of this store into `target`, which must be new and empty, in one transaction. Ids stay.
    ///
    /// # Errors
    /// [`StoreError::Cancelled`]; [`StoreError::Damage`] if the engine cannot read the file at all; errors of the target.
    pub fn salvage(&self, target: &Store, progress: &dyn Progress) -> Result<SalvageReport, StoreError> {
        self.with_damaged(|old| {
            let mut transaction = target.write()?;
            let mut salvage = Salvage { old, found: SalvageReport::default(), undescribed: BTreeSet::new() };
            salvage.everything(&mut transaction, Job::new("the repair", progress))?;
            transaction.commit()?;
            salvage.found.undescribed = salvage.undescribed.into_iter().collect();
            Ok(salvage.found)
        })
    }

    fn with_damaged<T>(&self, act: impl FnOnce(Damaged<'_>) -> Result<T, StoreError>) -> Result<T, StoreError> {
        let transaction = contained(FILE, "reading the store", || match &*self.handle() {
            Handle::Writer(database) => database.begin_read(),
            Handle::Reader(database) => database.begin_read(),
        })?;
        act(Damaged { source: Source::Read(&transaction) })
    }
}

/// A salvage in progress.
struct Salvage<'a> {
    old: Damaged<'a>,
    found: SalvageReport,
    undescribed: BTreeSet<u64>,
}

impl Salvage<'_> {
    fn everything(&mut self, new: &mut Transaction, job: Job<'_>) -> Result<(), StoreError> {
        let state = self.old.state();
        self.count(META.name, u64::from(state.is_none()));
        let places = Places::find(self.old, state);
        self.count(ROWS.name, places.blocks_derived);
        let total = places.rows.len() as u64;
        job.begin("saving textures", total)?;
        for (&id, number) in places.rows.keys().zip(1..) {
            self.texture(new, id)?;
            if u64::is_multiple_of(number, STEP) {
                job.advance(STEP)?;
            }
        }
        self.links_of_lost_records(new)?;
        let views = self.old.settings().views;
        job.begin("saving descriptors", views.len() as u64)?;
        for view in views {
            self.view(new, view, &places.rows)?;
            job.advance(1)?;
        }
        self.blobs(new, STATISTICS)?;
        self.blobs(new, SPACES)?;
        let next_id = state.map_or(0, |state| state.next_id).max(places.highest.saturating_add(1));
        let revision = state.map_or(1, |state| state.revision);
        new.set_state(State { revision, next_id, live: total, rows: total });
        Ok(())
    }

    /// Counts entries of a table as derived.
    fn count(&mut self, table: &'static str, entries: u64) {
        if entries > 0 {
            *self.found.derived.entry(table).or_default() += entries;
        }
    }

    /// Record, hash, tags, voxels, sums and a row of the texture.
    fn texture(&mut self, new: &mut Transaction, id: u64) -> Result<(), StoreError> {
        let (found, record) = self.old.record(id);
        let (found, record) = match record {
            Some(record) => (found.bytes().unwrap_or_default(), Some(record)),
            None => self.misplaced(id).unwrap_or((found.bytes().unwrap_or_default(), None)),
        };
        new.insert(TEXTURES, id, &*found)?;
        new.add_row(id, &[])?;
        match &record {
            None => self.found.unreadable.push(id),
            Some(record) => self.links(new, record)?,
        }
        self.voxels(new, id, record.as_ref())?;
        let stored = self.old.get(SUMS, id).bytes();
        let intact = stored.as_deref().is_some_and(|bytes| sums::open(id, bytes).is_ok());
        if !intact && record.as_ref().is_some_and(|record| record.has_sums) {
            self.undescribed.insert(id);
        }
        match stored {
            Some(bytes) if intact || record.as_ref().is_none_or(|record| record.has_sums) => {
                new.insert(SUMS, id, &*bytes)
            }
            _ => Ok(()),
        }
    }

    /// Hash and tags of an intact record.
    fn links(&mut self, new: &Transaction, record: &Record) -> Result<(), StoreError> {
        if let Some(content) = &record.content {
            let value = hashes::seal(&content.hash, record.id);
            let stored = self.old.get(HASHES, &content.hash).bytes();
            self.count(HASHES.name, u64::from(stored.as_deref() != Some(&value[..])));
            new.insert(HASHES, &content.hash, &value)?;
        }
        for (key, value) in &record.tags {
            let entry = tags::key(key, value, record.id);
            let stored = self.old.get(TAGS, &*entry).bytes();
            self.count(TAGS.name, u64::from(stored.as_deref() != Some(&tags::seal(&entry)[..])));
            new.insert_tag(record.id, key, value)?;
        }
        Ok(())
    }

    /// The record of `id` if it is under another key: the checksum covers the key, so the record is recognised by its own.
    fn misplaced(&self, id: u64) -> Option<(Vec<u8>, Option<Record>)> {
        if !matches!(self.old.get(TEXTURES, id), Found::Nothing) {
            return None;
        }
        let mut found = None;
        self.old.each(TEXTURES, |_, value| {
            if let Ok(record) = StoredRecord::open(id, value) {
                found = Some((value.to_vec(), Some(record)));
            }
        });
        found
    }

    fn voxels(&mut self, new: &Transaction, id: u64, record: Option<&Record>) -> Result<(), StoreError> {
        let stored = record.map(|record| record.voxels);
        let chunks = stored.map_or(MAX_CHUNKS, |stored| stored.map_or(0, |stored| stored.chunks));
        let mut bytes = 0;
        let mut intact = true;
        for number in 0..chunks {
            let chunk = self.old.get(CHUNKS, (id, number));
            if matches!((&chunk, record), (Found::Nothing, None)) {
                break;
            }
            let Some(chunk) = chunk.bytes() else {
                intact = false;
                continue;
            };
            match voxels::open_chunk(id, number, &chunk) {
                Ok(share) => bytes += share.len() as u64,
                Err(_) => intact = false,
            }
            new.insert(CHUNKS, (id, number), &*chunk)?;
        }
        if let Some(Some(stored)) = stored
            && (!intact || bytes != stored.bytes)
        {
            self.found.voxels_lost.push(id);
        }
        Ok(())
    }

    /// The intact hashes and tags of textures whose records are lost.
    fn links_of_lost_records(&mut self, new: &Transaction) -> Result<(), StoreError> {
        let lost: BTreeSet<u64> = self.found.unreadable.iter().copied().collect();
        if lost.is_empty() {
            return Ok(());
        }
        let mut its_hashes: BTreeMap<[u8; 32], u64> = BTreeMap::new();
        self.old.each(HASHES, |hash, value| {
            if let Ok(value) = value.try_into()
                && let Ok(id) = hashes::open(hash, value)
                && lost.contains(&id)
            {
                its_hashes.insert(*hash, id);
            }
        });
        for (hash, id) in its_hashes {
            new.insert(HASHES, &hash, &hashes::seal(&hash, id))?;
        }
        let mut its_tags: BTreeSet<Vec<u8>> = BTreeSet::new();
        self.old.each(TAGS, |key, value| {
            if let Ok(value) = value.try_into()
                && let Ok((_, _, id)) = tags::open(key, value)
                && lost.contains(&id)
            {
                its_tags.insert(key.to_vec());
            }
        });
        its_tags.iter().try_for_each(|key| new.insert(TAGS, &**key, &tags::seal(key)))
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
                self.count(DESCRIPTORS.name, u64::from(read.is_err()));
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

    fn blobs(&mut self, new: &mut Transaction, blobs: Blobs) -> Result<(), StoreError> {
        let (names, complete) = self.old.names(blobs);
        if !complete {
            self.found.blobs_lost.insert((blobs.table.name, "?".into()));
        }
        for name in names {
            match self.old.blob(blobs, &name) {
                Some(bytes) => new.put_blob(blobs, &name, &bytes)?,
                None => {
                    self.found.blobs_lost.insert((blobs.table.name, name));
                }
            }
        }
        Ok(())
    }
}
