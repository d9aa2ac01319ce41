//! Adding, removing and tagging textures: every change is one transaction, with its statistics and points.

pub(crate) mod prepare;

use std::borrow::Cow;

use rayon::prelude::*;

use self::prepare::{Preparation, Prepared, PreparedTexture, describe};
use crate::database::fit::spaces::fit;
use crate::database::handle::Database;
use crate::database::points::contributions::{contribution_blocks, contributions_of, described_contributions};
use crate::database::points::spaces::last_fit;
use crate::database::points::statistics_cache::StatisticsCache;
use crate::database::scheme::Scheme;
use crate::database::texture::{Meta, Texture};
use crate::error::Error;
use crate::space::{Contribution, Statistics};
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
    /// Adds a texture, durably: when this returns it survives a crash. The same content is never added twice.
    ///
    /// For many textures, [`Database::prepare`] on several threads and [`Database::commit`] in batches is quicker, and
    /// [`crate::ingest`] does that for files.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn add(&self, volume: &Volume, meta: Meta) -> Result<Added, Error> {
        let volumes = self.store().read()?.settings().volumes;
        let content = Content::of(volume);
        let prepared = self.prepare_hashed(Cow::Borrowed(volume), content, meta.into_texture(), volumes)?;
        self.change_if(|transaction, statistics_cache| {
            let mut addition = Addition::new(transaction, statistics_cache)?;
            let added = addition.add(prepared)?;
            let changed = addition.finish()?;
            Ok((added, changed))
        })
    }

    /// Adds prepared textures in one transaction, in their order: all of them, durably, or none.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn commit(&self, prepared: Vec<Prepared>) -> Result<Vec<Added>, Error> {
        self.commit_all(prepared.into_iter().map(|prepared| prepared.0).collect())
    }

    /// As [`Database::commit`].
    pub(crate) fn commit_all(&self, prepared: Vec<PreparedTexture<'_>>) -> Result<Vec<Added>, Error> {
        if prepared.is_empty() {
            return Ok(Vec::new());
        }
        self.change_if(|transaction, statistics_cache| {
            let mut addition = Addition::new(transaction, statistics_cache)?;
            let added = prepared.into_iter().map(|texture| addition.add(texture)).collect::<Result<_, _>>()?;
            let changed = addition.finish()?;
            Ok((added, changed))
        })
    }

    /// Removes textures, durably: all of them, or, where one is not there, none. Returns the ids removed, each once. One whose
    /// record cannot be read is removed with all that lies under its id, after which its content can be added anew.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`], in [`Error::Store`].
    pub fn remove(&self, ids: impl IntoIterator<Item = impl Into<TextureId>>) -> Result<Vec<TextureId>, Error> {
        let mut ids: Vec<u64> = ids.into_iter().map(|id| id.into().get()).collect();
        ids.sort_unstable();
        ids.dedup();
        self.change(|transaction, statistics_cache| {
            let views = Scheme::of(transaction);
            for &id in &ids {
                let whole = match transaction.record(id) {
                    Ok(None) => return Err(StoreError::NoSuchTexture { id }.into()),
                    Ok(Some(_)) => true,
                    Err(StoreError::Damage(_)) => false,
                    Err(error) => return Err(error.into()),
                };
                let parts = contributions_of(transaction, id, &views)?;
                match whole {
                    true => drop(transaction.remove(id)?),
                    false => transaction.remove_damaged(id)?,
                }
                statistics_cache.remove(&parts)?;
            }
            renew_extremes(transaction, statistics_cache)
        })?;
        Ok(ids.into_iter().map(TextureId::from).collect())
    }

    /// Changes the tags of a texture, durably. Returns the texture as it is then.
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
        self.change(|transaction, statistics_cache| {
            let recipes = Scheme::of(transaction).recipes();
            let contributions: Vec<Vec<Contribution>> = textures
                .par_iter()
                .map(|texture| described_contributions(texture, &recipes))
                .collect::<Result<_, _>>()?;
            let mut fits = Fits::new(transaction)?;
            // Counting and writing do not wait for one another.
            let (counted, ids) = rayon::join(
                || fits.count_all(statistics_cache, &contributions),
                || textures.into_iter().map(|texture| transaction.add(texture)).collect::<Result<Vec<u64>, _>>(),
            );
            counted?;
            let ids = ids?;
            fits.finish(transaction)?;
            Ok(ids)
        })
    }
}

/// Prepared textures on their way into one transaction.
struct Addition<'a> {
    transaction: &'a mut Transaction,
    statistics_cache: &'a mut StatisticsCache,
    fits: Fits,
    changed: bool,
}

impl<'a> Addition<'a> {
    fn new(transaction: &'a mut Transaction, statistics_cache: &'a mut StatisticsCache) -> Result<Self, Error> {
        let fits = Fits::new(transaction)?;
        Ok(Self { transaction, statistics_cache, fits, changed: false })
    }

    fn add(&mut self, prepared: PreparedTexture<'_>) -> Result<Added, Error> {
        if let Some(id) = self.transaction.find(&prepared.content.hash)? {
            return Ok(Added::Duplicate(id.into()));
        }
        let PreparedTexture { content, texture, state } = prepared;
        let (texture, contributions) = match state {
            Preparation::Described(contributions) => (texture, contributions),
            // The texture that had this content was removed since it was looked for.
            Preparation::Duplicate(volume, volumes) => {
                describe(&volume, content, texture, volumes, &Scheme::of(self.transaction))?
            }
        };
        let id = self.transaction.add(texture)?;
        self.statistics_cache.add(&contributions)?;
        self.fits.after(self.statistics_cache);
        self.changed = true;
        Ok(Added::New(id.into()))
    }

    /// Fits the spaces where that is due. True where anything was added.
    fn finish(self) -> Result<bool, Error> {
        self.fits.finish(self.transaction)?;
        Ok(self.changed)
    }
}

/// Fits that become due while textures are added: at each doubling, on the statistics of that very moment, so that one
/// batch and many give the same.
struct Fits {
    epoch: u64,
    count: u64,
    due: Option<Vec<Statistics>>,
}

impl Fits {
    fn new(transaction: &Transaction) -> Result<Self, Error> {
        let (epoch, count) = last_fit(transaction)?;
        Ok(Self { epoch, count, due: None })
    }

    /// Notes the statistics where the store has just doubled.
    fn after(&mut self, statistics_cache: &StatisticsCache) {
        let textures = statistics_cache.textures();
        if textures > 0 && textures >= 2 * self.count {
            self.count = textures;
            self.epoch += 1;
            self.due = Some(statistics_cache.all().to_vec());
        }
    }

    /// Counts textures in, and notes the statistics at the last doubling among them: earlier ones would be replaced.
    fn count_all(
        &mut self,
        statistics_cache: &mut StatisticsCache,
        textures: &[Vec<Contribution>],
    ) -> Result<(), Error> {
        let (mut counted, mut last) = (statistics_cache.textures(), None);
        for (at, texture) in textures.iter().enumerate() {
            counted += u64::from(statistics_cache.counts(texture));
            if counted > 0 && counted >= 2 * self.count {
                self.count = counted;
                self.epoch += 1;
                last = Some(at + 1);
            }
        }
        let (before, after) = textures.split_at(last.unwrap_or(0));
        statistics_cache.add_all(before)?;
        if last.is_some() {
            self.due = Some(statistics_cache.all().to_vec());
        }
        statistics_cache.add_all(after)
    }

    /// Fits on what was noted last; earlier fits of the same batch would have been replaced by it.
    fn finish(self, transaction: &mut Transaction) -> Result<(), Error> {
        match self.due {
            Some(statistics) => fit(transaction, &statistics, self.epoch),
            None => Ok(()),
        }
    }
}

/// Looks for lowest and highest moments anew where a removed texture had one of them.
fn renew_extremes(transaction: &Transaction, statistics_cache: &mut StatisticsCache) -> Result<(), Error> {
    for statistics in statistics_cache.stale_extremes() {
        let recipe = statistics.feature_set().clone();
        let blocks = contribution_blocks(transaction, &recipe)?;
        let parts = blocks.flat_map(|block| match block {
            Ok(parts) => parts.into_iter().map(Ok).collect(),
            Err(error) => vec![Err(error)],
        });
        statistics.renew_extremes(parts)?;
    }
    Ok(())
}
