//! The spaces of a store: which there are, when they are fitted, and their points on disk.

use std::collections::BTreeSet;
use std::sync::{Arc, LazyLock};

use super::books;
use super::nuisance;
use super::prepare::{contributions, with_full};
use super::rebuild::{Rewrite, contributions_of_moments, rebuild};
use super::scheme::Scheme;
use super::{DEFAULT_SPACE, Database};
use crate::error::Error;
use crate::hlac;
use crate::progress::Progress;
use crate::space::{Contribution, Definition, Prior, Recipe, Space, Statistics};
use crate::store::{Reads, StoreError, Transaction};
use crate::synth::Nuisance;

/// The space of this name: as it was fitted, or, where nothing was fitted yet, as the prior alone has it.
pub(super) fn load(state: &impl Reads, name: &str) -> Result<Space, Error> {
    if let Some(bytes) = state.space(name)? {
        return Ok(Space::decode(&bytes)?);
    }
    let scheme = Scheme::of(state);
    match scheme.definitions().iter().find(|definition| definition.name == name) {
        Some(definition) => {
            let statistics = books::load(state, &definition.recipe)?;
            Ok(Space::fit(definition, &statistics, None, prior())?)
        }
        None => Err(Error::NoSuchSpace { name: name.to_owned(), known: scheme.names() }),
    }
}

/// As [`load`], to be looked at only: a space that is not whole is shown as the prior alone has it.
pub(super) fn load_or_prior(state: &impl Reads, name: &str) -> Result<Space, Error> {
    match load(state, name) {
        Err(error) if error.is_damage() => {
            tracing::warn!("{}: `hlacdb reindex` fits spaces anew", crate::error::chain(&error));
            let scheme = Scheme::of(state);
            let definition = scheme.definitions().iter().find(|definition| definition.name == name).ok_or(error)?;
            Ok(Space::fit(definition, &Statistics::new(&definition.recipe), None, prior())?)
        }
        read => read,
    }
}

/// The epoch of the last fit and the textures it was made on; zeros before the first.
pub(super) fn last_fit(state: &impl Reads) -> Result<(u64, u64), Error> {
    match state.space(DEFAULT_SPACE)? {
        Some(bytes) => {
            let space = Space::decode(&bytes)?;
            Ok((space.epoch(), space.textures_at_fit()))
        }
        None => Ok((0, 0)),
    }
}

/// The epoch of the next fit. Spaces that cannot be read do not hinder it: the others say how far epochs have come.
pub(super) fn next_epoch(state: &impl Reads) -> Result<u64, Error> {
    let mut last = 0;
    for definition in Scheme::of(state).definitions() {
        match state.space(&definition.name) {
            Ok(Some(bytes)) => last = last.max(Space::decode(&bytes).map_or(0, |space| space.epoch())),
            Ok(None) => {}
            Err(StoreError::Damage(damage)) => tracing::warn!("{damage}: the space is fitted anew"),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(last + 1)
}

/// What is known of textures before a store has any.
fn prior() -> &'static Prior {
    static PRIOR: LazyLock<Prior> = LazyLock::new(Prior::shipped);
    &PRIOR
}

/// Fits every space on these statistics and keeps it.
pub(super) fn fit(transaction: &mut Transaction, statistics: &[Statistics], epoch: u64) -> Result<(), Error> {
    for definition in Scheme::of(transaction).definitions() {
        if let Some(statistics) = statistics.iter().find(|kept| *kept.recipe() == definition.recipe) {
            fit_one(transaction, definition, statistics, epoch)?;
        }
    }
    transaction.drop_points(DEFAULT_SPACE)?;
    Ok(())
}

/// Fits one space on the statistics of its features and keeps it.
pub(super) fn fit_one(
    transaction: &mut Transaction,
    definition: &Definition,
    statistics: &Statistics,
    epoch: u64,
) -> Result<(), Error> {
    let learned = nuisance::load(transaction, &definition.recipe)?;
    let space = Space::fit(definition, statistics, learned.as_ref(), prior())?.with_epoch(epoch);
    Ok(transaction.put_space(&definition.name, &space.encode())?)
}

/// Keeps the points of the default space of every row that has none yet.
pub(super) fn keep_points(transaction: &mut Transaction) -> Result<(), Error> {
    let space = load(transaction, DEFAULT_SPACE)?;
    super::kept::keep_points(transaction, DEFAULT_SPACE, &space)
}

/// How [`Database::reindex`] goes about it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reindex {
    /// Describe every texture whose voxels are kept anew, and rebuild the statistics from nothing.
    pub reextract: bool,
    /// What should not matter.
    pub nuisance: Learn,
}

/// What [`Database::reindex`] does about the nuisance scatter `N` of the likeness spaces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Learn {
    /// Leaves it as it is: the shipped prior's until nuisances were declared, the store's own from then on.
    #[default]
    Nothing,
    /// Estimates it anew, on at most 512 of the store's textures and copies of them under these nuisances.
    From(Nuisance),
    /// Forgets what was declared: the shipped prior's counts again.
    Forget,
}

/// What [`Database::reindex`] did.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Reindexed {
    /// Textures the spaces were fitted on.
    pub textures: u64,
    /// Textures that were described anew.
    pub described: u64,
    /// Pairs of a texture and a copy under nuisances that were looked at.
    pub nuisance_pairs: u64,
    /// The number of the fit.
    pub epoch: u64,
    /// The spaces that were fitted.
    pub spaces: Vec<String>,
}

impl Database {
    /// The spaces that the store can answer in.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn space_names(&self) -> Result<Vec<String>, Error> {
        Ok(Scheme::of(&self.store().read()?).names())
    }

    /// Every space that the store can answer in, as it is fitted now. Cheap: no point is looked at.
    ///
    /// # Errors
    /// [`Error::Store`], [`Error::Space`].
    pub fn spaces(&self) -> Result<Vec<Space>, Error> {
        let snapshot = self.store().read()?;
        Scheme::of(&snapshot).definitions().iter().map(|definition| load(&snapshot, &definition.name)).collect()
    }

    /// A space as it is fitted now.
    ///
    /// # Errors
    /// [`Error::NoSuchSpace`], [`Error::Store`].
    pub fn space(&self, name: &str) -> Result<Arc<Space>, Error> {
        Ok(Arc::clone(&self.state(&self.store().read()?, name)?.space))
    }

    /// Fits every space on all there is, and maps every texture anew. Statistics that are not whole are built from nothing,
    /// and spaces and points are written whether or not the old ones can be read.
    ///
    /// # Errors
    /// [`Error::Cancelled`], after which nothing has changed; [`Error::NoVoxels`] where nuisances are declared and no
    /// voxels are kept; [`Error::Store`].
    pub fn reindex(&self, options: &Reindex, progress: &dyn Progress) -> Result<Reindexed, Error> {
        self.change_mending(|transaction, books, whole| {
            let counted = |recipe: &Recipe| Ok::<_, Error>(transaction.statistics(&recipe.key())?.is_some());
            let whole = whole
                && Scheme::of(transaction).recipes().iter().map(counted).all(|there| there.is_ok_and(|there| there));
            let described = match (options.reextract, whole || transaction.counts().textures == 0) {
                (true, _) => rebuild(transaction, books, &Rewrite::All, progress)?,
                (false, true) => 0,
                (false, false) => rebuild(transaction, books, &Rewrite::These(&BTreeSet::new()), progress)?,
            };
            let nuisance_pairs = match &options.nuisance {
                Learn::Nothing => 0,
                Learn::From(nuisance) => nuisance::estimate(transaction, nuisance, progress)?,
                Learn::Forget => nuisance::forget(transaction).map(|()| 0)?,
            };
            progress.begin("fitting", None);
            let epoch = next_epoch(transaction)?;
            fit(transaction, books.all(), epoch)?;
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let spaces = Scheme::of(transaction).names();
            Ok(Reindexed { textures: transaction.counts().textures, described, nuisance_pairs, epoch, spaces })
        })
    }
}

/// What a texture adds to the statistics: described anew from its voxels, or, where they are not kept, by its moments.
pub(super) fn contributions_of(state: &impl Reads, id: u64, views: &Scheme) -> Result<Vec<Contribution>, Error> {
    match state.voxels(id) {
        Ok(Some(volume)) => contributions(&hlac::describe(&volume, &with_full(views)), views),
        Ok(None) => contributions_of_moments(state, id, views),
        // Damaged voxels do not stop a texture from being removed.
        Err(StoreError::Damage(_)) => contributions_of_moments(state, id, views),
        Err(error) => Err(error.into()),
    }
}
