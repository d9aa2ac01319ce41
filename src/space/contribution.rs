//! [`Contribution`]: what one texture adds to statistics.

use super::{Descriptor, FeatureForm, FeatureSet, Features, SpaceError};
use crate::hlac::{MASK_COUNT, OctantSums, View};

/// The unit of quantised features.
pub(super) const UNIT: f64 = 1.0 / (1_u64 << 40) as f64;

/// A feature in units of 2^-40, rounded to the nearest.
fn quantise(feature: f64) -> i64 {
    (feature / UNIT + 0.5) as i64
}

/// What one texture adds to the statistics of a feature set: its features, and those of its octants, as integers in
/// units of 2^-40.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contribution {
    pub(super) feature_set: FeatureSet,
    pub(super) features: Vec<i64>,
    /// Each feature of the eight octants.
    pub(super) octants: Option<Vec<[i64; 8]>>,
}

impl Contribution {
    /// The contribution of features, without octants; `None` where the texture lacks a view.
    pub fn from_features(feature_set: &FeatureSet, features: &Features) -> Option<Self> {
        features.is_complete().then(|| Self {
            feature_set: feature_set.clone(),
            features: features.values().iter().map(|&feature| quantise(feature)).collect(),
            octants: None,
        })
    }

    /// The contribution of a descriptor, without octants; `None` where the texture lacks a view.
    pub fn from_descriptor(feature_set: &FeatureSet, descriptor: &Descriptor) -> Option<Self> {
        Self::from_features(feature_set, &descriptor.features(feature_set))
    }

    /// As [`Contribution::from_descriptor`], of moments in someone else's memory.
    ///
    /// # Errors
    /// [`SpaceError::NotAMoment`].
    pub(crate) fn from_moments<'a>(
        feature_set: &FeatureSet,
        moments: impl Fn(View) -> Option<&'a [f32; MASK_COUNT]>,
    ) -> Result<Option<Self>, SpaceError> {
        Ok(Self::from_features(feature_set, &feature_set.features_from(moments)?))
    }

    /// The contribution of a described texture; `None` where the texture lacks a view.
    ///
    /// Octants are included where the form of the feature set uses them ([`FeatureForm::Roots`] and
    /// [`FeatureForm::Pooled`]) and every octant has at least one window. Features are computed from moments rounded to
    /// `f32`, as stores contain them, so a contribution from a stored descriptor has the same features to the bit.
    ///
    /// # Errors
    /// [`SpaceError::NotAMoment`] for sums that no volume has.
    pub fn from_sums(feature_set: &FeatureSet, described: &[(View, OctantSums)]) -> Result<Option<Self>, SpaceError> {
        let sums_of = |view: View| described.iter().find(|(other, _)| *other == view).map(|(_, sums)| sums);
        let views = feature_set.views().iter();
        let Some(sums) = views.map(|&view| Some((view, sums_of(view)?))).collect::<Option<Vec<_>>>() else {
            return Ok(None);
        };
        let whole = Descriptor::from_moments(sums.iter().map(|(view, sums)| (*view, sums.total().descriptor())))?;
        let Some(mut contribution) = Self::from_descriptor(feature_set, &whole) else { return Ok(None) };
        let has_octants = sums.iter().all(|(_, sums)| sums.octants().iter().all(|octant| octant.windows > 0));
        if feature_set.form() != FeatureForm::Moments && has_octants {
            let mut octants = vec![[0; 8]; feature_set.dims()];
            for octant in 0..8 {
                let moments = sums.iter().map(|(view, sums)| (*view, sums.octants()[octant].descriptor()));
                let part = Descriptor::from_moments(moments)?.features(feature_set);
                for (out, &feature) in octants.iter_mut().zip(part.values()) {
                    out[octant] = quantise(feature);
                }
            }
            contribution.octants = Some(octants);
        }
        Ok(Some(contribution))
    }

    /// The feature set.
    pub fn feature_set(&self) -> &FeatureSet {
        &self.feature_set
    }
}
