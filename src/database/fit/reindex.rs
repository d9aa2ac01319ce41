//! Reindexing: every space fitted on all there is.

use std::collections::BTreeSet;

use super::nuisance;
use super::rebuild::{Rewrite, rebuild};
use super::spaces::fit;
use crate::database::handle::Database;
use crate::database::points::spaces::next_epoch;
use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::progress::Progress;
use crate::space::FeatureSet;
use crate::store::Reads;
use crate::synth::Nuisance;

/// How [`Database::reindex`] goes about it.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReindexOptions {
    /// Describe every texture whose voxels are kept anew, and rebuild the statistics from nothing.
    pub reextract: bool,
    /// What should not matter.
    pub nuisance: NuisanceUpdate,
}

/// What [`Database::reindex`] does about the nuisance scatter `N` of the likeness spaces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum NuisanceUpdate {
    /// Leaves it as it is: the shipped prior's until nuisances were declared, the store's own from then on.
    #[default]
    Keep,
    /// Estimates it anew, on at most 512 of the store's textures and copies of them under these nuisances.
    Estimate(Nuisance),
    /// Forgets what was declared: the shipped prior's counts again.
    Reset,
}

/// What [`Database::reindex`] did.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct ReindexReport {
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
    /// Fits every space on all there is, and maps every texture anew. Statistics that are not whole are built from nothing,
    /// and spaces and points are written whether or not the old ones can be read.
    ///
    /// # Errors
    /// [`Error::Cancelled`], after which nothing has changed; [`MaintenanceError::NoVoxels`](crate::MaintenanceError::NoVoxels) where nuisances are declared and no
    /// voxels are kept; [`Error::Store`].
    pub fn reindex(&self, options: &ReindexOptions, progress: &dyn Progress) -> Result<ReindexReport, Error> {
        self.change_mending(|transaction, statistics_cache, whole| {
            let counted = |recipe: &FeatureSet| Ok::<_, Error>(transaction.statistics(&recipe.key())?.is_some());
            let whole = whole
                && Scheme::of(transaction).recipes().iter().map(counted).all(|there| there.is_ok_and(|there| there));
            let described = match (options.reextract, whole || transaction.counts().textures == 0) {
                (true, _) => rebuild(transaction, statistics_cache, &Rewrite::All, progress)?,
                (false, true) => 0,
                (false, false) => rebuild(transaction, statistics_cache, &Rewrite::These(&BTreeSet::new()), progress)?,
            };
            let nuisance_pairs = match &options.nuisance {
                NuisanceUpdate::Keep => 0,
                NuisanceUpdate::Estimate(nuisance) => nuisance::estimate(transaction, nuisance, progress)?,
                NuisanceUpdate::Reset => nuisance::forget(transaction).map(|()| 0)?,
            };
            progress.begin("fitting", None);
            let epoch = next_epoch(transaction)?;
            fit(transaction, statistics_cache.all(), epoch)?;
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let spaces = Scheme::of(transaction).names();
            Ok(ReindexReport { textures: transaction.counts().textures, described, nuisance_pairs, epoch, spaces })
        })
    }
}
