//! The spaces of a store: which there are, when they are fitted, and their points on disk.

use std::collections::BTreeSet;
use std::sync::{Arc, LazyLock};

use super::books;
use super::prepare::{contributions, views, with_full};
use super::rebuild::{Rewrite, contributions_of_moments, rebuild};
use super::{DEFAULT_SPACE, Database};
use crate::error::Error;
use crate::hlac::{self, View};
use crate::progress::Progress;
use crate::space::{Contribution, Definition, Prior, Recipe, Space, Statistics};
use crate::store::{Reads, StoreError, Transaction};

/// The definitions of a store's spaces, each restricted to the views that the store keeps.
///
/// `default` and `invariant` mean their recipe on those of its views that there are; where there is none of them, on the
/// views there are. Other spaces whose views are not kept are not there.
pub(super) fn definitions(views: &[View]) -> Vec<Definition> {
    let built_in = Definition::BUILT_IN.into_iter().filter_map(Definition::built_in);
    built_in.filter_map(|definition| definition.restricted_to(views).or_else(|| instead(definition, views))).collect()
}

/// The likeness spaces of a store that keeps none of their views: the same on the views it keeps.
fn instead(definition: Definition, views: &[View]) -> Option<Definition> {
    let pooled = definition.recipe.form() == crate::space::Form::Pooled;
    let recipe = Recipe::new(definition.recipe.form(), views).ok().filter(|_| pooled)?;
    Some(Definition { recipe, ..definition })
}

/// The recipes that statistics are kept of: the plain moments, and whatever the spaces look at.
pub(super) fn recipes(views: &[View]) -> Vec<Recipe> {
    let mut recipes: Vec<Recipe> = definitions(views).into_iter().map(|definition| definition.recipe).collect();
    recipes.sort_by_key(Recipe::key);
    recipes.dedup();
    recipes
}

/// The space of this name: as it was fitted, or, where nothing was fitted yet, as the prior alone has it.
pub(super) fn load(state: &impl Reads, name: &str) -> Result<Space, Error> {
    if let Some(bytes) = state.space(name)? {
        return Ok(Space::decode(&bytes)?);
    }
    let definitions = definitions(&views(state));
    match definitions.iter().find(|definition| definition.name == name) {
        Some(definition) => {
            let statistics = books::load(state, &definition.recipe)?;
            Ok(Space::fit(definition, &statistics, None, prior())?)
        }
        None => Err(Error::NoSuchSpace {
            name: name.to_owned(),
            known: definitions.into_iter().map(|definition| definition.name).collect(),
        }),
    }
}

/// As [`load`], to be looked at only: a space that is not whole is shown as the prior alone has it.
pub(super) fn load_or_prior(state: &impl Reads, name: &str) -> Result<Space, Error> {
    match load(state, name) {
        Err(error) if error.is_damage() => {
            tracing::warn!("{}: `hlacdb reindex` fits spaces anew", crate::error::chain(&error));
            let definitions = definitions(&views(state));
            let definition = definitions.iter().find(|definition| definition.name == name).ok_or(error)?;
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
    for definition in definitions(&views(state)) {
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
    for definition in definitions(&views(transaction)) {
        if let Some(statistics) = statistics.iter().find(|kept| *kept.recipe() == definition.recipe) {
            let space = Space::fit(&definition, statistics, None, prior())?.with_epoch(epoch);
            transaction.put_space(&definition.name, &space.encode())?;
        }
    }
    transaction.drop_points(DEFAULT_SPACE)?;
    Ok(())
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
}

/// What [`Database::reindex`] did.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Reindexed {
    /// Textures the spaces were fitted on.
    pub textures: u64,
    /// Textures that were described anew.
    pub described: u64,
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
        let views = views(&self.store().read()?);
        Ok(definitions(&views).into_iter().map(|definition| definition.name).collect())
    }

    /// Every space that the store can answer in, as it is fitted now. Cheap: no point is looked at.
    ///
    /// # Errors
    /// [`Error::Store`], [`Error::Space`].
    pub fn spaces(&self) -> Result<Vec<Space>, Error> {
        let snapshot = self.store().read()?;
        let definitions = definitions(&views(&snapshot));
        definitions.iter().map(|definition| load(&snapshot, &definition.name)).collect()
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
    /// [`Error::Cancelled`], after which nothing has changed; [`Error::Store`].
    pub fn reindex(&self, options: &Reindex, progress: &dyn Progress) -> Result<Reindexed, Error> {
        self.change_mending(|transaction, books, whole| {
            let counted = |recipe: &Recipe| Ok::<_, Error>(transaction.statistics(&recipe.key())?.is_some());
            let whole =
                whole && recipes(&views(transaction)).iter().map(counted).all(|there| there.is_ok_and(|there| there));
            let described = match (options.reextract, whole || transaction.counts().textures == 0) {
                (true, _) => rebuild(transaction, books, &Rewrite::All, progress)?,
                (false, true) => 0,
                (false, false) => rebuild(transaction, books, &Rewrite::These(&BTreeSet::new()), progress)?,
            };
            progress.begin("fitting", None);
            let epoch = next_epoch(transaction)?;
            fit(transaction, books.all(), epoch)?;
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let spaces = definitions(&views(transaction)).into_iter().map(|definition| definition.name).collect();
            Ok(Reindexed { textures: transaction.counts().textures, described, epoch, spaces })
        })
    }
}

/// What a texture adds to the statistics: described anew from its voxels, or, where they are not kept, by its moments.
pub(super) fn contributions_of(state: &impl Reads, id: u64, views: &[View]) -> Result<Vec<Contribution>, Error> {
    match state.voxels(id) {
        Ok(Some(volume)) => contributions(&hlac::describe(&volume, &with_full(views)), views),
        Ok(None) => contributions_of_moments(state, id, views),
        // Damaged voxels do not stop a texture from being removed.
        Err(StoreError::Damage(_)) => contributions_of_moments(state, id, views),
        Err(error) => Err(error.into()),
    }
}
