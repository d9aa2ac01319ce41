//! Records, and the tables that are linked with them: rows, hashes, tags, chunks, sums.

use std::collections::{HashMap, HashSet};

use super::walk::{Expected, Walk};
use crate::store::access::reads::sealed::Source as _;
use crate::store::access::values;
use crate::store::damage::{Damage, DamageKey};
use crate::store::error::StoreError;
use crate::store::format::record::StoredRecord;
use crate::store::format::tables::{CHUNKS, HASHES, META, ROWS, SUMS, TAGS, TEXTURES};
use crate::store::format::{hashes, sums, tags, voxels};

impl Walk<'_> {
    /// Checks all of them.
    pub(crate) fn textures(&mut self) -> Result<(), StoreError> {
        self.table(Self::records)?;
        self.table(Self::rows)?;
        self.table(Self::hashes)?;
        self.table(Self::tags)?;
        self.table(Self::chunks)?;
        self.table(Self::sums)
    }

    fn records(&mut self) -> Result<(), StoreError> {
        let name = TEXTURES.name;
        let tables = self.snapshot.tables();
        let (live, next_id) = (tables.state.live, tables.state.next_id);
        let table = tables.source.table(TEXTURES)?;
        self.begin(name, "checking records", live)?;
        for entry in table.entries()? {
            let entry = entry?;
            let id = entry.key()?;
            self.count(name)?;
            if id == 0 || id >= next_id {
                self.damage(name, DamageKey::Texture(id), format!("ids run from 1 to below {next_id}"));
            }
            let expected = match StoredRecord::open(id, entry.value()?) {
                Ok(record) => Some(Expected::from(record)),
                Err(damage) => {
                    self.contain(Err(damage.into()))?;
                    None
                }
            };
            self.textures.insert(id, expected);
        }
        let found = self.textures.len() as u64;
        if found != live {
            let what = format!("the counters say {live} textures, there are {found}");
            self.damage(META.name, DamageKey::Name("state".into()), what);
        }
        Ok(())
    }

    fn rows(&mut self) -> Result<(), StoreError> {
        let name = ROWS.name;
        let tables = self.snapshot.tables();
        let total = tables.source.table(ROWS)?.len()?;
        let blocks = values::row_blocks(tables);
        self.begin(name, "checking rows", total)?;
        if total != u64::from(blocks) {
            self.damage(name, DamageKey::Whole, format!("there are {total} blocks, the counters say {blocks}"));
        }
        let mut last = 0;
        let mut complete = true;
        let mut live = HashSet::new();
        for block in 0..blocks {
            self.count(name)?;
            let rows = match values::row_block(tables, block) {
                Ok(rows) => rows,
                Err(error) => {
                    complete = false;
                    self.contain(Err(error))?;
                    continue;
                }
            };
            if rows.ids.first().is_some_and(|&first| first <= last) {
                self.damage(name, DamageKey::RowBlock(block), "its ids do not follow those of the block before");
            }
            last = rows.ids.last().copied().unwrap_or(last);
            for (&id, row) in rows.ids.iter().zip(0..) {
                let key = DamageKey::Row { block, row };
                let exists = self.textures.contains_key(&id);
                if rows.live.get(row as usize) {
                    live.insert(id);
                    if !exists {
                        self.damage(name, key, format!("texture {id} does not exist"));
                    }
                } else if exists {
                    self.damage(name, key, format!("texture {id} exists, but its row is a tombstone"));
                }
            }
        }
        if complete {
            let missing: Vec<u64> = self.textures.keys().copied().filter(|id| !live.contains(id)).collect();
            missing.into_iter().for_each(|id| self.damage(name, DamageKey::Texture(id), "the texture has no row"));
        }
        Ok(())
    }

    fn hashes(&mut self) -> Result<(), StoreError> {
        let name = HASHES.name;
        let table = self.snapshot.tables().source.table(HASHES)?;
        self.begin(name, "checking hashes", table.len()?)?;
        for entry in table.entries()? {
            let entry = entry?;
            let hash = entry.key()?;
            self.count(name)?;
            match hashes::open(hash, entry.value()?) {
                Ok(id) => {
                    let key = DamageKey::ContentHash(*hash);
                    self.expect(name, key, id, |expected| expected.hash == Some(*hash), "has another hash");
                }
                Err(damage) => self.contain(Err(damage.into()))?,
            }
        }
        self.each_texture(|walk, id, expected| {
            if let Some(hash) = expected.hash
                && table.get(&hash)?.is_none()
            {
                walk.damage(name, DamageKey::Texture(id), "the hash of the texture is missing");
            }
            Ok(())
        })
    }

    fn tags(&mut self) -> Result<(), StoreError> {
        let name = TAGS.name;
        let table = self.snapshot.tables().source.table(TAGS)?;
        self.begin(name, "checking tags", table.len()?)?;
        for entry in table.entries()? {
            let entry = entry?;
            let bytes = entry.key()?;
            self.count(name)?;
            match tags::open(bytes, entry.value()?) {
                Ok((tag, text, id)) => {
                    let key = DamageKey::Bytes(bytes.to_vec());
                    let matches = |expected: &Expected| expected.tags.get(tag).is_some_and(|value| value == text);
                    self.expect(name, key, id, matches, "has another value of this tag, or none");
                }
                Err(damage) => self.contain(Err(damage.into()))?,
            }
        }
        self.each_texture(|walk, id, expected| {
            for (key, value) in &expected.tags {
                if table.get(&*tags::key(key, value, id))?.is_none() {
                    walk.damage(name, DamageKey::Texture(id), format!("the entry of its tag {key} is missing"));
                }
            }
            Ok(())
        })
    }

    fn chunks(&mut self) -> Result<(), StoreError> {
        let name = CHUNKS.name;
        let table = self.snapshot.tables().source.table(CHUNKS)?;
        self.begin(name, "checking voxels", table.len()?)?;
        let mut found: HashMap<u64, (u32, u64)> = HashMap::new();
        for entry in table.entries()? {
            let entry = entry?;
            let (id, number) = entry.key()?;
            self.count(name)?;
            let key = DamageKey::Chunk { texture: id, number };
            let (chunks, bytes) = found.entry(id).or_default();
            *chunks += 1;
            match voxels::open_chunk(id, number, entry.value()?) {
                Ok(chunk) => *bytes += chunk.len() as u64,
                Err(what) => self.damage(name, key.clone(), what),
            }
            self.expect(name, key, id, |expected| number < expected.chunks, "has no such chunk");
        }
        // The length of a damaged chunk is not known, and the chunk is reported already.
        let damaged: HashSet<u64> = self.damage_so_far().iter().filter_map(of_chunk).collect();
        self.each_texture(|walk, id, expected| {
            let (chunks, bytes) = found.get(&id).copied().unwrap_or_default();
            if (chunks, bytes) != (expected.chunks, expected.bytes) && !damaged.contains(&id) {
                let (of, all) = (expected.chunks, expected.bytes);
                let what = format!("there are {chunks} chunks of {bytes} bytes, the record says {of} of {all}");
                walk.damage(name, DamageKey::Texture(id), what);
            }
            Ok(())
        })
    }

    fn sums(&mut self) -> Result<(), StoreError> {
        let name = SUMS.name;
        let table = self.snapshot.tables().source.table(SUMS)?;
        self.begin(name, "checking sums", table.len()?)?;
        for entry in table.entries()? {
            let entry = entry?;
            let id = entry.key()?;
            self.count(name)?;
            self.contain(sums::open(id, entry.value()?).map(drop).map_err(StoreError::from))?;
            self.expect(name, DamageKey::Texture(id), id, |expected| expected.has_sums, "has no sums");
        }
        self.each_texture(|walk, id, expected| {
            if expected.has_sums && table.get(id)?.is_none() {
                walk.damage(name, DamageKey::Texture(id), "the sums of the texture are missing");
            }
            Ok(())
        })
    }
}

/// The texture of a damaged chunk.
fn of_chunk(damage: &Damage) -> Option<u64> {
    match damage.key {
        DamageKey::Chunk { texture, .. } => Some(texture),
        _ => None,
    }
}
