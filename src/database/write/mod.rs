//! Adding, removing and tagging textures: every change is one transaction, with its statistics and points.

pub(crate) mod prepare;

use std::borrow::Cow;

use rayon::prelude::*;

use self::prepare::{Preparation, PreparationState, PreparedTexture, describe};
use crate::database::handle::Database;
use crate::database::points::contributions::{contribution_blocks, new_contributions, stored_contributions};
use crate::database::points::fitting::DueFit;
use crate::database::points::statistics_cache::StatisticsCache;
use crate::database::scheme::Scheme;
use crate::database::texture::{Meta, Texture};
use crate::error::Error;
use crate::space::Contribution;
use crate::store::{Content, NewTexture, Reads, StoreError, Transaction};
use crate::volume::Volume;
use crate::{TagEdit, TextureId};

/// What became of a texture that was added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Added {
    /// It is in the store, under this id.
    New(TextureId),
    /// The same content was in the store already, under this id; nothing changed.
    Duplicate(TextureId),
}

impl Added {
    /// The texture's id.
    pub fn id(self) -> TextureId {
        match self {
            Self::New(id) | Self::Duplicate(id) => id,
        }
    }
}

impl Database {
    /// Adds a texture durably: when this returns, the texture survives a crash. The same content is never added twice.
    ///
    /// To add many textures it is faster to call [`Database::prepare`] on several threads and [`Database::commit`] with
    /// batches. [`crate::ingest`] does that for files.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn add(&self, volume: &Volume, meta: Meta) -> Result<Added, Error> {
        let volumes = self.store().read()?.settings().volumes;
        let content = Content::of(volume);
        let prepared = self.prepare_hashed(Cow::Borrowed(volume), content, meta.into_texture(), volumes)?;
        self.change_if(|transaction, statistics| {
            let mut addition = Addition::new(transaction, statistics)?;
            let added = addition.add(prepared)?;
            let changed = addition.finish()?;
            Ok((added, changed))
        })
    }

    /// Adds prepared textures in one transaction, in their order: all of them, durably, or none.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn commit(&self, prepared: Vec<PreparedTexture>) -> Result<Vec<Added>, Error> {
        self.commit_all(prepared.into_iter().map(|prepared| prepared.0).collect())
    }

    /// As [`Database::commit`].
    pub(crate) fn commit_all(&self, prepared: Vec<Preparation<'_>>) -> Result<Vec<Added>, Error> {
        if prepared.is_empty() {
            return Ok(Vec::new());
        }
        self.change_if(|transaction, statistics| {
            let mut addition = Addition::new(transaction, statistics)?;
            let added = prepared.into_iter().map(|texture| addition.add(texture)).collect::<Result<_, _>>()?;
            let changed = addition.finish()?;
            Ok((added, changed))
        })
    }

    /// Removes textures durably: all of them, or none if one does not exist. Returns the ids that were removed, each once, in
    /// ascending order.
    ///
    /// A texture whose record cannot be read is removed with everything that is stored under its id, so that its content can
    /// be added again.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`], in [`Error::Store`].
    pub fn remove(&self, ids: impl IntoIterator<Item = impl Into<TextureId>>) -> Result<Vec<TextureId>, Error> {
        let mut ids: Vec<u64> = ids.into_iter().map(|id| id.into().get()).collect();
        ids.sort_unstable();
        ids.dedup();
        self.change(|transaction, statistics| {
            let scheme = Scheme::of(transaction);
            for &id in &ids {
                remove_one(transaction, statistics, id, &scheme)?;
            }
            renew_extremes(transaction, statistics)
        })?;
        Ok(ids.into_iter().map(TextureId::from).collect())
    }

    /// Changes the tags of a texture durably. Returns the texture as it is then.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`]; [`StoreError::Invalid`] for an empty key, in [`Error::Store`].
    pub fn tag(&self, id: impl Into<TextureId>, edit: &TagEdit) -> Result<Texture, Error> {
        let id = id.into().get();
        self.change_records(|transaction| {
            for key in &edit.unset {
                transaction.unset_tag(id, key)?;
            }
            for (key, value) in &edit.set {
                transaction.set_tag(id, key, value)?;
            }
            Ok(transaction.record(id)?.ok_or(StoreError::NoSuchTexture { id })?.into())
        })
    }

    /// Adds textures that come with moments and without octants, in one transaction.
    pub(crate) fn add_described(&self, textures: Vec<NewTexture>) -> Result<Vec<u64>, Error> {
        self.change(|transaction, statistics| {
            let feature_sets = Scheme::of(transaction).feature_sets();
            let contributions: Vec<Vec<Contribution>> = textures
                .par_iter()
                .map(|texture| new_contributions(texture, &feature_sets))
                .collect::<Result<_, _>>()?;
            let mut due = DueFit::new(transaction)?;
            // Statistics and store are written in parallel.
            let (counted, ids) = rayon::join(
                || due.add_all(statistics, &contributions),
                || textures.into_iter().map(|texture| transaction.add(texture)).collect::<Result<Vec<u64>, _>>(),
            );
            counted?;
            let ids = ids?;
            due.finish(transaction)?;
            Ok(ids)
        })
    }
}

/// Adds textures in one transaction.
struct Addition<'a> {
    transaction: &'a mut Transaction,
    statistics: &'a mut StatisticsCache,
    due: DueFit,
    changed: bool,
}

impl<'a> Addition<'a> {
    fn new(transaction: &'a mut Transaction, statistics: &'a mut StatisticsCache) -> Result<Self, Error> {
        let due = DueFit::new(transaction)?;
        Ok(Self { transaction, statistics, due, changed: false })
    }

    fn add(&mut self, prepared: Preparation<'_>) -> Result<Added, Error> {
        if let Some(id) = self.transaction.find(&prepared.content.hash)? {
            return Ok(Added::Duplicate(id.into()));
        }
        let Preparation { content, texture, state } = prepared;
        let (texture, contributions) = match state {
            PreparationState::Described(contributions) => (texture, contributions),
            // The texture that had this content was removed since the volume was prepared.
            PreparationState::Duplicate(volume, volumes) => {
                describe(&volume, content, texture, volumes, &Scheme::of(self.transaction))?
            }
        };
        let id = self.transaction.add(texture)?;
        self.statistics.add(&contributions)?;
        self.due.after(self.statistics);
        self.changed = true;
        Ok(Added::New(id.into()))
    }

    /// Fits the spaces if that is due. True if any texture was added.
    fn finish(self) -> Result<bool, Error> {
        self.due.finish(self.transaction)?;
        Ok(self.changed)
    }
}

fn remove_one(
    transaction: &mut Transaction,
    statistics: &mut StatisticsCache,
    id: u64,
    scheme: &Scheme,
) -> Result<(), Error> {
    let is_readable = match transaction.record(id) {
        Ok(None) => return Err(StoreError::NoSuchTexture { id }.into()),
        Ok(Some(_)) => true,
        Err(StoreError::Damage(_)) => false,
        Err(error) => return Err(error.into()),
    };
    let contributions = stored_contributions(transaction, id, scheme)?;
    match is_readable {
        true => drop(transaction.remove(id)?),
        false => transaction.remove_damaged(id)?,
    }
    statistics.remove(&contributions)
}

/// Recomputes the lowest and highest moments if a removed texture had one of them.
fn renew_extremes(transaction: &Transaction, statistics: &mut StatisticsCache) -> Result<(), Error> {
    for statistics in statistics.stale_extremes() {
        let feature_set = statistics.feature_set().clone();
        let blocks = contribution_blocks(transaction, &feature_set)?;
        let contributions = blocks.flat_map(|block| match block {
            Ok(contributions) => contributions.into_iter().map(Ok).collect(),
            Err(error) => vec![Err(error)],
        });
        statistics.renew_extremes(contributions)?;
    }
    Ok(())
}
