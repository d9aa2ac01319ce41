//! What is stored of single textures.

use std::collections::BTreeMap;

use crate::database::filter::matching_ids;
use crate::database::handle::Database;
use crate::database::points::descriptors::{check_exists, existing_descriptor};
use crate::database::texture::Texture;
use crate::error::Error;
use crate::hlac::Sums;
use crate::space::Descriptor;
use crate::store::{Reads, Record, StoreError};
use crate::volume::Volume;
use crate::{TagFilter, TextureId};

impl Database {
    /// What is recorded of a texture.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`], in [`Error::Store`].
    pub fn texture(&self, id: impl Into<TextureId>) -> Result<Texture, Error> {
        let id = id.into().get();
        let record = self.store().read()?.record(id)?;
        Ok(record.ok_or(StoreError::NoSuchTexture { id })?.into())
    }

    /// The textures that match all filters, in id order. Textures whose records are damaged are left out, with a warning in the
    /// log.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn textures(&self, filters: &[TagFilter]) -> Result<Vec<Texture>, Error> {
        let snapshot = self.store().read()?;
        match matching_ids(&snapshot, filters)? {
            None => intact(snapshot.records()),
            Some(ids) => intact(ids.into_iter().filter_map(|id| snapshot.record(id).transpose())),
        }
    }

    /// The voxels of a texture; `None` if they are not stored.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`] and [`StoreError::Damage`], in [`Error::Store`].
    pub fn volume(&self, id: impl Into<TextureId>) -> Result<Option<Volume>, Error> {
        let id = id.into().get();
        let snapshot = self.store().read()?;
        check_exists(&snapshot, id)?;
        Ok(snapshot.voxels(id)?)
    }

    /// The exact sums of `full@1` of a texture; `None` if only moments were imported.
    ///
    /// # Errors
    /// As [`Database::volume`].
    pub fn sums(&self, id: impl Into<TextureId>) -> Result<Option<Sums>, Error> {
        let id = id.into().get();
        let snapshot = self.store().read()?;
        check_exists(&snapshot, id)?;
        Ok(snapshot.sums(id)?)
    }

    /// The moments of a texture in every view that it has.
    ///
    /// # Errors
    /// As [`Database::volume`].
    pub fn descriptor(&self, id: impl Into<TextureId>) -> Result<Descriptor, Error> {
        existing_descriptor(&self.store().read()?, id.into().get())
    }

    /// The value of a tag for every texture that has it.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn labels(&self, key: &str) -> Result<BTreeMap<TextureId, String>, Error> {
        let snapshot = self.store().read()?;
        let mut labels = BTreeMap::new();
        for (value, _) in snapshot.tag_values(key)? {
            labels.extend(snapshot.tagged(key, &value)?.into_iter().map(|id| (id.into(), value.clone())));
        }
        Ok(labels)
    }
}

/// The textures of those records that can be read.
fn intact(records: impl Iterator<Item = Result<Record, StoreError>>) -> Result<Vec<Texture>, Error> {
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
