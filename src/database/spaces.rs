//! The spaces of a store: which there are, when they are fitted, and their points on disk.

use std::sync::{Arc, LazyLock};

use super::books::{self, Books};
use super::prepare::{contributions, views, with_full};
use super::{DEFAULT_SPACE, Database};
use crate::error::Error;
use crate::hlac::{self, View};
use crate::progress::Progress;
use crate::space::{Contribution, Definition, Prior, Recipe, Space, Statistics};
use crate::store::{Reads, StoreError, Transaction, ViewCode};

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

    /// A space as it is fitted now.
    ///
    /// # Errors
    /// [`Error::NoSuchSpace`], [`Error::Store`].
    pub fn space(&self, name: &str) -> Result<Arc<Space>, Error> {
        Ok(Arc::clone(&self.state(&self.store().read()?, name)?.space))
    }

    /// Fits every space on all there is, and maps every texture anew.
    ///
    /// # Errors
    /// [`Error::Cancelled`], after which nothing has changed; [`Error::Store`].
    pub fn reindex(&self, options: &Reindex, progress: &dyn Progress) -> Result<Reindexed, Error> {
        self.change(|transaction, books| {
            let described = if options.reextract { reextract(transaction, books, progress)? } else { 0 };
            progress.begin("fitting", None);
            let epoch = last_fit(transaction)?.0 + 1;
            fit(transaction, books.all(), epoch)?;
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let spaces = definitions(&views(transaction)).into_iter().map(|definition| definition.name).collect();
            Ok(Reindexed { textures: transaction.counts().textures, described, epoch, spaces })
        })
    }
}

/// Describes every texture whose voxels are kept anew, and builds the statistics from nothing: of textures without
/// voxels, from their moments (they have no octants).
fn reextract(transaction: &mut Transaction, books: &mut Books, progress: &dyn Progress) -> Result<u64, Error> {
    progress.begin("describing", Some(transaction.counts().textures));
    let views = views(transaction);
    let mut statistics: Vec<Statistics> = recipes(&views).iter().map(Statistics::new).collect();
    let mut described = 0;
    let ids: Vec<u64> = transaction.rows()?.live().map(|(_, id)| id).collect();
    for id in ids {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let parts = match transaction.voxels(id)? {
            Some(volume) => {
                let texture = hlac::describe(&volume, &with_full(&views));
                let total = |view: &View| texture.iter().find(|(v, _)| v == view).map(|(_, octants)| octants.total());
                let moments: Vec<_> = views
                    .iter()
                    .map(|view| (ViewCode(view.code()), total(view).map(|sums| sums.descriptor())))
                    .collect();
                transaction.set_descriptors(id, &moments)?;
                if let Some(sums) = total(&View::Full) {
                    transaction.set_sums(id, &sums)?;
                }
                described += 1;
                contributions(&texture, &views)?
            }
            None => kept_contributions(transaction, id, &views)?,
        };
        for part in &parts {
            if let Some(kept) = statistics.iter_mut().find(|kept| kept.recipe() == part.recipe()) {
                kept.add(part)?;
            }
        }
        progress.advance(1);
    }
    books.replace(statistics);
    Ok(described)
}

/// What a texture adds to the statistics by its kept moments alone, without octants.
pub(super) fn kept_contributions(state: &impl Reads, id: u64, views: &[View]) -> Result<Vec<Contribution>, Error> {
    let moments = super::textures::known_moments(state, id)?;
    let of = |view: View| moments.iter().find(|(other, _)| *other == view).map(|(_, row)| row);
    let parts = recipes(views).into_iter().map(|recipe| Contribution::of_moments(&recipe, of));
    Ok(parts.filter_map(Result::transpose).collect::<Result<_, _>>()?)
}

/// What a texture adds to the statistics: described anew from its voxels, or, where they are not kept, by its moments.
pub(super) fn contributions_of(state: &impl Reads, id: u64, views: &[View]) -> Result<Vec<Contribution>, Error> {
    match state.voxels(id) {
        Ok(Some(volume)) => contributions(&hlac::describe(&volume, &with_full(views)), views),
        Ok(None) => kept_contributions(state, id, views),
        // Damaged voxels do not stop a texture from being removed.
        Err(StoreError::Damage(_)) => kept_contributions(state, id, views),
        Err(error) => Err(error.into()),
    }
}
