//! Textures in a transaction: adding, removing, tags and sums.

use std::collections::BTreeMap;

use super::Transaction;
use super::checks::{check_descriptors, check_tag};
use crate::hlac::{MASK_COUNT, Sums};
use crate::store::access::reads::Reads;
use crate::store::access::tables::WriteTable;
use crate::store::damage::DamageKey;
use crate::store::error::StoreError;
use crate::store::format::descriptors::ViewCode;
use crate::store::format::record::{Content, Cut, Provenance, Record, StoredRecord};
use crate::store::format::tables::{CHUNKS, HASHES, ROWS, SUMS, TAGS, TEXTURES};
use crate::store::format::voxels::{self, CompressedVoxels};
use crate::store::format::{codec, hashes, sums, tags};

/// A texture to be added. The default is empty: set what is known.
#[derive(Clone, Debug, Default)]
pub struct NewTexture {
    /// The display name.
    pub name: String,
    /// The path that it was read from, as raw bytes ([`path_bytes`](crate::store::path_bytes)).
    pub path: Option<Vec<u8>>,
    /// Shape, channels and hash; optional if `voxels` are given, which include them.
    pub content: Option<Content>,
    /// Where the samples came from.
    pub provenance: Option<Provenance>,
    /// The position in a larger volume, if it was cut from one.
    pub cut: Option<Cut>,
    /// The tags: one value per key.
    pub tags: BTreeMap<String, String>,
    /// The voxels, if they are to be stored.
    pub voxels: Option<CompressedVoxels>,
    /// The exact sums of `full@1`.
    pub sums: Option<Sums>,
    /// The moments in each view that the texture has; all values are finite.
    pub descriptors: Vec<(ViewCode, [f32; MASK_COUNT])>,
}

impl Transaction {
    /// Adds a texture whole: record, hash, tags, voxels, sums and descriptors. Returns its id, which is the next one.
    ///
    /// # Errors
    /// [`StoreError::Duplicate`] if a texture with the same content exists; [`StoreError::Invalid`] for moments that are
    /// not finite, a view given twice, malformed tags, or content that contradicts the voxels.
    pub fn add(&mut self, texture: NewTexture) -> Result<u64, StoreError> {
        let NewTexture { name, path, content, provenance, cut, tags, voxels, sums, descriptors } = texture;
        let content = match (content, &voxels) {
            (Some(content), Some(voxels)) if content != *voxels.content() => {
                return Err(StoreError::invalid("the given content is not that of the voxels"));
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
        let stored = voxels.as_ref().map(CompressedVoxels::stored);
        let has_sums = sums.is_some();
        let record = StoredRecord { name, path, content, provenance, cut, tags, voxels: stored, has_sums };
        let id = self.state.next_id;
        let value = seal_record(&record, id)?;
        self.writing(|this| {
            this.insert(TEXTURES, id, &value[..])?;
            if let Some(content) = &record.content {
                this.insert(HASHES, &content.hash, &hashes::seal(&content.hash, id))?;
            }
            record.tags.iter().try_for_each(|(key, value)| this.insert_tag(id, key, value))?;
            if let Some(voxels) = &voxels {
                this.insert_chunks(id, voxels)?;
            }
            if let Some(sums) = &sums {
                this.insert(SUMS, id, &*sums::seal(id, sums))?;
            }
            this.add_row(id, &descriptors)?;
            this.state.next_id += 1;
            this.state.live += 1;
            Ok(id)
        })
    }

    /// Removes a texture: its record, hash, tags, voxels and sums. Its row stays as a tombstone until rows are compacted.
    /// Returns its record.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`].
    pub fn remove(&mut self, id: u64) -> Result<Record, StoreError> {
        let record = self.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        let Some(row) = self.row(id)? else {
            return Err(StoreError::damage(ROWS.name, DamageKey::Texture(id), "the texture has no row"));
        };
        self.writing(|this| {
            this.delete(TEXTURES, id)?;
            if let Some(content) = &record.content {
                this.delete(HASHES, &content.hash)?;
            }
            for (key, value) in &record.tags {
                this.delete(TAGS, &*tags::key(key, value, id))?;
            }
            for number in 0..record.voxels.map_or(0, |voxels| voxels.chunks) {
                this.delete(CHUNKS, (id, number))?;
            }
            this.delete(SUMS, id)?;
            this.remove_row(row)
        })?;
        Ok(record)
    }

    /// Sets the tag `key` of a texture, in place of an earlier value.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`]; [`StoreError::Invalid`] for an empty key, NUL, or too many bytes.
    pub fn set_tag(&mut self, id: u64, key: &str, value: &str) -> Result<(), StoreError> {
        check_tag(key, value)?;
        let mut record = self.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        let before = record.tags.insert(key.to_owned(), value.to_owned());
        if before.as_deref() == Some(value) {
            return Ok(());
        }
        let sealed = seal_record(&record.into(), id)?;
        self.writing(|this| {
            if let Some(before) = before {
                this.delete(TAGS, &*tags::key(key, &before, id))?;
            }
            this.insert_tag(id, key, value)?;
            this.insert(TEXTURES, id, &sealed[..])
        })
    }

    /// Removes the tag `key` of a texture; returns whether it had one.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`].
    pub fn unset_tag(&mut self, id: u64, key: &str) -> Result<bool, StoreError> {
        let mut record = self.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        let Some(before) = record.tags.remove(key) else { return Ok(false) };
        let sealed = seal_record(&record.into(), id)?;
        self.writing(|this| {
            this.delete(TAGS, &*tags::key(key, &before, id))?;
            this.insert(TEXTURES, id, &sealed[..])
        })?;
        Ok(true)
    }

    /// Replaces the exact sums of `full@1` of a texture.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`].
    pub fn set_sums(&mut self, id: u64, sums: &Sums) -> Result<(), StoreError> {
        let mut record = self.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        record.has_sums = true;
        let sealed = seal_record(&record.into(), id)?;
        self.writing(|this| {
            this.insert(SUMS, id, &*sums::seal(id, sums))?;
            this.insert(TEXTURES, id, &sealed[..])
        })
    }

    /// Removes the chunks of the voxels of a texture, however many there are.
    pub(in crate::store) fn delete_chunks(&self, id: u64) -> Result<(), StoreError> {
        WriteTable::open(&self.transaction, CHUNKS)?.remove_range((id, 0)..=(id, u32::MAX))
    }

    /// Writes the entry of a tag.
    pub(in crate::store) fn insert_tag(&self, id: u64, key: &str, value: &str) -> Result<(), StoreError> {
        let key = tags::key(key, value, id);
        self.insert(TAGS, &*key, &tags::seal(&key))
    }

    fn insert_chunks(&self, id: u64, voxels: &CompressedVoxels) -> Result<(), StoreError> {
        let mut table = WriteTable::open(&self.transaction, CHUNKS)?;
        for (chunk, number) in voxels.chunks().zip(0..) {
            table.insert((id, number), &voxels::seal_chunk(id, number, chunk)[..])?;
        }
        Ok(())
    }
}

fn seal_record(record: &StoredRecord, id: u64) -> Result<Vec<u8>, StoreError> {
    let too_long = || StoreError::invalid(format!("the record is longer than {} bytes", codec::LIMIT));
    record.seal(id).ok_or_else(too_long)
}
