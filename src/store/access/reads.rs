//! [`Reads`]: what can be read from a state, be it a snapshot or an open transaction.

use std::collections::VecDeque;

use crate::hlac::{MASK_COUNT, Sums};
use crate::store::access::tables::Tables;
use crate::store::access::{blobs, values};
use crate::store::damage::DamageKey;
use crate::store::error::StoreError;
use crate::store::format::blobs::{SPACES, STATISTICS};
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
use crate::store::format::header::Settings;
use crate::store::format::points::{self, PointsLayout};
use crate::store::format::record::{Record, StoredRecord};
use crate::store::format::rows::{ROWS_PER_BLOCK, Rows};
use crate::store::format::tables::{CHUNKS, DESCRIPTORS, HASHES, POINTS, SUMS, TAGS, TEXTURES};
use crate::store::format::{hashes, keys, sums, tags, voxels};
use crate::volume::Volume;

pub(crate) mod sealed {
    use crate::store::access::tables::Tables;
    use crate::store::format::header::Settings;

    /// A state of the store. Only the store implements it.
    pub trait Source {
        /// The tables of this state.
        fn tables(&self) -> Tables<'_>;
        /// The settings of this state.
        fn settings_ref(&self) -> &Settings;
    }
}

/// How many textures and rows a state has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// Textures.
    pub textures: u64,
    /// Rows, tombstones included.
    pub rows: u64,
    /// The id of the next texture.
    pub next_id: u64,
}

/// What can be read from a state of the store: a [`Snapshot`](crate::store::Snapshot), or an open
/// [`Transaction`](crate::store::Transaction), which sees its own changes.
///
/// Every value is checked before it is returned: one that is not what was written gives [`StoreError::Damage`] with
/// table and key. An id that does not exist gives `None`, not an error.
pub trait Reads: sealed::Source {
    /// The number of the last commit in this state; 1 after creation.
    fn revision(&self) -> u64 {
        self.tables().state.revision
    }

    /// The number of textures and rows.
    fn counts(&self) -> Counts {
        let state = self.tables().state;
        Counts { textures: state.live, rows: state.rows, next_id: state.next_id }
    }

    /// The settings.
    fn settings(&self) -> &Settings {
        self.settings_ref()
    }

    /// The record of the texture `id`.
    ///
    /// # Errors
    /// [`StoreError::Damage`], [`StoreError::Engine`]; so for all methods below.
    fn record(&self, id: u64) -> Result<Option<Record>, StoreError> {
        match self.tables().source.table(TEXTURES)?.get(id)? {
            Some(value) => Ok(Some(StoredRecord::open(id, value.get()?)?)),
            None => Ok(None),
        }
    }

    /// The records of many textures, in the order of `ids`; `None` for ids that do not exist. Much faster than one by one,
    /// because the table is opened once.
    fn records_of(&self, ids: &[u64]) -> Result<Vec<Option<Record>>, StoreError> {
        let table = self.tables().source.table(TEXTURES)?;
        let record = |&id: &u64| match table.get(id)? {
            Some(value) => Ok(Some(StoredRecord::open(id, value.get()?)?)),
            None => Ok(None),
        };
        ids.iter().map(record).collect()
    }

    /// All records in id order. A damaged record is one error, after which the iterator continues.
    fn records(&self) -> Records<'_> {
        Records { tables: self.tables(), next: Some(0), read: VecDeque::new() }
    }

    /// The texture with this content hash.
    fn find(&self, hash: &[u8; 32]) -> Result<Option<u64>, StoreError> {
        match self.tables().source.table(HASHES)?.get(hash)? {
            Some(value) => Ok(Some(hashes::open(hash, value.get()?)?)),
            None => Ok(None),
        }
    }

    /// The ids of the textures whose tag `key` has this value, ascending.
    fn tagged(&self, key: &str, value: &str) -> Result<Vec<u64>, StoreError> {
        let mut ids = Vec::new();
        // No tag contains a NUL, but the prefix of a key or value that does may be that of another tag.
        values::each_tag(self.tables(), &tags::prefix(key, value), |found, found_value, id| {
            if (found, found_value) == (key, value) {
                ids.push(id);
            }
        })?;
        Ok(ids)
    }

    /// The values of the tag `key`, ascending by bytes, each with the number of textures that have it.
    fn tag_values(&self, key: &str) -> Result<Vec<(String, u64)>, StoreError> {
        let mut counted: Vec<(String, u64)> = Vec::new();
        values::each_tag(self.tables(), &keys::prefix(key), |found, value, _| match counted.last_mut() {
            _ if found != key => {}
            Some((last, count)) if last == value => *count += 1,
            _ => counted.push((value.to_owned(), 1)),
        })?;
        Ok(counted)
    }

    /// The keys of all tags, ascending by bytes. Reads one entry per key.
    fn tag_keys(&self) -> Result<Vec<String>, StoreError> {
        let table = self.tables().source.table(TAGS)?;
        let mut found: Vec<String> = Vec::new();
        let mut from = Some(Vec::new());
        while let Some(start) = from {
            let Some(entry) = table.range(&start[..]..)?.next() else { break };
            let entry = entry?;
            let (key, _, _) = tags::open(entry.key()?, entry.value()?)?;
            from = keys::after(&keys::prefix(key));
            found.push(key.to_owned());
        }
        Ok(found)
    }

    /// Whether any texture has the tag `key`.
    fn has_tag_key(&self, key: &str) -> Result<bool, StoreError> {
        let prefix = keys::prefix(key);
        match self.tables().source.table(TAGS)?.range(&prefix[..]..)?.next() {
            Some(entry) => Ok(entry?.key()?.starts_with(&prefix)),
            None => Ok(false),
        }
    }

    /// The voxels of the texture `id`; `None` if there is no such texture or its voxels are not stored.
    fn voxels(&self, id: u64) -> Result<Option<Volume>, StoreError> {
        let Some(record) = self.record(id)? else { return Ok(None) };
        let (Some(stored), Some(content)) = (record.voxels, &record.content) else { return Ok(None) };
        let stream = values::voxel_stream(self.tables(), id, stored.chunks, stored.bytes)?;
        let volume = voxels::expand(content, stored.filter, &stream);
        volume.map(Some).map_err(|what| StoreError::damage(CHUNKS.name, DamageKey::Texture(id), what))
    }

    /// The exact sums of `full@1` of the texture `id`; `None` if there is no such texture or its sums are not stored.
    fn sums(&self, id: u64) -> Result<Option<Sums>, StoreError> {
        match self.tables().source.table(SUMS)?.get(id)? {
            Some(value) => Ok(Some(sums::open(id, value.get()?)?)),
            None => Ok(None),
        }
    }

    /// All rows and their textures.
    fn rows(&self) -> Result<Rows, StoreError> {
        let tables = self.tables();
        let mut rows = Rows::default();
        for block in 0..values::row_blocks(tables) {
            let block = values::row_block(tables, block)?;
            rows.ids.extend_from_slice(&block.ids);
            rows.live.extend(&block.live);
        }
        Ok(rows)
    }

    /// The row of the texture `id`, found by bisection of the row blocks; `None` if there is no such texture.
    fn row(&self, id: u64) -> Result<Option<u64>, StoreError> {
        let tables = self.tables();
        let (mut low, mut high) = (0, values::row_blocks(tables));
        while low < high {
            let middle = low + (high - low) / 2;
            let block = values::row_block(tables, middle)?;
            match block.ids.binary_search(&id) {
                Ok(row) => {
                    let row = block.live.get(row).then_some(u64::from(middle) * ROWS_PER_BLOCK as u64 + row as u64);
                    return Ok(row);
                }
                Err(0) => high = middle,
                Err(_) => low = middle + 1,
            }
        }
        Ok(None)
    }

    /// The number of descriptor blocks that the rows take, [`DESCRIPTOR_ROWS`] rows each.
    fn descriptor_blocks(&self) -> u32 {
        self.counts().rows.div_ceil(DESCRIPTOR_ROWS as u64) as u32
    }

    /// The moments of the rows of one block in one view; `None` if no row of the block has the view.
    fn descriptors(&self, view: ViewCode, block: u32) -> Result<Option<DescriptorBlock>, StoreError> {
        values::descriptor_block(self.tables(), view, block)
    }

    /// The moments of the texture `id` in one view; `None` if there is no such texture or it lacks the view.
    fn descriptor(&self, id: u64, view: ViewCode) -> Result<Option<[f32; MASK_COUNT]>, StoreError> {
        let Some(row) = self.row(id)? else { return Ok(None) };
        let block = self.descriptors(view, (row / DESCRIPTOR_ROWS as u64) as u32)?;
        Ok(block.and_then(|block| block.row((row % DESCRIPTOR_ROWS as u64) as usize).copied()))
    }

    /// The views that have descriptors, by code.
    fn described_views(&self) -> Result<Vec<ViewCode>, StoreError> {
        let tables = self.tables();
        let table = tables.source.table(DESCRIPTORS)?;
        let mut views = Vec::new();
        let mut next = Some(0);
        while let Some(code) = next {
            let Some(entry) = table.range((code, 0)..)?.next() else { break };
            let (code, _) = entry?.key()?;
            views.push(ViewCode(code));
            next = code.checked_add(1);
        }
        if let Some((_, blocks)) = tables.buffer.and_then(|buffer| buffer.descriptors.as_ref()) {
            views.extend(blocks.keys());
            views.sort_unstable();
            views.dedup();
        }
        Ok(views)
    }

    /// The statistics stored under `key`.
    fn statistics(&self, key: &str) -> Result<Option<Vec<u8>>, StoreError> {
        blobs::get(self.tables().source, STATISTICS, key)
    }

    /// The keys of all statistics, ascending.
    fn statistics_keys(&self) -> Result<Vec<String>, StoreError> {
        blobs::names(self.tables().source, STATISTICS)
    }

    /// The space stored under `name`.
    fn space(&self, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
        blobs::get(self.tables().source, SPACES, name)
    }

    /// The names of all spaces, ascending.
    fn spaces(&self) -> Result<Vec<String>, StoreError> {
        blobs::names(self.tables().source, SPACES)
    }

    /// The layout of the points of `space`; `None` if it has none.
    fn points_layout(&self, space: &str) -> Result<Option<PointsLayout>, StoreError> {
        match self.tables().source.table(POINTS)?.get(&points::layout_key(space)[..])? {
            Some(value) => Ok(Some(PointsLayout::open(space, value.get()?)?)),
            None => Ok(None),
        }
    }

    /// The names of the spaces that have points, ascending.
    fn spaces_with_points(&self) -> Result<Vec<String>, StoreError> {
        blobs::names_of(&self.tables().source.table(POINTS)?)
    }

    /// The coordinates of one block of one part of `space`, row-major: the rows of the store from
    /// `block * point_rows_per_block(width)` on. `layout` is the [`Reads::points_layout`] of this state.
    ///
    /// # Errors
    /// As above; [`StoreError::Invalid`] for a part or block that the layout does not have.
    fn points(&self, space: &str, layout: &PointsLayout, part: u8, block: u32) -> Result<Vec<f32>, StoreError> {
        values::point_block(self.tables(), space, layout, part, block)
    }
}

/// An iterator over records in id order.
pub struct Records<'a> {
    tables: Tables<'a>,
    next: Option<u64>,
    read: VecDeque<Result<Record, StoreError>>,
}

impl Records<'_> {
    /// Reads a batch: the whole table may be larger than memory.
    fn fill(&mut self, from: u64) -> Result<(), StoreError> {
        const BATCH: usize = 256;
        self.next = None;
        let table = self.tables.source.table(TEXTURES)?;
        for entry in table.range(from..)?.take(BATCH) {
            let entry = entry?;
            let id = entry.key()?;
            self.next = id.checked_add(1);
            self.read.push_back(StoredRecord::open(id, entry.value()?).map_err(StoreError::from));
        }
        Ok(())
    }
}

impl Iterator for Records<'_> {
    type Item = Result<Record, StoreError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.read.is_empty() {
            let from = self.next?;
            if let Err(error) = self.fill(from) {
                self.next = None;
                self.read.push_back(Err(error));
            }
        }
        self.read.pop_front()
    }
}
