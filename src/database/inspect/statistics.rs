//! Sizes, settings, spaces and statistics of a store.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::database::handle::Database;
use crate::database::points::fitting::declared_nuisance;
use crate::database::points::{spaces, statistics_cache};
use crate::database::quarantine::{self, QuarantinedTexture};
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::Error;
use crate::hlac::MASK_COUNT;
use crate::space::linalg::orthogonal_iteration;
use crate::space::{FeatureSet, Space};
use crate::store::{Reads, StoreError, ViewCode, Volumes};

/// Sizes, settings, a space and statistics of a store.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct StatisticsReport {
    /// The number of textures.
    pub textures: u64,
    /// The number of descriptors: of all textures in all views.
    pub descriptors: u64,
    /// Bytes by table. `file` is the length of the file.
    pub bytes: BTreeMap<String, u64>,
    /// The space that was asked for.
    pub space: SpaceReport,
    /// Statistics of the 251 moments of `full@1` over all textures.
    pub statistics: MomentStatistics,
    /// The settings of the store.
    pub settings: SettingsReport,
    /// Textures of which something is known to be lost.
    pub quarantined: Vec<QuarantinedTexture>,
    /// The number of the last commit.
    pub revision: u64,
}

/// A fitted space.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SpaceReport {
    /// Its name.
    pub name: String,
    /// The number of the fit; 0 before the first fit.
    pub epoch: u64,
    /// The number of textures that it was fitted on.
    pub fitted_on: u64,
    /// The number of coordinates of a point.
    pub dims: usize,
    /// How points and distances are computed, as a formula.
    pub formula: String,
    /// The share of the variance of each axis, in descending order; empty if the space has no axes of its own.
    pub variances: Vec<f64>,
    /// The leading axes, by descending variance.
    pub axes: Vec<AxisReport>,
    /// How much the textures have changed since the fit; `None` if there is nothing to compare.
    pub drift: Option<DriftReport>,
}

/// An axis of a space.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct AxisReport {
    /// Its share of the variance.
    pub variance: f64,
    /// The share of each view in the axis.
    pub views: BTreeMap<String, f64>,
    /// The features that are most correlated with it, with their correlation.
    pub features: Vec<(String, f64)>,
}

/// How much the textures of a store have changed since a fit.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct DriftReport {
    /// How far the mean has moved, in units of the spread at the fit.
    pub shift: f64,
    /// The spread now, divided by the spread at the fit.
    pub spread: f64,
}

impl DriftReport {
    /// Whether the space should be fitted again: the mean has moved by 0.7 of the spread, or the spread has changed by a factor
    /// of two.
    pub fn is_far(&self) -> bool {
        self.shift.abs().max(self.spread.ln().abs()) >= FAR
    }
}

/// The drift from which a space should be fitted again. The page of the server uses the same number.
const FAR: f64 = 0.7;

/// Statistics of the 251 moments of `full@1`, in the order of the masks.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct MomentStatistics {
    /// The number of textures.
    pub count: u64,
    /// The mean of each moment.
    pub mean: Vec<f64>,
    /// The standard deviation of each moment (divided by the count).
    pub std: Vec<f64>,
    /// The lowest value of each moment; empty if there is no texture.
    pub min: Vec<f64>,
    /// The highest value of each moment; empty if there is no texture.
    pub max: Vec<f64>,
    /// The share of the variance of the z-scored moments along their first principal axis. Near 1, all moments measure
    /// brightness.
    pub leading_share: f64,
}

/// The settings of a store.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct SettingsReport {
    /// The names of the views that it keeps.
    pub views: Vec<&'static str>,
    /// Whether voxels are kept: `keep` or `none`.
    pub volumes: &'static str,
    /// The names of its spaces.
    pub spaces: Vec<String>,
    /// The nuisances on which the store's own nuisance scatter was estimated; `None` if the prior's is used.
    pub nuisance: Option<String>,
    /// The version of the file format.
    pub format: u32,
    /// The kernel that computes exact sums on this machine.
    pub kernel: &'static str,
}

/// The number of leading axes in a report.
const AXES: usize = 8;

impl Database {
    /// Sizes, settings, the default space and the statistics of moments. Damaged statistics, or a damaged space, are reported as
    /// those of an empty store, with a warning in the log.
    ///
    /// # Errors
    /// [`Error::Store`], [`Error::Space`].
    pub fn statistics(&self) -> Result<StatisticsReport, Error> {
        self.statistics_in(DEFAULT_SPACE)
    }

    /// As [`Database::statistics`], with another space.
    ///
    /// # Errors
    /// [`QueryError::NoSuchSpace`](crate::QueryError::NoSuchSpace), [`Error::Store`], [`Error::Space`].
    pub fn statistics_in(&self, space: &str) -> Result<StatisticsReport, Error> {
        let snapshot = self.store().read()?;
        let mut bytes: BTreeMap<String, u64> =
            snapshot.sizes()?.into_iter().map(|(table, size)| (table, size.total())).collect();
        if let Ok(file) = std::fs::metadata(self.path()) {
            bytes.insert("file".into(), file.len());
        }
        let mut descriptors = 0;
        let mut quarantined = quarantine::quarantined(&snapshot)?;
        let scheme = Scheme::of(&snapshot);
        for &view in scheme.views() {
            for block in 0..snapshot.descriptor_blocks() {
                match snapshot.descriptors(ViewCode(view.code()), block) {
                    Ok(block) => descriptors += block.map_or(0, |block| block.present() as u64),
                    Err(StoreError::Damage(damage)) => {
                        quarantine::add_block(&snapshot, block, &damage, &mut quarantined)?;
                    }
                    Err(error) => return Err(error.into()),
                }
            }
        }
        let space = spaces::load_or_prior(&snapshot, space)?;
        let drift = space.drift(&statistics_cache::load_or_empty(&snapshot, space.feature_set())?)?;
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
                views: scheme.views().iter().map(|view| view.name()).collect(),
                volumes: match snapshot.settings().volumes {
                    Volumes::Keep => "keep",
                    Volumes::None => "none",
                },
                spaces: scheme.names(),
                nuisance: declared_nuisance(&snapshot),
                format: crate::store::FORMAT_VERSION,
                kernel: crate::hlac::kernels::active().name(),
            },
            quarantined,
            revision: snapshot.revision(),
        })
    }

    /// The covariance matrix of the 251 moments of `full@1` over all textures (divided by the count): 251 x 251, row-major.
    ///
    /// # Errors
    /// [`Error::Store`], [`Error::Space`].
    pub fn covariance(&self) -> Result<Vec<f64>, Error> {
        Ok(statistics_cache::load(&self.store().read()?, &FeatureSet::plain())?.covariance())
    }
}

fn moment_statistics(state: &impl Reads) -> Result<MomentStatistics, Error> {
    let statistics = statistics_cache::load_or_empty(state, &FeatureSet::plain())?;
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
