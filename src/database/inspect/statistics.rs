//! What a person wants to know of a store.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::database::fit::nuisance;
use crate::database::handle::Database;
use crate::database::points::{spaces, statistics_cache};
use crate::database::quarantine::{self, Quarantined};
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::Error;
use crate::hlac::MASK_COUNT;
use crate::space::linalg::orthogonal_iteration;
use crate::space::{FeatureSet, Space};
use crate::store::{Reads, StoreError, ViewCode, Volumes};

/// Everything that `hlacdb stats` shows.
#[derive(Clone, Debug, Serialize)]
pub struct StatisticsReport {
    /// Textures in the store.
    pub textures: u64,
    /// Descriptors of all textures in all views.
    pub descriptors: u64,
    /// Bytes by table, and `file`, the length of the file.
    pub bytes: BTreeMap<String, u64>,
    /// The space asked for: the default one unless said.
    pub space: SpaceReport,
    /// The 251 moments of `full@1` over all textures.
    pub statistics: MomentStatistics,
    /// What the store was made for.
    pub settings: SettingsReport,
    /// Textures of which something is known to be lost.
    pub quarantined: Vec<Quarantined>,
    /// The number of the last commit.
    pub revision: u64,
}

/// A fitted space.
#[derive(Clone, Debug, Serialize)]
pub struct SpaceReport {
    /// Its name.
    pub name: String,
    /// The number of the fit; 0 before the first.
    pub epoch: u64,
    /// Textures it was fitted on.
    pub fitted_on: u64,
    /// Coordinates of a point.
    pub dims: usize,
    /// How points and distances are computed.
    pub formula: String,
    /// The share of each axis of the variance of all, falling; empty where the space has no axes of its own.
    pub variances: Vec<f64>,
    /// The leading axes, by falling variance.
    pub axes: Vec<AxisReport>,
    /// How far the store has moved since the fit; `None` where there is nothing to compare.
    pub drift: Option<DriftReport>,
}

/// One axis of a space.
#[derive(Clone, Debug, Serialize)]
pub struct AxisReport {
    /// Its share of the variance of all axes.
    pub variance: f64,
    /// How much of it comes from each view.
    pub views: BTreeMap<String, f64>,
    /// The features that go most with it, with their correlation.
    pub features: Vec<(String, f64)>,
}

/// How far a store has moved since a fit.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DriftReport {
    /// How far the mean texture has moved, in units of the spread then.
    pub shift: f64,
    /// The spread now by that of then.
    pub spread: f64,
}

impl DriftReport {
    /// Whether the store is so far from what the space was fitted on that a fit on all of it is worth its while: the mean moved
    /// by 0.7 of the spread, or the spread changed by a factor of two.
    pub fn is_far(&self) -> bool {
        self.shift.abs().max(self.spread.ln().abs()) >= FAR
    }
}

/// The drift from which on a space should be fitted anew; the page says so from the same number on.
const FAR: f64 = 0.7;

/// Statistics of the 251 moments of `full@1`, in the order of the masks.
#[derive(Clone, Debug, Serialize)]
pub struct MomentStatistics {
    /// Textures counted.
    pub count: u64,
    /// Mean of each moment.
    pub mean: Vec<f64>,
    /// Standard deviation (divided by the count).
    pub std: Vec<f64>,
    /// Lowest value; empty where there is no texture.
    pub min: Vec<f64>,
    /// Highest value; empty where there is no texture.
    pub max: Vec<f64>,
    /// The share of the variance of the z-scored moments that their strongest axis holds: near 1, they all measure
    /// brightness.
    pub leading_share: f64,
}

/// What a store was made for.
#[derive(Clone, Debug, Serialize)]
pub struct SettingsReport {
    /// The views it keeps.
    pub views: Vec<&'static str>,
    /// Whether voxels are kept: `keep` or `none`.
    pub volumes: &'static str,
    /// The spaces it answers in.
    pub spaces: Vec<String>,
    /// The nuisances that were declared with `reindex --nuisance`; `None` where the shipped prior's count.
    pub nuisance: Option<String>,
    /// The version of the file's format.
    pub format: u32,
    /// The kernel that makes exact sums on this machine.
    pub kernel: &'static str,
}

/// So many axes are shown.
const AXES: usize = 8;

impl Database {
    /// Sizes, settings, the default space and the normalisation statistics. Statistics or a space that cannot be read are
    /// told in the log and count as those of no texture.
    ///
    /// # Errors
    /// [`Error::Store`], [`Error::Space`].
    pub fn statistics(&self) -> Result<StatisticsReport, Error> {
        self.statistics_in(DEFAULT_SPACE)
    }

    /// The same with another space than the default one.
    ///
    /// # Errors
    /// [`Error::NoSuchSpace`], [`Error::Store`], [`Error::Space`].
    pub fn statistics_in(&self, space: &str) -> Result<StatisticsReport, Error> {
        let snapshot = self.store().read()?;
        let mut bytes: BTreeMap<String, u64> =
            snapshot.sizes()?.into_iter().map(|(table, size)| (table, size.total())).collect();
        if let Ok(file) = std::fs::metadata(self.path()) {
            bytes.insert("file".into(), file.len());
        }
        let mut descriptors = 0;
        let mut quarantined = quarantine::listed(&snapshot)?;
        for &view in Scheme::of(&snapshot).views().iter() {
            for block in 0..snapshot.descriptor_blocks() {
                match snapshot.descriptors(ViewCode(view.code()), block) {
                    Ok(kept) => descriptors += kept.map_or(0, |block| block.present() as u64),
                    Err(StoreError::Damage(damage)) => {
                        quarantine::of_block(&snapshot, block, &damage, &mut quarantined)?
                    }
                    Err(error) => return Err(error.into()),
                }
            }
        }
        let space = spaces::load_or_prior(&snapshot, space)?;
        let drift = space.drift(&statistics_cache::load_whole(&snapshot, space.feature_set())?)?;
        Ok(StatisticsReport {
            textures: snapshot.counts().textures,
            descriptors,
            bytes,
            space: SpaceReport {
                drift: drift.map(|drift| DriftReport { shift: drift.shift, spread: drift.spread }),
                ..SpaceReport::of(&space)
            },
            statistics: moment_statistics(&snapshot)?,
            settings: SettingsReport {
                views: Scheme::of(&snapshot).views().iter().map(|view| view.name()).collect(),
                volumes: match snapshot.settings().volumes {
                    Volumes::Keep => "keep",
                    Volumes::None => "none",
                },
                spaces: self.space_names()?,
                nuisance: nuisance::declared(&snapshot),
                format: crate::store::FORMAT_VERSION,
                kernel: crate::hlac::kernels::active().name(),
            },
            quarantined,
            revision: snapshot.revision(),
        })
    }

    /// The covariance matrix of the 251 moments of `full@1` over all textures, row-major, 251 x 251 (divided by the
    /// count).
    ///
    /// # Errors
    /// [`Error::Store`], [`Error::Space`].
    pub fn covariance(&self) -> Result<Vec<f64>, Error> {
        Ok(statistics_cache::load(&self.store().read()?, &FeatureSet::plain())?.covariance())
    }
}

fn moment_statistics(state: &impl Reads) -> Result<MomentStatistics, Error> {
    let statistics = statistics_cache::load_whole(state, &FeatureSet::plain())?;
    let (min, max) = statistics.extremes().unwrap_or_default();
    let std = statistics.deviation();
    Ok(MomentStatistics {
        count: statistics.count(),
        leading_share: leading_share(&statistics.covariance(), &std),
        mean: statistics.mean(),
        std,
        min,
        max,
    })
}

/// The largest eigenvalue of the correlation matrix, divided by its trace.
fn leading_share(covariance: &[f64], std: &[f64]) -> f64 {
    const ROUNDS: usize = 64;
    let scale: Vec<f64> = std.iter().map(|&sd| if sd > 0.0 { 1.0 / sd } else { 0.0 }).collect();
    let varying = scale.iter().filter(|&&scale| scale > 0.0).count();
    let correlations = |vector: &[f64]| {
        let rows = covariance.chunks_exact(MASK_COUNT).zip(&scale);
        rows.map(|(row, sd)| sd * row.iter().zip(&scale).zip(vector).map(|((c, s), v)| c * s * v).sum::<f64>())
            .collect()
    };
    let found = orthogonal_iteration(vec![vec![1.0; std.len()]], ROUNDS, correlations, &[]);
    found.first().map_or(0.0, |leading| leading.eigenvalue) / varying.max(1) as f64
}

impl SpaceReport {
    fn of(space: &Space) -> Self {
        let axes = space.axes();
        Self {
            name: space.name().to_owned(),
            epoch: space.epoch(),
            fitted_on: space.textures_at_fit(),
            dims: space.dims(),
            formula: space.definition().formula(),
            variances: axes.iter().map(|axis| axis.variance).collect(),
            axes: axes
                .into_iter()
                .take(AXES)
                .map(|axis| AxisReport {
                    variance: axis.variance,
                    views: axis.views.into_iter().map(|(view, share)| (view.name().to_owned(), share)).collect(),
                    features: axis.features.into_iter().map(|(feature, r)| (feature.to_string(), r)).collect(),
                })
                .collect(),
            drift: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bits_of_the_leading_share_are_frozen() {
        let covariance =
            |i: usize, j: usize| if i == j { 2.0 + i as f64 / 100.0 } else { 1.0 / (1 + i.abs_diff(j)) as f64 };
        let matrix: Vec<f64> =
            (0..MASK_COUNT * MASK_COUNT).map(|at| covariance(at / MASK_COUNT, at % MASK_COUNT)).collect();
        let mut std: Vec<f64> = (0..MASK_COUNT).map(|at| covariance(at, at).sqrt()).collect();
        std[7] = 0.0;
        assert_eq!(leading_share(&matrix, &std).to_bits(), 4_580_165_355_024_826_495);
        assert_eq!(leading_share(&matrix, &[0.0; MASK_COUNT]), 0.0);
    }
}
