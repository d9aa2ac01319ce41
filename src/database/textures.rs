//! Looking at textures.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use serde::{Serialize, Serializer};

use super::prepare::{BlockOf, views};
use super::{Database, held};
use crate::error::Error;
use crate::hlac::{MASK_COUNT, Sums, View};
use crate::store::{Provenance, Reads, Record, Snapshot, StoreError, ViewCode};
use crate::volume::{Shape, Volume, display_path};

/// The identity of a texture's content, written as 64 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContentHash(pub [u8; 32]);

impl fmt::Display for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl Serialize for ContentHash {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A texture: what is known of it besides its numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Texture {
    /// Its id: from 1, in input order, never given again.
    pub id: u64,
    /// Its name.
    pub name: String,
    /// Axis lengths (Z, Y, X); `None` where only moments were imported.
    pub shape: Option<Shape>,
    /// 1 (grey) or 3 (RGB); 0 where that is not known.
    pub channels: u8,
    /// One value per key.
    pub tags: BTreeMap<String, String>,
    /// The identity of its content.
    pub content: Option<ContentHash>,
    /// The file or folder it was read from.
    #[serde(serialize_with = "shown")]
    pub path: Option<PathBuf>,
    /// Where its voxels came from.
    pub source: Option<Provenance>,
    /// Where it was cut from.
    pub block: Option<BlockOf>,
    /// The compressed size of its voxels; `None` where they are not kept.
    pub stored_bytes: Option<u64>,
}

fn shown<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    path.as_deref().map(display_path).serialize(serializer)
}

impl From<Record> for Texture {
    fn from(record: Record) -> Self {
        let narrow = |shape: [u64; 3]| shape.map(|side| usize::try_from(side).unwrap_or(usize::MAX));
        Self {
            id: record.id,
            shape: record.content.as_ref().map(|content| narrow(content.shape)),
            channels: record.content.as_ref().map_or(0, |content| content.channels),
            content: record.content.as_ref().map(|content| ContentHash(content.hash)),
            path: record.path(),
            block: record.cut.map(|cut| BlockOf { origin: narrow(cut.offset), shape: narrow(cut.parent) }),
            stored_bytes: record.voxels.map(|voxels| voxels.bytes),
            name: record.name,
            tags: record.tags,
            source: record.provenance,
        }
    }
}

impl Database {
    /// One texture.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`], in [`Error::Store`].
    pub fn texture(&self, id: u64) -> Result<Texture, Error> {
        let record = self.store().read()?.record(id)?;
        Ok(record.ok_or(StoreError::NoSuchTexture { id })?.into())
    }

    /// The textures that carry all of these tags (all textures where there are none), in id order. One whose record is
    /// damaged is left out, with a warning in the log.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn textures(&self, filters: &[(String, String)]) -> Result<Vec<Texture>, Error> {
        let snapshot = self.store().read()?;
        match tagged_with_all(&snapshot, filters)? {
            None => whole(snapshot.records()),
            Some(ids) => whole(ids.into_iter().filter_map(|id| snapshot.record(id).transpose())),
        }
    }

    /// The voxels of a texture; `None` where they were not kept.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`] and [`StoreError::Damage`], in [`Error::Store`].
    pub fn volume(&self, id: u64) -> Result<Option<Volume>, Error> {
        let snapshot = self.store().read()?;
        known(&snapshot, id)?;
        Ok(snapshot.voxels(id)?)
    }

    /// The exact sums of `full@1` of a texture; `None` where only moments were imported.
    ///
    /// # Errors
    /// As [`Database::volume`].
    pub fn sums(&self, id: u64) -> Result<Option<Sums>, Error> {
        let snapshot = self.store().read()?;
        known(&snapshot, id)?;
        Ok(snapshot.sums(id)?)
    }

    /// The moments of a texture in every view it has.
    ///
    /// # Errors
    /// As [`Database::volume`].
    pub fn moments(&self, id: u64) -> Result<Vec<(View, [f32; MASK_COUNT])>, Error> {
        known_moments(&self.store().read()?, id)
    }

    /// The value of a tag of every texture that carries it, by id.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn labels(&self, key: &str) -> Result<BTreeMap<u64, String>, Error> {
        let snapshot = self.store().read()?;
        let mut labels = BTreeMap::new();
        for (value, _) in snapshot.tag_values(key)? {
            labels.extend(snapshot.tagged(key, &value)?.into_iter().map(|id| (id, value.clone())));
        }
        Ok(labels)
    }
}

/// The textures of those records that are whole.
fn whole(records: impl Iterator<Item = Result<Record, StoreError>>) -> Result<Vec<Texture>, Error> {
    let mut textures = Vec::new();
    for record in records {
        match record {
            Ok(record) => textures.push(record.into()),
            Err(StoreError::Damage(damage)) => tracing::warn!("{damage}: the texture is left out"),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(textures)
}

/// The moments of a texture in every view that it has.
pub(super) fn moments(state: &impl Reads, id: u64) -> Result<Vec<(View, [f32; MASK_COUNT])>, Error> {
    let mut moments = Vec::new();
    for &view in views(state).iter() {
        if let Some(row) = state.descriptor(id, ViewCode(view.code()))? {
            moments.push((view, row));
        }
    }
    Ok(moments)
}

/// The moments of a texture, which must be there.
pub(crate) fn known_moments(state: &impl Reads, id: u64) -> Result<Vec<(View, [f32; MASK_COUNT])>, Error> {
    known(state, id)?;
    moments(state, id)
}

fn known(state: &impl Reads, id: u64) -> Result<(), Error> {
    state.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
    Ok(())
}

/// The textures that a filter let through at a revision of the store.
pub(super) struct Filtered {
    revision: u64,
    filters: Vec<(String, String)>,
    ids: Arc<Vec<u64>>,
}

impl Database {
    /// The ids, ascending, of the textures that carry all of these tags; `None` where no tag is asked for. What the last
    /// filter gave is kept: queries often come in rows.
    pub(crate) fn tagged(
        &self,
        snapshot: &Snapshot,
        filters: &[(String, String)],
    ) -> Result<Option<Arc<Vec<u64>>>, Error> {
        if filters.is_empty() {
            return Ok(None);
        }
        let fits = |last: &&Filtered| last.revision == snapshot.revision() && last.filters == filters;
        if let Some(last) = held(self.filtered.lock()).as_ref().filter(fits) {
            return Ok(Some(Arc::clone(&last.ids)));
        }
        let ids = Arc::new(tagged_with_all(snapshot, filters)?.unwrap_or_default());
        let (revision, filters) = (snapshot.revision(), filters.to_vec());
        *held(self.filtered.lock()) = Some(Filtered { revision, filters, ids: Arc::clone(&ids) });
        Ok(Some(ids))
    }
}

/// The ids, ascending, of the textures that carry all of these tags; `None` where no tag is asked for.
pub(super) fn tagged_with_all(state: &impl Reads, filters: &[(String, String)]) -> Result<Option<Vec<u64>>, Error> {
    let mut allowed: Option<Vec<u64>> = None;
    for (key, value) in filters {
        let ids = match state.tagged(key, value) {
            Err(StoreError::Damage(damage)) => {
                tracing::warn!("{damage}: the tags are read from the records, one by one");
                tagged_by_record(state, key, value)?
            }
            ids => ids?,
        };
        allowed = Some(match allowed {
            None => ids,
            Some(mut both) => {
                both.retain(|id| ids.binary_search(id).is_ok());
                both
            }
        });
    }
    Ok(allowed)
}

/// The ids of the textures that carry a tag, as their records say.
fn tagged_by_record(state: &impl Reads, key: &str, value: &str) -> Result<Vec<u64>, Error> {
    let mut ids = Vec::new();
    for record in state.records() {
        match record {
            Ok(record) if record.tags.get(key).is_some_and(|held| held == value) => ids.push(record.id),
            Ok(_) | Err(StoreError::Damage(_)) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(ids)
}
