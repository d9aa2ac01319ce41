//! [`Observations`]: the statistics that a prior is made of.

use super::PRIOR;
use super::pair_orbits::PairOrbits;
use crate::hlac::MASK_COUNT;
use crate::hlac::orbits::{ORBIT_COUNT, members};
use crate::space::codec::Writer;
use crate::space::fit::inverse_deviation;
use crate::space::linalg::{Eigen, Matrix};
use crate::space::{Contribution, FeatureSet, NuisanceStatistics, SpaceError, Statistics};
use crate::volume::Volume;

/// The number of steps of the largest number of a list stays below this: 24 bits with the sign.
const STEPS: f64 = 8_388_608.0;

/// Writes a list as multiples of one step, a power of two.
fn write_steps(writer: &mut Writer, values: &[f64]) {
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let mut step = 1.0 / STEPS;
    while largest >= step * (STEPS - 1.0) {
        step *= 2.0;
    }
    while largest > 0.0 && largest < step * (STEPS - 1.0) / 2.0 && step > f64::MIN_POSITIVE {
        step /= 2.0;
    }
    writer.f64(step);
    writer.packed(&values.iter().map(|value| (value / step).round() as i128).collect::<Vec<_>>());
}

/// The statistics that a prior is made of. Additive and exact: parts can be collected in any order and merged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Observations {
    pub(super) pooled: Statistics,
    pub(super) nuisance: NuisanceStatistics,
    pub(super) oriented: Statistics,
}

impl Default for Observations {
    fn default() -> Self {
        Self {
            pooled: Statistics::new(&FeatureSet::stored()),
            nuisance: NuisanceStatistics::new(&FeatureSet::stored()),
            oriented: Statistics::new(&FeatureSet::oriented()),
        }
    }
}

impl Observations {
    /// Adds a texture and copies of it under nuisances, including turns. A texture or copy that is too small for one of
    /// the eight views is not counted.
    ///
    /// # Errors
    /// None for any volume.
    pub fn add(&mut self, texture: &Volume, copies: &[Volume]) -> Result<(), SpaceError> {
        let feature_set = FeatureSet::stored();
        let described = crate::describe(texture, feature_set.views());
        let oriented = Contribution::from_sums(&FeatureSet::oriented(), &described)?;
        let (Some(pooled), Some(oriented)) = (Contribution::from_sums(&feature_set, &described)?, oriented) else {
            return Ok(());
        };
        self.pooled.add(&pooled)?;
        self.oriented.add(&oriented)?;
        for copy in copies {
            if let Some(copy) = Contribution::from_sums(&feature_set, &crate::describe(copy, feature_set.views()))? {
                self.nuisance.add(&pooled, &copy)?;
            }
        }
        Ok(())
    }

    /// Adds the textures of `other`.
    ///
    /// # Errors
    /// None: all observations have the same feature sets.
    pub fn merge(&mut self, other: &Self) -> Result<(), SpaceError> {
        self.pooled.merge(&other.pooled)?;
        self.nuisance.merge(&other.nuisance)?;
        self.oriented.merge(&other.oriented)
    }

    /// The bytes that [`super::Prior::decode`] reads.
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::new(PRIOR);
        writer.u64(self.pooled.count());
        writer.u64(self.nuisance.count());
        writer.f64s(&self.pooled.mean());
        writer.f64s(&self.pooled.deviation());
        let between = self.pooled.between();
        let dims = between.rows();
        let scale: Vec<f64> = (0..dims).map(|at| inverse_deviation(between[(at, at)])).collect();
        let within = self.pooled.within().unwrap_or(Matrix::zero(dims, dims));
        for covariance in [between, within, self.nuisance.covariance()] {
            let scaled = Matrix::from_fn(dims, dims, |i, j| covariance[(i, j)] * scale[i] * scale[j]);
            let root = Eigen::of(scaled).square_root();
            let triangle: Vec<f64> = (0..dims).flat_map(|i| root.row(i)[i..].iter().copied()).collect();
            write_steps(&mut writer, &triangle);
        }
        let orbits = PairOrbits::new();
        let mean = self.oriented.mean();
        let of_orbit = |orbit: usize| {
            let members = members(orbit);
            members.iter().map(|&mask| mean[usize::from(mask)]).sum::<f64>() / members.len() as f64
        };
        writer.f64s(&(0..ORBIT_COUNT).map(of_orbit).collect::<Vec<_>>());
        let within = self.oriented.within().unwrap_or(Matrix::zero(MASK_COUNT, MASK_COUNT));
        for covariance in [self.oriented.between(), within] {
            writer.f64s(&orbits.average(&covariance));
        }
        writer.finish()
    }
}
