//! [`Transaction`]: the one writer's changes, all or none.

mod points;

use std::cell::Cell;
use std::collections::BTreeMap;
use std::marker::PhantomData;

use redb::WriteTransaction;

use crate::hlac::{MASK_COUNT, Sums};
use crate::store::access::blobs;
use crate::store::access::reads::sealed::Source as _;
use crate::store::access::reads::{self, Reads, sealed};
use crate::store::access::snapshot;
use crate::store::access::tables::{Source, Tables};
use crate::store::access::write_buffer::WriteBuffer;
use crate::store::error::StoreError;
use crate::store::format::codec;
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
use crate::store::format::frame::{self, Kind};
use crate::store::format::header::Settings;
use crate::store::format::header::{KEY_SETTINGS, KEY_STATE, State};
use crate::store::format::keys;
use crate::store::format::record::{Content, Cut, Provenance, Record, StoredRecord};
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock};
use crate::store::format::sums;
use crate::store::format::voxels::CompressedVoxels;
use crate::store::os::panic_boundary::guarded;

/// A texture on its way into the store. The default is an empty one: set what is known.
#[derive(Clone, Debug, Default)]
pub struct NewTexture {
    /// The display name.
    pub name: String,
    /// The path it was read from, as raw bytes ([`path_bytes`](super::path_bytes)).
    pub path: Option<Vec<u8>>,
    /// Shape, channels and hash; may be left out where `voxels` are given, which know them.
    pub content: Option<Content>,
    /// Where the samples came from.
    pub provenance: Option<Provenance>,
    /// The place in a larger volume, where it was cut from one.
    pub cut: Option<Cut>,
    /// Tags: one value per key.
    pub tags: BTreeMap<String, String>,
    /// The voxels, where they are to be kept.
    pub voxels: Option<CompressedVoxels>,
    /// The exact sums of `full@1`.
    pub sums: Option<Sums>,
    /// The moments in each view that the texture has, every value finite.
    pub descriptors: Vec<(ViewCode, [f32; MASK_COUNT])>,
}

/// The changes of the one writer: all of them are committed, or none. Dropping it undoes everything.
///
/// It reads its own changes through [`Reads`]. An error of the kinds [`StoreError::Invalid`], [`StoreError::Duplicate`]
/// and [`StoreError::NoSuchTexture`] leaves it usable; after any other it can only be dropped.
pub struct Transaction {
    transaction: WriteTransaction,
    state: State,
    settings: Settings,
    open: WriteBuffer,
    /// Set while an operation writes: what stays set was interrupted half-way.
    broken: bool,
    /// The engine refuses to open a table twice, so a transaction is used by one thread at a time.
    one_thread: PhantomData<Cell<()>>,
}

impl Transaction {
    pub(in crate::store) fn new(transaction: WriteTransaction) -> Result<Self, StoreError> {
        let (state, settings) = snapshot::read_meta(Source::Write(&transaction))?;
        let open = WriteBuffer::default();
        Ok(Self { transaction, state, settings, open, broken: false, one_thread: PhantomData })
    }

    /// Adds a texture whole: record, hash, tags, voxels, sums and descriptors. Returns its id, the next one.
    ///
    /// # Errors
    /// [`StoreError::Duplicate`] where a texture of the same content is there; [`StoreError::Invalid`] for moments that
    /// are not finite, a view given twice, malformed tags, or content that contradicts the voxels.
    pub fn add(&mut self, texture: NewTexture) -> Result<u64, StoreError> {
        let NewTexture { name, path, content, provenance, cut, tags, voxels, sums, descriptors } = texture;
        let content = match (content, &voxels) {
            (Some(content), Some(voxels)) if content != *voxels.content() => {
                return Err(StoreError::invalid("the content that was given is not that of the voxels"));
            }
            (None, Some(voxels)) => Some(voxels.content().clone()),
            (content, _) => content,
        };
        if let Some(content) = &content
            && let Some(id) = self.find(&content.hash)?
        {
            return Err(StoreError::Duplicate { id });
        }
        tags.iter().try_for_each(|(key, value)| check_tag(key, value))?;
        check_descriptors(&descriptors)?;
        let kept = voxels.as_ref().map(CompressedVoxels::stored);
        let has_sums = sums.is_some();
        let record = StoredRecord { name, path, content, provenance, cut, tags, voxels: kept, has_sums };
        let encoded = encode_record(&record)?;
        self.writing(|this| {
            let id = this.state.next_id;
            this.insert(keys::TEXTURES, id, &*frame::seal(Kind::Record, &id.to_le_bytes(), &encoded))?;
            if let Some(content) = &record.content {
                this.insert(keys::HASHES, &content.hash, &reads::hash_value(&content.hash, id))?;
            }
            this.insert_tags(id, &record.tags)?;
            if let Some(voxels) = &voxels {
                this.insert_chunks(id, voxels)?;
            }
            if let Some(sums) = &sums {
                this.insert(keys::SUMS, id, &*sums::encode(id, sums))?;
            }
            this.add_row(id, &descriptors)?;
            this.state.next_id += 1;
            this.state.live += 1;
            Ok(id)
        })
    }

    /// Removes a texture: its record, hash, tags, voxels and sums; its row stays as a tombstone until rows are compacted.
    /// Returns the record it had.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`].
    pub fn remove(&mut self, id: u64) -> Result<Record, StoreError> {
        let record = self.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        let Some(row) = self.row(id)? else {
            return Err(StoreError::damage("rows", format!("id {id}"), "the texture has no row"));
        };
        self.writing(|this| {
            this.delete(keys::TEXTURES, id)?;
            if let Some(content) = &record.content {
                this.delete(keys::HASHES, &content.hash)?;
            }
            for (key, value) in &record.tags {
                this.delete(keys::TAGS, &*keys::tag(key, value, id))?;
            }
            for n in 0..record.voxels.map_or(0, |voxels| voxels.pieces) {
                this.delete(keys::CHUNKS, (id, n))?;
            }
            this.delete(keys::SUMS, id)?;
            this.bury((row / ROWS_PER_BLOCK as u64) as u32, (row % ROWS_PER_BLOCK as u64) as usize)
        })?;
        Ok(record)
    }

    /// Makes a row a tombstone.
    pub(in crate::store) fn bury(&mut self, block: u32, row: usize) -> Result<(), StoreError> {
        self.open_row_block(block)?.live.set(row, false);
        self.state.live = self.state.live.saturating_sub(1);
        Ok(())
    }

    /// Removes the pieces of a texture's voxels, however many there are.
    pub(in crate::store) fn delete_chunks(&self, id: u64) -> Result<(), StoreError> {
        let mut table = self.transaction.open_table(keys::CHUNKS).map_err(StoreError::when("opening a table"))?;
        let all = (id, 0)..=(id, u32::MAX);
        table.retain_in(all, |_, _| false).map_err(StoreError::when("writing the store"))
    }

    /// Sets the tag `key` of a texture, in place of the value that it had.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`]; [`StoreError::Invalid`] for an empty key, NUL, or too long.
    pub fn set_tag(&mut self, id: u64, key: &str, value: &str) -> Result<(), StoreError> {
        check_tag(key, value)?;
        let mut record = self.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        let before = record.tags.insert(key.to_owned(), value.to_owned());
        if before.as_deref() == Some(value) {
            return Ok(());
        }
        let encoded = encode_record(&record.into())?;
        self.writing(|this| {
            if let Some(before) = before {
                this.delete(keys::TAGS, &*keys::tag(key, &before, id))?;
            }
            this.insert_tag(id, key, value)?;
            this.insert(keys::TEXTURES, id, &*frame::seal(Kind::Record, &id.to_le_bytes(), &encoded))
        })
    }

    /// Removes the tag `key` of a texture; whether it had one.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`].
    pub fn unset_tag(&mut self, id: u64, key: &str) -> Result<bool, StoreError> {
        let mut record = self.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        let Some(before) = record.tags.remove(key) else { return Ok(false) };
        let encoded = encode_record(&record.into())?;
        self.writing(|this| {
            this.delete(keys::TAGS, &*keys::tag(key, &before, id))?;
            this.insert(keys::TEXTURES, id, &*frame::seal(Kind::Record, &id.to_le_bytes(), &encoded))
        })?;
        Ok(true)
    }

    /// Writes moments of a texture anew, view by view; `None` takes a view away. Other views stay. Cheapest in the order
    /// of ids, where each block is written once.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`]; [`StoreError::Invalid`] for moments that are not finite or a view given twice.
    pub fn set_descriptors(
        &mut self,
        id: u64,
        descriptors: &[(ViewCode, Option<[f32; MASK_COUNT]>)],
    ) -> Result<(), StoreError> {
        let given: Vec<_> = descriptors.iter().filter_map(|(view, moments)| Some((*view, (*moments)?))).collect();
        check_descriptors(&given)?;
        let row = self.row(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        self.writing(|this| {
            for (view, moments) in descriptors {
                this.set_descriptor(row, *view, moments.as_ref())?;
            }
            Ok(())
        })
    }

    /// Writes the exact sums of `full@1` of a texture anew.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`].
    pub fn set_sums(&mut self, id: u64, sums: &Sums) -> Result<(), StoreError> {
        let mut record = self.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        record.has_sums = true;
        let encoded = encode_record(&record.into())?;
        self.writing(|this| {
            this.insert(keys::SUMS, id, &*sums::encode(id, sums))?;
            this.insert(keys::TEXTURES, id, &*frame::seal(Kind::Record, &id.to_le_bytes(), &encoded))
        })
    }

    /// Replaces the settings.
    pub fn put_settings(&mut self, settings: Settings) -> Result<(), StoreError> {
        let encoded = codec::encode(&settings).ok_or_else(|| StoreError::invalid("the settings are too long"))?;
        self.writing(|this| {
            this.insert(keys::META, KEY_SETTINGS, &*frame::seal(Kind::Settings, KEY_SETTINGS, &encoded))
        })?;
        self.settings = settings;
        Ok(())
    }

    /// Keeps `bytes` under `key`, in place of what was there.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] for an empty key, NUL, or more than [`MAX_NAME`](super::MAX_NAME) bytes.
    pub fn put_statistics(&mut self, key: &str, bytes: &[u8]) -> Result<(), StoreError> {
        check_name(key)?;
        self.put_blob(blobs::STATISTICS, key, bytes)
    }

    /// Removes the statistics under `key`; whether there were any.
    pub fn drop_statistics(&mut self, key: &str) -> Result<bool, StoreError> {
        self.writing(|this| blobs::STATISTICS.remove(Source::Write(&this.transaction), key))
    }

    /// Keeps a space under `name`, in place of what was there. Its points stay: [`Transaction::begin_points`] replaces
    /// them.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] for a malformed name, as for [`Transaction::put_statistics`].
    pub fn put_space(&mut self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        check_name(name)?;
        self.put_blob(blobs::SPACES, name, bytes)
    }

    /// Removes a space and its points; whether there was one.
    pub fn drop_space(&mut self, name: &str) -> Result<bool, StoreError> {
        self.drop_points(name)?;
        self.writing(|this| blobs::SPACES.remove(Source::Write(&this.transaction), name))
    }

    /// Makes everything durable and visible, at once. Returns the new revision.
    ///
    /// # Errors
    /// [`StoreError::Broken`] after a failed operation; any other means that the changes may or may not have become
    /// durable, as a whole: the handle takes no more changes, and reopening shows which.
    pub fn commit(mut self) -> Result<u64, StoreError> {
        self.flush()?;
        self.state.revision += 1;
        let encoded = codec::encode(&self.state).ok_or(StoreError::Broken)?;
        self.insert(keys::META, KEY_STATE, &*frame::seal(Kind::State, KEY_STATE, &encoded))?;
        let Self { transaction, state, .. } = self;
        guarded("(file)", || transaction.commit().map_err(StoreError::when("committing")))?;
        Ok(state.revision)
    }

    /// Writes every open block to its table.
    pub(in crate::store) fn flush(&mut self) -> Result<(), StoreError> {
        self.writing(|this| {
            this.close_row_block()?;
            this.close_descriptor_blocks()?;
            let points = std::mem::take(&mut this.open.points);
            points.into_iter().try_for_each(|((space, part), (block, values))| {
                let layout = this.points_layout(&space)?;
                let width = layout.and_then(|layout| layout.widths.get(usize::from(part)).copied()).unwrap_or(1);
                this.put_point_block(&space, part, block, usize::from(width), &values)
            })
        })
    }

    /// After compaction: how many rows there are.
    pub(in crate::store) fn set_rows(&mut self, rows: u64) {
        self.state.rows = rows;
    }

    /// After a salvage: the counters.
    pub(in crate::store) fn set_state(&mut self, state: State) {
        self.state = state;
    }

    /// Keeps a blob in one of the two tables.
    pub(in crate::store) fn put_blob(
        &mut self,
        blobs: blobs::Blobs,
        name: &str,
        bytes: &[u8],
    ) -> Result<(), StoreError> {
        self.writing(|this| blobs.put(Source::Write(&this.transaction), name, bytes))
    }

    /// Runs an operation that writes. Where it fails the transaction is broken: it may be half done.
    pub(in crate::store) fn writing<T>(
        &mut self,
        operation: impl FnOnce(&mut Self) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        if self.broken {
            return Err(StoreError::Broken);
        }
        self.broken = true;
        let done = guarded("(file)", || operation(self))?;
        self.broken = false;
        Ok(done)
    }

    pub(in crate::store) fn insert<'k, 'v, K: redb::Key + 'static, V: redb::Value + 'static>(
        &self,
        table: redb::TableDefinition<K, V>,
        key: impl std::borrow::Borrow<K::SelfType<'k>>,
        value: impl std::borrow::Borrow<V::SelfType<'v>>,
    ) -> Result<(), StoreError> {
        let mut table = self.transaction.open_table(table).map_err(StoreError::when("opening a table"))?;
        table.insert(key, value).map(drop).map_err(StoreError::when("writing the store"))
    }

    pub(in crate::store) fn delete<'k, K: redb::Key + 'static, V: redb::Value + 'static>(
        &self,
        table: redb::TableDefinition<K, V>,
        key: impl std::borrow::Borrow<K::SelfType<'k>>,
    ) -> Result<(), StoreError> {
        let mut table = self.transaction.open_table(table).map_err(StoreError::when("opening a table"))?;
        table.remove(key).map(drop).map_err(StoreError::when("writing the store"))
    }

    fn insert_tags(&self, id: u64, tags: &BTreeMap<String, String>) -> Result<(), StoreError> {
        tags.iter().try_for_each(|(key, value)| self.insert_tag(id, key, value))
    }

    pub(in crate::store) fn insert_tag(&self, id: u64, key: &str, value: &str) -> Result<(), StoreError> {
        let key = keys::tag(key, value, id);
        self.insert(keys::TAGS, &*key, &frame::short_sum(&key))
    }

    fn insert_chunks(&self, id: u64, voxels: &CompressedVoxels) -> Result<(), StoreError> {
        let mut table = self.transaction.open_table(keys::CHUNKS).map_err(StoreError::when("opening a table"))?;
        for (n, piece) in voxels.pieces().enumerate() {
            let value = frame::seal(Kind::Voxels, &keys::chunk_bytes(id, n as u32), piece);
            table.insert((id, n as u32), &value[..]).map_err(StoreError::when("writing the store"))?;
        }
        Ok(())
    }

    pub(in crate::store) fn add_row(
        &mut self,
        id: u64,
        descriptors: &[(ViewCode, [f32; MASK_COUNT])],
    ) -> Result<(), StoreError> {
        let row = self.state.rows;
        self.open_row_block((row / ROWS_PER_BLOCK as u64) as u32)?.push(id);
        for (view, moments) in descriptors {
            self.set_descriptor(row, *view, Some(moments))?;
        }
        self.state.rows += 1;
        Ok(())
    }

    /// The row block `block`, open for changes; the one that was open before is written.
    fn open_row_block(&mut self, block: u32) -> Result<&mut RowBlock, StoreError> {
        if self.open.row_block(block).is_none() {
            self.close_row_block()?;
            let there = u64::from(block) * (ROWS_PER_BLOCK as u64) < self.state.rows;
            let rows = if there { reads::row_block(self.tables(), block)? } else { RowBlock::default() };
            self.open.rows = Some((block, rows));
        }
        Ok(&mut self.open.rows.get_or_insert_default().1)
    }

    fn close_row_block(&mut self) -> Result<(), StoreError> {
        let Some((block, rows)) = self.open.rows.take() else { return Ok(()) };
        self.put_row_block(block, &rows)
    }

    pub(in crate::store) fn put_row_block(&self, block: u32, rows: &RowBlock) -> Result<(), StoreError> {
        let mut builder = frame::Builder::new(Kind::Rows, 16 + 3 * rows.ids.len());
        rows.encode(builder.payload());
        self.insert(keys::ROWS, block, &*builder.seal(&block.to_le_bytes()))
    }

    pub(in crate::store) fn set_descriptor(
        &mut self,
        row: u64,
        view: ViewCode,
        moments: Option<&[f32; MASK_COUNT]>,
    ) -> Result<(), StoreError> {
        let block = (row / DESCRIPTOR_ROWS as u64) as u32;
        if self.open.descriptors.as_ref().is_none_or(|(number, _)| *number != block) {
            self.close_descriptor_blocks()?;
            self.open.descriptors = Some((block, BTreeMap::new()));
        }
        let loaded = match self.open.descriptor_block(view, block) {
            Some(_) => None,
            None => Some(reads::descriptor_block(self.tables(), view, block)?.unwrap_or_default()),
        };
        let (_, blocks) = self.open.descriptors.get_or_insert_default();
        let rows = blocks.entry(view).or_default();
        if let Some(loaded) = loaded {
            *rows = loaded;
        }
        rows.set((row % DESCRIPTOR_ROWS as u64) as usize, moments);
        Ok(())
    }

    fn close_descriptor_blocks(&mut self) -> Result<(), StoreError> {
        let Some((block, blocks)) = self.open.descriptors.take() else { return Ok(()) };
        blocks.into_iter().try_for_each(|(view, rows)| self.put_descriptor_block(view, block, &rows))
    }

    pub(in crate::store) fn put_descriptor_block(
        &self,
        view: ViewCode,
        block: u32,
        rows: &DescriptorBlock,
    ) -> Result<(), StoreError> {
        if rows.present() == 0 {
            return self.delete(keys::DESCRIPTORS, (view.0, block));
        }
        let mut builder = frame::Builder::new(Kind::Descriptors, DescriptorBlock::encoded_len(rows.len()));
        rows.encode(builder.payload());
        let value = builder.seal(&keys::descriptor_bytes(view.0, block));
        self.insert(keys::DESCRIPTORS, (view.0, block), &*value)
    }
}

impl sealed::Source for Transaction {
    fn tables(&self) -> Tables<'_> {
        Tables { source: Source::Write(&self.transaction), state: &self.state, open: Some(&self.open) }
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

fn encode_record(record: &StoredRecord) -> Result<Vec<u8>, StoreError> {
    codec::encode(record)
        .ok_or_else(|| StoreError::invalid(format!("the record is longer than {} bytes", codec::LIMIT)))
}

/// Names of statistics and spaces.
fn check_name(name: &str) -> Result<(), StoreError> {
    if name.is_empty() || name.len() > keys::MAX_NAME || name.contains('\0') {
        let (name, most) = (name.escape_debug(), keys::MAX_NAME);
        return Err(StoreError::invalid(format!("\"{name}\" is no name: it must have 1 to {most} bytes and no NUL")));
    }
    Ok(())
}

fn check_tag(key: &str, value: &str) -> Result<(), StoreError> {
    let (longest_key, longest) = (keys::MAX_NAME, keys::MAX_TAG_VALUE);
    if key.is_empty() || key.len() > longest_key || key.contains('\0') {
        let key = key.escape_debug();
        let what = format!("\"{key}\" is no key for a tag: it must have 1 to {longest_key} bytes and no NUL");
        return Err(StoreError::invalid(what));
    }
    if value.len() > longest || value.contains('\0') {
        let what = format!("the value of the tag {} must have at most {longest} bytes and no NUL", key.escape_debug());
        return Err(StoreError::invalid(what));
    }
    Ok(())
}

fn check_descriptors(descriptors: &[(ViewCode, [f32; MASK_COUNT])]) -> Result<(), StoreError> {
    for (number, (view, moments)) in descriptors.iter().enumerate() {
        if let Some(mask) = moments.iter().position(|moment| !moment.is_finite()) {
            let what = format!("moment {mask} in view {} is not finite", view.0);
            return Err(StoreError::invalid(what));
        }
        if descriptors.iter().take(number).any(|(other, _)| other == view) {
            return Err(StoreError::invalid(format!("view {} is given twice", view.0)));
        }
    }
    Ok(())
}
