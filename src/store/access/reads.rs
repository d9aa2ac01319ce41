//! [`Reads`]: what can be asked of a state, be it a snapshot or an open transaction.

use std::collections::VecDeque;

use crate::hlac::{MASK_COUNT, Sums};
use crate::store::access::blobs;
use crate::store::access::tables::Tables;
use crate::store::error::StoreError;
use crate::store::format::codec;
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
use crate::store::format::frame::{self, Kind};
use crate::store::format::header::Settings;
use crate::store::format::keys;
use crate::store::format::points::{self, PointsLayout, point_rows_per_block};
use crate::store::format::record::{Record, StoredRecord};
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock, Rows};
use crate::store::format::sums;
use crate::store::format::voxels;
use crate::store::os::panic_boundary::guarded;
use crate::volume::Volume;

pub(in crate::store) mod sealed {
    /// What makes a type readable; only the store's own are.
    pub trait Source {
        /// The tables of this state.
        fn tables(&self) -> super::Tables<'_>;
        /// The settings of this state.
        fn settings_ref(&self) -> &super::Settings;
    }
}

/// How many things there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// Textures in the store.
    pub textures: u64,
    /// Rows, tombstones included.
    pub rows: u64,
    /// The id that the next texture gets.
    pub next_id: u64,
}

/// What can be asked of a state of the store: a [`Snapshot`](super::Snapshot) or an open
/// [`Transaction`](super::Transaction), which sees its own changes.
///
/// Every value is checked before it is used: what is not as it was written gives [`StoreError::Damage`] with table and
/// key. An id that is not there is `None`, not an error.
pub trait Reads: sealed::Source {
    /// The number of the last commit that this state contains; 1 after creation.
    fn revision(&self) -> u64 {
        self.tables().state.revision
    }

    /// How many textures and rows there are.
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
    /// [`StoreError::Damage`], [`StoreError::Engine`]; so for all that follow.
    fn record(&self, id: u64) -> Result<Option<Record>, StoreError> {
        guarded("textures", || match self.tables().source.table(keys::TEXTURES)?.get(id)? {
            Some(value) => read_record(id, value.value()).map(Some),
            None => Ok(None),
        })
    }

    /// The records of many textures, in the order of `ids`; `None` for those that are not there. Much quicker than one by
    /// one, for the table is opened once.
    fn records_of(&self, ids: &[u64]) -> Result<Vec<Option<Record>>, StoreError> {
        guarded("textures", || {
            let table = self.tables().source.table(keys::TEXTURES)?;
            let record = |&id: &u64| match table.get(id)? {
                Some(value) => read_record(id, value.value()).map(Some),
                None => Ok(None),
            };
            ids.iter().map(record).collect()
        })
    }

    /// All records in id order. A damaged record is one error, and the iterator goes on behind it.
    fn records(&self) -> Records<'_> {
        Records { tables: self.tables(), next: Some(0), read: VecDeque::new() }
    }

    /// The texture with this content hash.
    fn find(&self, hash: &[u8; 32]) -> Result<Option<u64>, StoreError> {
        guarded("hashes", || match self.tables().source.table(keys::HASHES)?.get(hash)? {
            Some(value) => read_hash(hash, value.value()).map(Some),
            None => Ok(None),
        })
    }

    /// The ids of the textures whose tag `key` has this value, ascending.
    fn tagged(&self, key: &str, value: &str) -> Result<Vec<u64>, StoreError> {
        guarded("tags", || {
            let mut ids = Vec::new();
            // A key or value with a NUL in it, which no tag has, may be the beginning of another tag's entry.
            each_tag(self.tables(), &keys::tag_prefix(key, Some(value)), |one, held, id| {
                if (one, held) == (key, value) {
                    ids.push(id);
                }
            })?;
            Ok(ids)
        })
    }

    /// The values that the tag `key` has, ascending by bytes, each with the number of its textures.
    fn tag_values(&self, key: &str) -> Result<Vec<(String, u64)>, StoreError> {
        guarded("tags", || {
            let mut values: Vec<(String, u64)> = Vec::new();
            each_tag(self.tables(), &keys::tag_prefix(key, None), |one, value, _| match values.last_mut() {
                _ if one != key => {}
                Some((last, count)) if last == value => *count += 1,
                _ => values.push((value.to_owned(), 1)),
            })?;
            Ok(values)
        })
    }

    /// The keys of all tags, ascending by bytes. Looks at one entry per key.
    fn tag_keys(&self) -> Result<Vec<String>, StoreError> {
        guarded("tags", || {
            let table = self.tables().source.table(keys::TAGS)?;
            let mut found: Vec<String> = Vec::new();
            let mut from = Some(Vec::new());
            while let Some(start) = from {
                let Some(entry) = table.range(&start[..]..)?.next() else { break };
                let (entry, sum) = entry.map_err(StoreError::when("reading the store"))?;
                let (key, _, _) = checked_tag(entry.value(), sum.value())?;
                from = keys::after(&keys::tag_prefix(key, None));
                found.push(key.to_owned());
            }
            Ok(found)
        })
    }

    /// Whether any texture carries the tag `key`.
    fn has_tag_key(&self, key: &str) -> Result<bool, StoreError> {
        guarded("tags", || {
            let prefix = keys::tag_prefix(key, None);
            match self.tables().source.table(keys::TAGS)?.range(&prefix[..]..)?.next() {
                Some(entry) => Ok(entry.map_err(StoreError::when("reading the store"))?.0.value().starts_with(&prefix)),
                None => Ok(false),
            }
        })
    }

    /// The voxels of the texture `id`; `None` where there is no such texture or its voxels are not kept.
    fn voxels(&self, id: u64) -> Result<Option<Volume>, StoreError> {
        guarded("chunks", || {
            let Some(record) = self.record(id)? else { return Ok(None) };
            let (Some(kept), Some(content)) = (record.voxels, &record.content) else { return Ok(None) };
            let stream = read_stream(self.tables(), id, kept.pieces, kept.bytes)?;
            let volume = voxels::expand(content, kept.filter, &stream);
            volume.map(Some).map_err(|what| StoreError::damage("chunks", format!("id {id}"), what))
        })
    }

    /// The exact sums of `full@1` of the texture `id`; `None` where there is no such texture or its sums are not kept.
    fn sums(&self, id: u64) -> Result<Option<Sums>, StoreError> {
        guarded("sums", || match self.tables().source.table(keys::SUMS)?.get(id)? {
            Some(value) => sums::decode(id, value.value()).map(Some),
            None => Ok(None),
        })
    }

    /// All rows: which texture has which.
    fn rows(&self) -> Result<Rows, StoreError> {
        guarded("rows", || {
            let tables = self.tables();
            let mut rows = Rows::default();
            for block in 0..row_blocks(tables) {
                let block = row_block(tables, block)?;
                rows.ids.extend_from_slice(&block.ids);
                rows.live.extend(&block.live);
            }
            Ok(rows)
        })
    }

    /// The row of the texture `id`, by bisection over the row blocks; `None` where there is no such texture.
    fn row(&self, id: u64) -> Result<Option<u64>, StoreError> {
        guarded("rows", || {
            let tables = self.tables();
            let (mut low, mut high) = (0, row_blocks(tables));
            while low < high {
                let middle = low + (high - low) / 2;
                let block = row_block(tables, middle)?;
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
        })
    }

    /// The number of descriptor blocks that rows are spread over, [`DESCRIPTOR_ROWS`] rows each.
    fn descriptor_blocks(&self) -> u32 {
        self.counts().rows.div_ceil(DESCRIPTOR_ROWS as u64) as u32
    }

    /// The moments of the rows of one block in one view; `None` where no row of the block has that view.
    fn descriptors(&self, view: ViewCode, block: u32) -> Result<Option<DescriptorBlock>, StoreError> {
        guarded("descriptors", || descriptor_block(self.tables(), view, block))
    }

    /// The moments of the texture `id` in one view; `None` where there is no such texture, or it lacks the view.
    fn descriptor(&self, id: u64, view: ViewCode) -> Result<Option<[f32; MASK_COUNT]>, StoreError> {
        guarded("descriptors", || {
            let Some(row) = self.row(id)? else { return Ok(None) };
            let block = self.descriptors(view, (row / DESCRIPTOR_ROWS as u64) as u32)?;
            Ok(block.and_then(|block| block.row((row % DESCRIPTOR_ROWS as u64) as usize).copied()))
        })
    }

    /// The views of which there are descriptors, by code.
    fn described_views(&self) -> Result<Vec<ViewCode>, StoreError> {
        guarded("descriptors", || {
            let tables = self.tables();
            let table = tables.source.table(keys::DESCRIPTORS)?;
            let mut views = Vec::new();
            let mut next = Some(0);
            while let Some(code) = next {
                let Some(entry) = table.range((code, 0)..)?.next() else { break };
                let (key, _) = entry.map_err(StoreError::when("reading the store"))?;
                let code = key.value().0;
                views.push(ViewCode(code));
                next = code.checked_add(1);
            }
            if let Some((_, open)) = tables.open.and_then(|open| open.descriptors.as_ref()) {
                views.extend(open.keys());
                views.sort_unstable();
                views.dedup();
            }
            Ok(views)
        })
    }

    /// The statistics kept under `key`.
    fn statistics(&self, key: &str) -> Result<Option<Vec<u8>>, StoreError> {
        guarded("statistics", || blobs::STATISTICS.get(self.tables(), key))
    }

    /// The keys of all statistics, ascending.
    fn statistics_keys(&self) -> Result<Vec<String>, StoreError> {
        guarded("statistics", || blobs::STATISTICS.names(self.tables()))
    }

    /// The space kept under `name`.
    fn space(&self, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
        guarded("spaces", || blobs::SPACES.get(self.tables(), name))
    }

    /// The names of all spaces, ascending.
    fn spaces(&self) -> Result<Vec<String>, StoreError> {
        guarded("spaces", || blobs::SPACES.names(self.tables()))
    }

    /// How the points of `space` are laid out; `None` where it has none.
    fn points_layout(&self, space: &str) -> Result<Option<PointsLayout>, StoreError> {
        guarded("points", || {
            let key = keys::points_layout(space);
            match self.tables().source.table(keys::POINTS)?.get(&key[..])? {
                Some(value) => frame::open(Kind::PointsLayout, &key, value.value())
                    .and_then(PointsLayout::decode)
                    .map(Some)
                    .map_err(|what| StoreError::damage("points", format!("space {space}"), what)),
                None => Ok(None),
            }
        })
    }

    /// The names of the spaces that have points, ascending.
    fn spaces_with_points(&self) -> Result<Vec<String>, StoreError> {
        guarded("points", || blobs::names(&self.tables().source.table(keys::POINTS)?, "points"))
    }

    /// The coordinates of one block of one part of `space`, row-major: rows
    /// `block * point_rows_per_block(width) ..` of the store. `layout` is this state's [`Reads::points_layout`].
    ///
    /// # Errors
    /// As above; [`StoreError::Invalid`] for a part or block that the layout does not have.
    fn points(&self, space: &str, layout: &PointsLayout, part: u8, block: u32) -> Result<Vec<f32>, StoreError> {
        guarded("points", || point_block(self.tables(), space, layout, part, block))
    }
}

/// Records in id order.
pub struct Records<'a> {
    tables: Tables<'a>,
    next: Option<u64>,
    read: VecDeque<Result<Record, StoreError>>,
}

impl Records<'_> {
    /// Reads some more. Not the whole table at once: it may be larger than memory.
    fn fill(&mut self, from: u64) -> Result<(), StoreError> {
        const SOME: usize = 256;
        self.next = None;
        let table = self.tables.source.table(keys::TEXTURES)?;
        for entry in table.range(from..)?.take(SOME) {
            let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
            self.next = key.value().checked_add(1);
            self.read.push_back(read_record(key.value(), value.value()));
        }
        Ok(())
    }
}

impl Iterator for Records<'_> {
    type Item = Result<Record, StoreError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.read.is_empty() {
            let from = self.next?;
            if let Err(error) = guarded("textures", || self.fill(from)) {
                self.next = None;
                self.read.push_back(Err(error));
            }
        }
        self.read.pop_front()
    }
}

pub(in crate::store) fn read_record(id: u64, value: &[u8]) -> Result<Record, StoreError> {
    frame::open(Kind::Record, &id.to_le_bytes(), value)
        .and_then(codec::decode::<StoredRecord>)
        .map(|record| record.with_id(id))
        .map_err(|what| StoreError::damage("textures", format!("id {id}"), what))
}

/// The value of the `hashes` table: id, then the short checksum of hash and id.
pub(in crate::store) fn hash_value(hash: &[u8; 32], id: u64) -> [u8; 12] {
    let mut bytes = [0; 12];
    let sum = frame::short_sum(&[&hash[..], &id.to_le_bytes()].concat());
    for (byte, value) in bytes.iter_mut().zip(id.to_le_bytes().into_iter().chain(sum)) {
        *byte = value;
    }
    bytes
}

pub(in crate::store) fn read_hash(hash: &[u8; 32], value: &[u8; 12]) -> Result<u64, StoreError> {
    let [id @ .., _, _, _, _] = *value;
    let id = u64::from_le_bytes(id);
    if hash_value(hash, id) != *value {
        let key = blake3::Hash::from_bytes(*hash).to_string();
        return Err(StoreError::damage("hashes", key, "the checksum does not match"));
    }
    Ok(id)
}

/// Calls `visit` with key, value and id of every tag whose key begins with `prefix`.
pub(in crate::store) fn each_tag(
    tables: Tables<'_>,
    prefix: &[u8],
    mut visit: impl FnMut(&str, &str, u64),
) -> Result<(), StoreError> {
    let table = tables.source.table(keys::TAGS)?;
    for entry in table.range(prefix..)? {
        let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
        if !key.value().starts_with(prefix) {
            break;
        }
        let (tag, text, id) = checked_tag(key.value(), value.value())?;
        visit(tag, text, id);
    }
    Ok(())
}

/// Key, value and id of an entry of the `tags` table.
fn checked_tag<'a>(key: &'a [u8], sum: &[u8; 4]) -> Result<(&'a str, &'a str, u64), StoreError> {
    match keys::parse_tag(key) {
        Some(parts) if frame::short_sum(key) == *sum => Ok(parts),
        _ => Err(StoreError::damage("tags", key.escape_ascii().to_string(), "the checksum does not match")),
    }
}

/// The compressed voxels of a texture, put together.
pub(in crate::store) fn read_stream(
    tables: Tables<'_>,
    id: u64,
    pieces: u32,
    bytes: u64,
) -> Result<Vec<u8>, StoreError> {
    let table = tables.source.table(keys::CHUNKS)?;
    let mut stream = Vec::new();
    for n in 0..pieces {
        let damage = |what: String| StoreError::damage("chunks", format!("id {id}, piece {n}"), what);
        let value = table.get((id, n))?.ok_or_else(|| damage("the piece is missing".into()))?;
        let share = frame::open(Kind::Voxels, &keys::chunk_bytes(id, n), value.value()).map_err(damage)?;
        stream.extend_from_slice(share);
    }
    if stream.len() as u64 != bytes {
        let what = format!("{} bytes are there, the record says {bytes}", stream.len());
        return Err(StoreError::damage("chunks", format!("id {id}"), what));
    }
    Ok(stream)
}

pub(in crate::store) fn row_blocks(tables: Tables<'_>) -> u32 {
    tables.state.rows.div_ceil(ROWS_PER_BLOCK as u64) as u32
}

/// A row block, with as many rows as the counters say.
pub(in crate::store) fn row_block(tables: Tables<'_>, block: u32) -> Result<RowBlock, StoreError> {
    if let Some(open) = tables.open.and_then(|open| open.row_block(block)) {
        return Ok(open.clone());
    }
    let damage = |what: String| StoreError::damage("rows", format!("block {block}"), what);
    let table = tables.source.table(keys::ROWS)?;
    let value = table.get(block)?.ok_or_else(|| damage("the block is missing".into()))?;
    let rows =
        frame::open(Kind::Rows, &block.to_le_bytes(), value.value()).and_then(RowBlock::decode).map_err(damage)?;
    let expected =
        tables.state.rows.saturating_sub(u64::from(block) * ROWS_PER_BLOCK as u64).min(ROWS_PER_BLOCK as u64);
    if rows.ids.len() as u64 != expected {
        return Err(damage(format!("the block has {} rows, the counters say {expected}", rows.ids.len())));
    }
    Ok(rows)
}

pub(in crate::store) fn descriptor_block(
    tables: Tables<'_>,
    view: ViewCode,
    block: u32,
) -> Result<Option<DescriptorBlock>, StoreError> {
    if let Some(open) = tables.open.and_then(|open| open.descriptor_block(view, block)) {
        return Ok(Some(open.clone()));
    }
    let table = tables.source.table(keys::DESCRIPTORS)?;
    match table.get((view.0, block))? {
        Some(value) => frame::open(Kind::Descriptors, &keys::descriptor_bytes(view.0, block), value.value())
            .and_then(DescriptorBlock::decode)
            .map(Some)
            .map_err(|what| StoreError::damage("descriptors", format!("view {}, block {block}", view.0), what)),
        None => Ok(None),
    }
}

pub(in crate::store) fn point_block(
    tables: Tables<'_>,
    space: &str,
    layout: &PointsLayout,
    part: u8,
    block: u32,
) -> Result<Vec<f32>, StoreError> {
    let Some(&width) = layout.widths.get(usize::from(part)).filter(|_| block < layout.blocks(part)) else {
        return Err(StoreError::invalid(format!("the points of space {space} have no part {part}, block {block}")));
    };
    if let Some(open) = tables.open.and_then(|open| open.point_block(space, part, block)) {
        return Ok(open.to_vec());
    }
    let width = usize::from(width);
    let full = point_rows_per_block(width) as u64;
    let rows = layout.rows.saturating_sub(u64::from(block) * full).min(full) as usize;
    let key = keys::points_block(space, part, block);
    let damage =
        |what: String| StoreError::damage("points", format!("space {space}, part {part}, block {block}"), what);
    let table = tables.source.table(keys::POINTS)?;
    let value = table.get(&key[..])?.ok_or_else(|| damage("the block is missing".into()))?;
    frame::open(Kind::Points, &key, value.value())
        .and_then(|payload| points::decode_block(payload, width, rows))
        .map_err(damage)
}
