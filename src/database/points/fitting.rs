//! Fitting: spaces are fitted on statistics and stored.

use super::spaces::{last_fit, prior};
use super::statistics_cache::StatisticsCache;
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::Error;
use crate::space::{Contribution, Definition, FeatureSet, NuisanceStatistics, Space, Statistics};
use crate::store::{Reads, Transaction};

/// Fits every space on its statistics and stores it. The stored points of the default space are dropped.
pub(crate) fn fit(transaction: &mut Transaction, statistics: &[Statistics], epoch: u64) -> Result<(), Error> {
    for definition in Scheme::of(transaction).definitions() {
        if let Some(statistics) = statistics.iter().find(|one| *one.feature_set() == definition.feature_set) {
            fit_one(transaction, definition, statistics, epoch)?;
        }
    }
    transaction.drop_points(DEFAULT_SPACE)?;
    Ok(())
}

/// Fits one space on the statistics of its feature set and stores it.
pub(crate) fn fit_one(
    transaction: &mut Transaction,
    definition: &Definition,
    statistics: &Statistics,
    epoch: u64,
) -> Result<(), Error> {
    let nuisance = stored_nuisance(transaction, &definition.feature_set)?;
    let space = Space::fit(definition, statistics, nuisance.as_ref(), prior())?.with_epoch(epoch);
    Ok(transaction.put_space(&definition.name, &space.encode())?)
}

/// The setting that holds the nuisances that were declared.
pub(crate) const NUISANCE_SETTING: &str = "nuisance";

/// The key under which the nuisance scatter of a feature set is stored.
pub(crate) fn nuisance_key(feature_set: &FeatureSet) -> String {
    format!("nuisance:{}", feature_set.key())
}

/// The store's own nuisance scatter of a feature set; `None` if it was never estimated, so that the prior's is used.
fn stored_nuisance(state: &impl Reads, feature_set: &FeatureSet) -> Result<Option<NuisanceStatistics>, Error> {
    let bytes = state.statistics(&nuisance_key(feature_set))?;
    Ok(bytes.map(|bytes| NuisanceStatistics::decode(&bytes)).transpose()?)
}

/// The nuisances that were last declared, as text.
pub(crate) fn declared_nuisance(state: &impl Reads) -> Option<String> {
    state.settings().further.get(NUISANCE_SETTING).cloned()
}

/// The fits that become due while textures are added. Spaces are fitted each time the number of textures has doubled, on the
/// statistics of that moment, so that one batch gives the same spaces as many.
pub(crate) struct DueFit {
    epoch: u64,
    textures: u64,
    statistics: Option<Vec<Statistics>>,
}

impl DueFit {
    /// No fit is due since the last one.
    pub(crate) fn new(transaction: &Transaction) -> Result<Self, Error> {
        let (epoch, textures) = last_fit(transaction)?;
        Ok(Self { epoch, textures, statistics: None })
    }

    /// Keeps the statistics if the number of textures has just doubled.
    pub(crate) fn after(&mut self, statistics: &StatisticsCache) {
        if self.has_doubled(statistics.textures()) {
            self.statistics = Some(statistics.all().to_vec());
        }
    }

    /// Adds many textures to the statistics, and keeps the statistics at the last doubling among them. Fits at earlier ones
    /// would be replaced.
    pub(crate) fn add_all(
        &mut self,
        statistics: &mut StatisticsCache,
        textures: &[Vec<Contribution>],
    ) -> Result<(), Error> {
        let (mut count, mut last) = (statistics.textures(), None);
        for (position, texture) in textures.iter().enumerate() {
            count += u64::from(statistics.counts_for_default(texture));
            if self.has_doubled(count) {
                last = Some(position + 1);
            }
        }
        let (before, after) = textures.split_at(last.unwrap_or(0));
        statistics.add_all(before)?;
        if last.is_some() {
            self.statistics = Some(statistics.all().to_vec());
        }
        statistics.add_all(after)
    }

    fn has_doubled(&mut self, textures: u64) -> bool {
        let has_doubled = textures > 0 && textures >= 2 * self.textures;
        if has_doubled {
            self.textures = textures;
            self.epoch += 1;
        }
        has_doubled
    }

    /// Fits the spaces if a fit is due.
    pub(crate) fn finish(self, transaction: &mut Transaction) -> Result<(), Error> {
        match self.statistics {
            Some(statistics) => fit(transaction, &statistics, self.epoch),
            None => Ok(()),
        }
    }
}
