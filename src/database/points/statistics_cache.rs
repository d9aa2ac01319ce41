//! [`StatisticsCache`]: the statistics of a store, in memory while it is written to.

use rayon::prelude::*;

use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::{Error, chain};
use crate::space::{Contribution, FeatureSet, SpaceError, Statistics};
use crate::store::{Reads, Transaction};

/// The number of textures that a thread adds at a time.
const CHUNK: usize = 1024;

/// The statistics of each feature set at one revision of the store.
#[derive(Default)]
pub(crate) struct StatisticsCache {
    /// `None` until the statistics are loaded, and after a failure.
    revision: Option<u64>,
    statistics: Vec<Statistics>,
    /// The feature set of the default space.
    default: Option<FeatureSet>,
    changed: bool,
}

impl StatisticsCache {
    /// Loads the statistics for a transaction that has just begun, unless they are of its revision.
    pub(crate) fn load_for(&mut self, transaction: &Transaction) -> Result<(), Error> {
        if self.revision == Some(transaction.revision()) {
            return Ok(());
        }
        let scheme = Scheme::of(transaction);
        self.default = scheme.definition(DEFAULT_SPACE).map(|definition| definition.feature_set.clone());
        self.statistics = scheme.feature_sets().iter().map(|set| load(transaction, set)).collect::<Result<_, _>>()?;
        self.changed = false;
        Ok(())
    }

    /// Writes the statistics if they have changed.
    pub(crate) fn save(&mut self, transaction: &mut Transaction) -> Result<(), Error> {
        if self.changed {
            for statistics in &self.statistics {
                transaction.put_statistics(&statistics.feature_set().key(), &statistics.encode())?;
            }
        }
        self.changed = false;
        Ok(())
    }

    /// Notes that the statistics were committed with this revision.
    pub(crate) fn saved_as(&mut self, revision: u64) {
        self.revision = Some(revision);
    }

    /// Notes a commit that changed no statistics.
    pub(crate) fn advance(&mut self, before: u64, revision: u64) {
        if self.revision == Some(before) {
            self.revision = Some(revision);
        }
    }

    /// Adds a texture.
    pub(crate) fn add(&mut self, contributions: &[Contribution]) -> Result<(), Error> {
        self.each(contributions, Statistics::add)
    }

    /// Adds many textures in parallel. Statistics of parts are merged, which gives the same bits as adding one by one.
    pub(crate) fn add_all(&mut self, textures: &[Vec<Contribution>]) -> Result<(), Error> {
        for statistics in &mut self.statistics {
            let feature_set = statistics.feature_set().clone();
            let of_chunk = |textures: &[Vec<Contribution>]| {
                let mut part = Statistics::new(&feature_set);
                part.add_all(textures.iter().flatten().filter(|texture| *texture.feature_set() == feature_set))?;
                Ok(part)
            };
            let all = textures.par_chunks(CHUNK).map(of_chunk).try_reduce(
                || Statistics::new(&feature_set),
                |mut one, other| {
                    one.merge(&other)?;
                    Ok::<_, SpaceError>(one)
                },
            )?;
            if all.count() > 0 {
                statistics.merge(&all)?;
                self.changed = true;
            }
        }
        Ok(())
    }

    /// Whether the default space can use a texture with these contributions.
    pub(crate) fn counts_for_default(&self, texture: &[Contribution]) -> bool {
        texture.iter().any(|contribution| Some(contribution.feature_set()) == self.default.as_ref())
    }

    /// Subtracts a texture, exactly.
    pub(crate) fn remove(&mut self, contributions: &[Contribution]) -> Result<(), Error> {
        self.each(contributions, Statistics::remove)
    }

    fn each(
        &mut self,
        contributions: &[Contribution],
        act: impl Fn(&mut Statistics, &Contribution) -> Result<(), SpaceError>,
    ) -> Result<(), Error> {
        for contribution in contributions {
            let feature_set = contribution.feature_set();
            if let Some(statistics) = self.statistics.iter_mut().find(|other| other.feature_set() == feature_set) {
                act(statistics, contribution)?;
                self.changed = true;
            }
        }
        Ok(())
    }

    /// The number of textures that the default space can be fitted on.
    pub(crate) fn textures(&self) -> u64 {
        let of_default = |statistics: &&Statistics| Some(statistics.feature_set()) == self.default.as_ref();
        self.statistics.iter().find(of_default).map_or(0, Statistics::count)
    }

    /// All statistics.
    pub(crate) fn all(&self) -> &[Statistics] {
        &self.statistics
    }

    /// The statistics of a feature set.
    pub(crate) fn get(&self, feature_set: &FeatureSet) -> Option<&Statistics> {
        self.statistics.iter().find(|statistics| statistics.feature_set() == feature_set)
    }

    /// Replaces all statistics.
    pub(crate) fn replace(&mut self, statistics: Vec<Statistics>) {
        self.statistics = statistics;
        self.changed = true;
    }

    /// Drops the statistics of all feature sets but these. Returns the feature sets of those that were dropped.
    pub(crate) fn retain(&mut self, wanted: &[FeatureSet]) -> Vec<FeatureSet> {
        let sets = self.statistics.iter().map(|statistics| statistics.feature_set().clone());
        let dropped = sets.filter(|set| !wanted.contains(set)).collect();
        self.statistics.retain(|statistics| wanted.contains(statistics.feature_set()));
        dropped
    }

    /// The statistics whose lowest and highest values must be recomputed.
    pub(crate) fn stale_extremes(&mut self) -> impl Iterator<Item = &mut Statistics> {
        self.statistics.iter_mut().filter(|statistics| statistics.extremes_are_stale())
    }
}

/// The stored statistics of a feature set; empty ones if none are stored.
pub(crate) fn load(state: &impl Reads, feature_set: &FeatureSet) -> Result<Statistics, Error> {
    Ok(match state.statistics(&feature_set.key())? {
        Some(bytes) => Statistics::decode(&bytes)?,
        None => Statistics::new(feature_set),
    })
}

/// As [`load`], but damaged statistics are taken as empty, with a warning.
pub(crate) fn load_or_empty(state: &impl Reads, feature_set: &FeatureSet) -> Result<Statistics, Error> {
    match load(state, feature_set) {
        Err(error) if error.is_damage() => {
            tracing::warn!("{}: reindexing rebuilds the statistics", chain(&error));
            Ok(Statistics::new(feature_set))
        }
        loaded => loaded,
    }
}
