//! The statistics_cache: the statistics of the store, in memory while it is written to.

use rayon::prelude::*;

use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::Error;
use crate::space::{Contribution, FeatureSet, SpaceError, Statistics};
use crate::store::{Reads, Transaction};

/// So many textures are counted by one thread at a time.
const TOGETHER: usize = 1024;

/// Statistics per recipe, as of one revision of the store.
#[derive(Default)]
pub(crate) struct StatisticsCache {
    /// `None` until they are loaded, and after a failure.
    revision: Option<u64>,
    statistics: Vec<Statistics>,
    /// The recipe of the default space.
    default: Option<FeatureSet>,
    changed: bool,
}

impl StatisticsCache {
    /// Brings the statistics_cache to the state of a transaction that has just begun.
    pub(crate) fn open(&mut self, transaction: &Transaction) -> Result<(), Error> {
        if self.revision == Some(transaction.revision()) {
            return Ok(());
        }
        let views = Scheme::of(transaction);
        let default = views.definitions().iter().find(|definition| definition.name == DEFAULT_SPACE);
        self.default = default.map(|definition| definition.feature_set.clone());
        self.statistics = views.recipes().iter().map(|recipe| load(transaction, recipe)).collect::<Result<_, _>>()?;
        self.changed = false;
        Ok(())
    }

    /// Writes what changed.
    pub(crate) fn save(&mut self, transaction: &mut Transaction) -> Result<(), Error> {
        if self.changed {
            for statistics in &self.statistics {
                transaction.put_statistics(&statistics.feature_set().key(), &statistics.encode())?;
            }
        }
        self.changed = false;
        Ok(())
    }

    /// Notes that the statistics_cache are those of this revision now.
    pub(crate) fn close(&mut self, revision: u64) {
        self.revision = Some(revision);
    }

    /// Notes a commit that changed no statistics.
    pub(crate) fn follow(&mut self, before: u64, revision: u64) {
        if self.revision == Some(before) {
            self.revision = Some(revision);
        }
    }

    /// Counts a texture in.
    pub(crate) fn add(&mut self, contributions: &[Contribution]) -> Result<(), Error> {
        self.each(contributions, Statistics::add)
    }

    /// Counts many textures in, in parallel: statistics of parts are merged, which gives the same bits.
    pub(crate) fn add_all(&mut self, textures: &[Vec<Contribution>]) -> Result<(), Error> {
        for statistics in &mut self.statistics {
            let recipe = statistics.feature_set().clone();
            let part = |textures: &[Vec<Contribution>]| {
                let mut part = Statistics::new(&recipe);
                part.add_all(textures.iter().flatten().filter(|texture| *texture.feature_set() == recipe))?;
                Ok(part)
            };
            let whole = textures.par_chunks(TOGETHER).map(part).try_reduce(
                || Statistics::new(&recipe),
                |mut one, other| {
                    one.merge(&other)?;
                    Ok::<_, SpaceError>(one)
                },
            )?;
            if whole.count() > 0 {
                statistics.merge(&whole)?;
                self.changed = true;
            }
        }
        Ok(())
    }

    /// Whether these contributions of a texture count for the default space.
    pub(crate) fn counts(&self, texture: &[Contribution]) -> bool {
        texture.iter().any(|part| Some(part.feature_set()) == self.default.as_ref())
    }

    /// Takes a texture back, without a trace.
    pub(crate) fn remove(&mut self, contributions: &[Contribution]) -> Result<(), Error> {
        self.each(contributions, Statistics::remove)
    }

    fn each(
        &mut self,
        contributions: &[Contribution],
        act: impl Fn(&mut Statistics, &Contribution) -> Result<(), crate::space::SpaceError>,
    ) -> Result<(), Error> {
        for contribution in contributions {
            if let Some(statistics) =
                self.statistics.iter_mut().find(|kept| kept.feature_set() == contribution.feature_set())
            {
                act(statistics, contribution)?;
                self.changed = true;
            }
        }
        Ok(())
    }

    /// How many textures the default space can be fitted on.
    pub(crate) fn textures(&self) -> u64 {
        let of_default = |kept: &&Statistics| Some(kept.feature_set()) == self.default.as_ref();
        self.statistics.iter().find(of_default).map_or(0, Statistics::count)
    }

    /// All statistics.
    pub(crate) fn all(&self) -> &[Statistics] {
        &self.statistics
    }

    /// Replaces all statistics.
    pub(crate) fn replace(&mut self, statistics: Vec<Statistics>) {
        self.statistics = statistics;
        self.changed = true;
    }

    /// Lets go of the statistics of other recipes than these; returns whose they were.
    pub(crate) fn forget_others(&mut self, wanted: &[FeatureSet]) -> Vec<FeatureSet> {
        let gone =
            self.statistics.iter().map(|kept| kept.feature_set().clone()).filter(|recipe| !wanted.contains(recipe));
        let gone: Vec<FeatureSet> = gone.collect();
        self.statistics.retain(|kept| wanted.contains(kept.feature_set()));
        gone
    }

    /// The statistics whose lowest and highest values must be looked for anew.
    pub(crate) fn stale_extremes(&mut self) -> impl Iterator<Item = &mut Statistics> {
        self.statistics.iter_mut().filter(|statistics| statistics.extremes_are_stale())
    }
}

/// The statistics that a store keeps for a recipe; those of no texture where it keeps none yet.
pub(crate) fn load(state: &impl Reads, recipe: &FeatureSet) -> Result<Statistics, Error> {
    Ok(match state.statistics(&recipe.key())? {
        Some(bytes) => Statistics::decode(&bytes)?,
        None => Statistics::new(recipe),
    })
}

/// As [`load`]; statistics that are not whole count as those of no texture.
pub(crate) fn load_whole(state: &impl Reads, recipe: &FeatureSet) -> Result<Statistics, Error> {
    match load(state, recipe) {
        Err(error) if error.is_damage() => {
            tracing::warn!("{}: reindexing rebuilds the statistics", crate::error::chain(&error));
            Ok(Statistics::new(recipe))
        }
        read => read,
    }
}
