//! Reindexing: every space is fitted on all textures.

use super::nuisance;
use super::rebuild::{Rewrite, rebuild};
use crate::database::handle::Database;
use crate::database::points::fitting::fit;
use crate::database::points::spaces::next_epoch;
use crate::database::points::statistics_cache::StatisticsCache;
use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::progress::Progress;
use crate::store::{Reads, Transaction};
use crate::synth::Nuisance;

/// What [`Database::reindex`] recomputes besides the spaces.
///
/// ```
/// use hlacdb::{NuisanceUpdate, ReindexOptions};
/// let options = ReindexOptions::new().reextract(true).nuisance(NuisanceUpdate::Reset);
/// # let _ = options;
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct ReindexOptions {
    reextract: bool,
    nuisance: NuisanceUpdate,
}

impl ReindexOptions {
    /// Only fits the spaces.
    pub fn new() -> Self {
        Self::default()
    }

    /// Describes all textures whose voxels are stored again, and rebuilds the statistics.
    #[must_use]
    pub fn reextract(mut self, reextract: bool) -> Self {
        self.reextract = reextract;
        self
    }

    /// What is done about the nuisance scatter.
    #[must_use]
    pub fn nuisance(mut self, nuisance: NuisanceUpdate) -> Self {
        self.nuisance = nuisance;
        self
    }
}

/// What [`Database::reindex`] does about the nuisance scatter of the likeness spaces: how much a texture may change, by noise
/// or rotation, without counting as another one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum NuisanceUpdate {
    /// Keeps it: the prior's, or the store's own if one was estimated.
    #[default]
    Keep,
    /// Estimates it on at most 512 textures of the store and copies of them under these nuisances.
    Estimate(Nuisance),
    /// Drops the store's own, so that the prior's is used.
    Reset,
}

/// What [`Database::reindex`] did.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct ReindexReport {
    /// The number of textures that the spaces were fitted on.
    pub textures: u64,
    /// The number of textures that were described again.
    pub described: u64,
    /// The number of pairs of a texture and a copy on which the nuisance scatter was estimated.
    pub nuisance_pairs: u64,
    /// The number of the fit.
    pub epoch: u64,
    /// The names of the spaces.
    pub spaces: Vec<String>,
}

impl Database {
    /// Fits every space on all textures, and recomputes all points. Damaged or missing statistics are rebuilt; spaces and
    /// points are written whether or not the old ones can be read.
    ///
    /// # Errors
    /// [`Error::Cancelled`], after which nothing has changed;
    /// [`MaintenanceError::NoVoxels`](crate::MaintenanceError::NoVoxels) if a nuisance scatter is to be estimated and no voxels
    /// are stored; [`Error::Store`].
    pub fn reindex(&self, options: &ReindexOptions, progress: &dyn Progress) -> Result<ReindexReport, Error> {
        self.change_despite_damage(|transaction, statistics, intact| {
            let complete = intact && has_all_statistics(transaction) || transaction.counts().textures == 0;
            let described = match (options.reextract, complete) {
                (true, _) => rebuild(transaction, statistics, Rewrite::All, progress)?,
                (false, true) => 0,
                (false, false) => rebuild(transaction, statistics, Rewrite::Nothing, progress)?,
            };
            let nuisance_pairs = match &options.nuisance {
                NuisanceUpdate::Keep => 0,
                NuisanceUpdate::Estimate(nuisance) => nuisance::estimate(transaction, nuisance, progress)?,
                NuisanceUpdate::Reset => nuisance::reset(transaction).map(|()| 0)?,
            };
            let epoch = fit_all(transaction, statistics, progress)?;
            let spaces = Scheme::of(transaction).names();
            Ok(ReindexReport { textures: transaction.counts().textures, described, nuisance_pairs, epoch, spaces })
        })
    }
}

/// Whether the statistics of every feature set are stored and can be read.
fn has_all_statistics(transaction: &Transaction) -> bool {
    let is_stored = |key: &str| transaction.statistics(key).is_ok_and(|bytes| bytes.is_some());
    Scheme::of(transaction).feature_sets().iter().all(|set| is_stored(&set.key()))
}

fn fit_all(transaction: &mut Transaction, statistics: &StatisticsCache, progress: &dyn Progress) -> Result<u64, Error> {
    progress.begin("fitting", None);
    let epoch = next_epoch(transaction)?;
    fit(transaction, statistics.all(), epoch)?;
    if progress.cancelled() { Err(Error::Cancelled) } else { Ok(epoch) }
}
