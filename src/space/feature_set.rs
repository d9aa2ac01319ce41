//! [`FeatureSet`]: which numbers of a texture a space looks at.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::SpaceError;
use super::degree_roots::degree_roots;
use crate::hlac::orbits::{self, ORBIT_COUNT};
use crate::hlac::{MASK_COUNT, MASKS, View};

/// Pooled features of a view: a mean for each orbit, a standard deviation for each orbit of more than one mask.
const POOLED: usize = 2 * ORBIT_COUNT - 1;

/// How the moments of a view become features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum FeatureForm {
    /// The 251 moments as they are, in the order of the masks.
    Moments,
    /// The 251 degree roots: the k-th root of a moment of k cells, in the order of the masks.
    Roots,
    /// 35 numbers without orientation: the mean degree root of each of the 18 orbits, then the standard deviation of the
    /// degree roots (the population's) of each of the 17 orbits of more than one mask.
    Pooled,
}

impl FeatureForm {
    /// The number of features that each view gives.
    pub const fn per_view(self) -> usize {
        match self {
            Self::Moments | Self::Roots => MASK_COUNT,
            Self::Pooled => POOLED,
        }
    }

    /// The name in a feature set's key: `moments`, `roots` or `pooled`. It never changes: stores contain it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Moments => "moments",
            Self::Roots => "roots",
            Self::Pooled => "pooled",
        }
    }

    pub(super) const fn code(self) -> u8 {
        match self {
            Self::Moments => 0,
            Self::Roots => 1,
            Self::Pooled => 2,
        }
    }

    pub(super) const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Moments),
            1 => Some(Self::Roots),
            2 => Some(Self::Pooled),
            _ => None,
        }
    }
}

/// Which numbers of a texture are its features: one form of each of some views. Views are ordered by code and occur once.
///
/// It is written as `{"form": "pooled", "views": ["stretch@1", ...]}`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "Parts")]
pub struct FeatureSet {
    form: FeatureForm,
    views: Vec<View>,
}

/// A feature set as it is read, before its views are put in order.
#[derive(Deserialize)]
struct Parts {
    form: FeatureForm,
    views: Vec<View>,
}

impl TryFrom<Parts> for FeatureSet {
    type Error = SpaceError;

    fn try_from(parts: Parts) -> Result<Self, SpaceError> {
        Self::new(parts.form, &parts.views)
    }
}

impl FeatureSet {
    /// The features of this form of these views, given in any order.
    ///
    /// # Errors
    /// [`SpaceError::NoViews`].
    pub fn new(form: FeatureForm, views: &[View]) -> Result<Self, SpaceError> {
        let mut views = views.to_vec();
        views.sort_unstable();
        views.dedup();
        if views.is_empty() { Err(SpaceError::NoViews) } else { Ok(Self { form, views }) }
    }

    /// The 251 moments of `full@1`: the features of `paper` and `zscore`, and of a store's statistics.
    pub fn plain() -> Self {
        Self { form: FeatureForm::Moments, views: vec![View::Full] }
    }

    /// The 251 degree roots of `stretch@1`: the features of `oriented`.
    pub fn oriented() -> Self {
        Self { form: FeatureForm::Roots, views: vec![View::LIKENESS[0]] }
    }

    /// The 245 pooled features of the seven views [`View::LIKENESS`]: the features of `default` and `invariant`.
    pub fn pooled() -> Self {
        Self { form: FeatureForm::Pooled, views: View::LIKENESS.to_vec() }
    }

    /// The 280 pooled features of the eight views [`View::STANDARD`]: the features that the shipped prior covers.
    pub(super) fn stored() -> Self {
        Self { form: FeatureForm::Pooled, views: View::STANDARD.to_vec() }
    }

    /// Refuses another feature set than this one.
    pub(super) fn require(&self, found: &Self) -> Result<(), SpaceError> {
        if self == found {
            return Ok(());
        }
        Err(SpaceError::FeatureSet { expected: self.key(), found: found.key() })
    }

    /// The form.
    pub fn form(&self) -> FeatureForm {
        self.form
    }

    /// The views, by code.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// The name of the feature set in a store, e.g. `roots:stretch@1`. It never changes.
    pub fn key(&self) -> String {
        let views: Vec<&str> = self.views.iter().map(|view| view.name()).collect();
        format!("{}:{}", self.form.name(), views.join(","))
    }

    /// The number of features.
    pub fn dims(&self) -> usize {
        self.views.len() * self.form.per_view()
    }

    /// The feature at `index`; `None` from [`FeatureSet::dims`] on.
    pub fn feature(&self, index: usize) -> Option<Feature> {
        let view = *self.views.get(index / self.form.per_view())?;
        let at = index % self.form.per_view();
        let part = match self.form {
            FeatureForm::Moments | FeatureForm::Roots => FeaturePart::Mask(at as u8),
            FeatureForm::Pooled if at < ORBIT_COUNT => FeaturePart::Mean(at as u8),
            // The first orbit has a single mask and no deviation.
            FeatureForm::Pooled => FeaturePart::Deviation((at - ORBIT_COUNT + 1) as u8),
        };
        Some(Feature { view, part })
    }

    /// The features of a texture whose moments stand in someone else's memory: `moments` gives those of a view, or
    /// `None` where the texture does not have it.
    ///
    /// # Errors
    /// [`SpaceError::NotAMoment`].
    pub(crate) fn features_from<'a>(
        &self,
        moments: impl Fn(View) -> Option<&'a [f32; MASK_COUNT]>,
    ) -> Result<Features, SpaceError> {
        for &view in &self.views {
            moments(view).map_or(Ok(()), |moments| check_moments(view, moments))?;
        }
        Ok(self.collect(moments))
    }

    /// The features of moments that have been checked.
    pub(super) fn collect<'a>(&self, moments: impl Fn(View) -> Option<&'a [f32; MASK_COUNT]>) -> Features {
        let mut values = vec![0.0; self.dims()];
        let mut missing = Vec::new();
        for (&view, out) in self.views.iter().zip(values.chunks_exact_mut(self.form.per_view())) {
            match moments(view) {
                Some(moments) => self.fill(moments, out),
                None => missing.push(view),
            }
        }
        Features { values, missing }
    }

    /// Computes the features of one view.
    fn fill(&self, moments: &[f32; MASK_COUNT], out: &mut [f64]) {
        match self.form {
            FeatureForm::Moments => out.iter_mut().zip(moments).for_each(|(out, &moment)| *out = f64::from(moment)),
            FeatureForm::Roots => out.copy_from_slice(&degree_roots(moments)),
            FeatureForm::Pooled => {
                // Orbits are numbered by the order of their masks first, so masks sorted by orbit are sorted by order.
                let roots = degree_roots(&orbits::BY_ORBIT.map(|mask| moments[usize::from(mask)]));
                let (means, deviations) = out.split_at_mut(ORBIT_COUNT);
                for (orbit, range) in (0..ORBIT_COUNT).map(|orbit| (orbit, orbits::range(orbit))) {
                    let roots = &roots[range];
                    let count = roots.len() as f64;
                    let mean = sum(roots, |root| root) / count;
                    means[orbit] = mean;
                    if orbit > 0 {
                        let square = |root: f64| (root - mean) * (root - mean);
                        deviations[orbit - 1] = (sum(roots, square) / count).sqrt();
                    }
                }
            }
        }
    }
}

impl fmt::Display for FeatureSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.key())
    }
}

/// Refuses numbers that are no moments.
pub(super) fn check_moments(view: View, moments: &[f32; MASK_COUNT]) -> Result<(), SpaceError> {
    // One pass without branches; the culprit is looked for only where there is one.
    let is_moment = |value: f32| (0.0..=1.0).contains(&value);
    if moments.iter().fold(true, |all, &value| all & is_moment(value)) {
        return Ok(());
    }
    let at = moments.iter().position(|&value| !is_moment(value)).unwrap_or(0);
    Err(SpaceError::NotAMoment { view, mask: MASKS[at].letters(), value: moments[at] })
}

/// The sum of `f` over `values`, in four interleaved lanes: a fixed order in which no addition waits for the one before.
fn sum(values: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    let (fours, rest) = values.as_chunks::<4>();
    let mut lanes = [0.0; 4];
    for four in fours {
        for (lane, &value) in lanes.iter_mut().zip(four) {
            *lane += f(value);
        }
    }
    for (lane, &value) in lanes.iter_mut().zip(rest) {
        *lane += f(value);
    }
    (lanes[0] + lanes[1]) + (lanes[2] + lanes[3])
}

/// The features of one texture under one feature set.
#[derive(Clone, Debug, PartialEq)]
pub struct Features {
    values: Vec<f64>,
    missing: Vec<View>,
}

impl Features {
    /// One number in [0, 1] for each feature; 0 for those of missing views.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The views of the feature set that the texture does not have (it is too small for their scale), by code.
    pub fn missing(&self) -> &[View] {
        &self.missing
    }

    /// Whether no view is missing. Only such textures are counted in statistics.
    pub fn is_complete(&self) -> bool {
        self.missing.is_empty()
    }
}

/// One feature: a part of a view's moments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Feature {
    /// The view.
    pub view: View,
    /// The part of the view.
    pub part: FeaturePart,
}

/// The part of a view's moments that a feature is computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum FeaturePart {
    /// One mask: its index in [`MASKS`].
    Mask(u8),
    /// The mean over an orbit, given by its number.
    Mean(u8),
    /// The standard deviation over an orbit, given by its number: the strength of anisotropy.
    Deviation(u8),
}

impl FeaturePart {
    /// The index of the mask, or of the first mask of the orbit, in [`MASKS`].
    pub fn mask(self) -> u8 {
        match self {
            Self::Mask(mask) => mask,
            Self::Mean(orbit) | Self::Deviation(orbit) => {
                orbits::members(usize::from(orbit)).first().copied().unwrap_or(0)
            }
        }
    }

    /// The number of the orbit, or of the mask's orbit.
    pub fn orbit(self) -> u8 {
        match self {
            Self::Mask(mask) => orbits::ORBIT_OF.get(usize::from(mask)).copied().unwrap_or(0),
            Self::Mean(orbit) | Self::Deviation(orbit) => orbit,
        }
    }
}

impl fmt::Display for Feature {
    /// For example `stretch@1 akl`, or `sign@2 mean of akl...` for the orbit of mask akl.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let letters = MASKS.get(usize::from(self.part.mask())).map(|mask| mask.letters()).unwrap_or_default();
        match self.part {
            FeaturePart::Mask(_) => write!(f, "{} {letters}", self.view),
            FeaturePart::Mean(_) => write!(f, "{} mean of {letters}...", self.view),
            FeaturePart::Deviation(_) => write!(f, "{} deviation of {letters}...", self.view),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hlac::orbits::symmetries;
    use proptest::prelude::*;

    fn features(feature_set: &FeatureSet, moments: &[f32; MASK_COUNT]) -> Features {
        feature_set.features_from(|_| Some(moments)).unwrap()
    }

    fn moments() -> impl Strategy<Value = [f32; MASK_COUNT]> {
        proptest::collection::vec(0.0..=1.0_f32, MASK_COUNT).prop_map(|m| m.try_into().unwrap())
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(32))]

        #[test]
        fn pooled_features_are_mean_and_deviation_and_have_no_orientation(moments in moments(), turn in 0..48_usize) {
            let feature_set = FeatureSet::new(FeatureForm::Pooled, &[View::Full]).unwrap();
            let pooled = features(&feature_set, &moments);
            for orbit in 0..ORBIT_COUNT {
                let root = |&m: &u8| f64::from(moments[usize::from(m)]).powf(1.0 / MASKS[usize::from(m)].order() as f64);
                let roots: Vec<f64> = orbits::members(orbit).iter().map(root).collect();
                let mean = roots.iter().sum::<f64>() / roots.len() as f64;
                let deviation = (roots.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / roots.len() as f64).sqrt();
                prop_assert!((pooled.values()[orbit] - mean).abs() < 1e-12);
                if orbit > 0 {
                    prop_assert!((pooled.values()[17 + orbit] - deviation).abs() < 1e-12);
                }
            }
            let symmetry = symmetries()[turn];
            let turned: [f32; MASK_COUNT] = std::array::from_fn(|m| moments[usize::from(symmetry[m])]);
            let turned = features(&feature_set, &turned);
            prop_assert!(turned.values().iter().zip(pooled.values()).all(|(a, b)| (a - b).abs() < 1e-12));
        }
    }

    #[test]
    fn views_are_ordered_and_named() {
        let views = [View::Detail, View::Full, View::Detail];
        let feature_set = FeatureSet::new(FeatureForm::Roots, &views).unwrap();
        assert_eq!((feature_set.key().as_str(), feature_set.dims()), ("roots:full@1,detail@1", 502));
        let text = serde_json::to_string(&feature_set).unwrap();
        assert_eq!(serde_json::from_str::<FeatureSet>(&text).unwrap(), feature_set);
        assert!(serde_json::from_str::<FeatureSet>(r#"{"form":"roots","views":[]}"#).is_err());
        assert_eq!(FeatureSet::new(FeatureForm::Roots, &[]), Err(SpaceError::NoViews));
        assert_eq!(FeatureSet::pooled().dims(), 245);
    }

    #[test]
    fn features_say_what_they_are() {
        let feature_set = FeatureSet::pooled();
        assert_eq!(feature_set.feature(35 + 2).unwrap().to_string(), "stretch@2 mean of ak...");
        assert_eq!(feature_set.feature(18).unwrap().part, FeaturePart::Deviation(1));
        assert_eq!(feature_set.feature(244).unwrap().part, FeaturePart::Deviation(17));
        assert_eq!(feature_set.feature(245), None);
        assert_eq!(FeatureSet::plain().feature(250).unwrap().to_string(), "full@1 ins");
    }

    #[test]
    fn missing_views_are_listed_and_wrong_moments_refused() {
        let good = [0.5; MASK_COUNT];
        let features = FeatureSet::pooled().features_from(|view| (view != View::LIKENESS[2]).then_some(&good)).unwrap();
        assert_eq!(features.missing(), [View::LIKENESS[2]]);
        let mut bad = good;
        bad[3] = f32::NAN;
        assert!(matches!(FeatureSet::plain().features_from(|_| Some(&bad)), Err(SpaceError::NotAMoment { .. })));
    }
}
