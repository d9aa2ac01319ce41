//! [`NuisanceStatistics`]: how much features change under what should not matter.

use super::codec::{Header, Reader, Writer, read_feature_set, write_feature_set};
use super::contribution::UNIT;
use super::linalg::Matrix;
use super::scatter::{Scatter, Sign};
use super::{Contribution, FeatureSet, SpaceError};
use crate::volume::Volume;

const NUISANCE: Header = Header { what: "nuisance statistics", magic: *b"hNui", version: 1 };

/// How much features change under nuisances (brightness, noise, turns): sums over pairs of a texture and an altered copy.
///
/// Additive and exact, like [`super::Statistics`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NuisanceStatistics {
    feature_set: FeatureSet,
    count: u64,
    scatter: Scatter,
}

impl NuisanceStatistics {
    /// The statistics of no pair.
    pub fn new(feature_set: &FeatureSet) -> Self {
        Self { feature_set: feature_set.clone(), count: 0, scatter: Scatter::new(feature_set.dims()) }
    }

    /// The feature set.
    pub fn feature_set(&self) -> &FeatureSet {
        &self.feature_set
    }

    /// The number of pairs.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Adds a texture and a copy of it. Octants are not used.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    pub fn add(&mut self, texture: &Contribution, copy: &Contribution) -> Result<(), SpaceError> {
        self.feature_set.require(&texture.feature_set)?;
        self.feature_set.require(&copy.feature_set)?;
        let difference: Vec<i64> = texture.features.iter().zip(&copy.features).map(|(a, b)| a - b).collect();
        self.scatter.outer(&difference, Sign::Add);
        self.count += 1;
        Ok(())
    }

    /// Describes a texture and a copy of it and adds the pair. False, and nothing is added, where one of them is too
    /// small for a view.
    ///
    /// # Errors
    /// None for any volume.
    pub fn observe(&mut self, texture: &Volume, copy: &Volume) -> Result<bool, SpaceError> {
        let contribution =
            |volume| Contribution::from_sums(&self.feature_set, &crate::describe(volume, self.feature_set.views()));
        let pair = contribution(texture)?.zip(contribution(copy)?);
        pair.as_ref().map_or(Ok(()), |(texture, copy)| self.add(texture, copy))?;
        Ok(pair.is_some())
    }

    /// Adds the pairs of `other`.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`].
    pub fn merge(&mut self, other: &Self) -> Result<(), SpaceError> {
        self.feature_set.require(&other.feature_set)?;
        self.count += other.count;
        self.scatter += &other.scatter;
        Ok(())
    }

    /// Half the mean outer product of the differences: the covariance of a copy about its texture.
    pub(super) fn covariance(&self) -> Matrix {
        let scale = UNIT * UNIT / (2.0 * self.count.max(1) as f64);
        self.scatter.to_matrix(|value, _, _| value as f64 * scale)
    }

    /// The bytes that [`NuisanceStatistics::decode`] reads: versioned, with a checksum, the same for the same
    /// statistics.
    ///
    /// Feature set (form u8, views as a list of u8 codes), count u64, scatter packed.
    pub fn encode(&self) -> Vec<u8> {
        let mut writer = Writer::new(NUISANCE);
        write_feature_set(&mut writer, &self.feature_set);
        writer.u64(self.count);
        writer.packed(self.scatter.values());
        writer.finish()
    }

    /// Reads what [`NuisanceStatistics::encode`] wrote.
    ///
    /// # Errors
    /// [`SpaceError::Damaged`], [`SpaceError::Version`].
    pub fn decode(bytes: &[u8]) -> Result<Self, SpaceError> {
        let mut reader = Reader::new(NUISANCE, bytes)?;
        let feature_set = read_feature_set(&mut reader)?;
        let count = reader.u64()?;
        let scatter = Scatter::read(&mut reader, feature_set.dims())?;
        reader.finish()?;
        Ok(Self { feature_set, count, scatter })
    }
}
