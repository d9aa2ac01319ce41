//! [`Descriptor`]: the moments of one texture, by view.

use super::feature_set::check_moments;
use super::{FeatureSet, Features, SpaceError};
use crate::hlac::{MASK_COUNT, OctantSums, View};

/// The moments of one texture in each of its views: everything that a space can look at.
///
/// Every moment is a finite number from 0 to 1, and no view occurs twice. A texture that is too small for the scale of
/// a view does not have that view.
///
/// ```
/// use hlacdb::hlac::View;
/// use hlacdb::space::{Descriptor, FeatureSet};
/// use hlacdb::volume::Volume;
/// let volume = Volume::new([4, 4, 4], 1, vec![51; 64])?;
/// let descriptor = Descriptor::from_sums(&hlacdb::describe(&volume, &[View::Full]))?;
/// assert_eq!(descriptor.get(View::Full).map(|moments| moments[0]), Some(0.2));
/// assert!(descriptor.covers(&FeatureSet::plain()) && !descriptor.covers(&FeatureSet::pooled()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Descriptor {
    views: Vec<(View, [f32; MASK_COUNT])>,
}

impl Descriptor {
    /// The descriptor of these views and their moments, in this order.
    ///
    /// # Errors
    /// [`SpaceError::NotAMoment`] for a number that is not finite or not in [0, 1]; [`SpaceError::DuplicateView`].
    pub fn from_moments(moments: impl IntoIterator<Item = (View, [f32; MASK_COUNT])>) -> Result<Self, SpaceError> {
        let mut views: Vec<(View, [f32; MASK_COUNT])> = Vec::new();
        for (view, moments) in moments {
            check_moments(view, &moments)?;
            if views.iter().any(|(other, _)| *other == view) {
                return Err(SpaceError::DuplicateView { view });
            }
            views.push((view, moments));
        }
        Ok(Self { views })
    }

    /// The descriptor of exact sums, as [`crate::describe`] gives them.
    ///
    /// # Errors
    /// As [`Descriptor::from_moments`]; the sums of a described volume give none.
    pub fn from_sums(sums: &[(View, OctantSums)]) -> Result<Self, SpaceError> {
        Self::from_moments(sums.iter().map(|(view, octants)| (*view, octants.total().descriptor())))
    }

    /// The moments of a view, in the order of [`crate::hlac::MASKS`]; `None` where the texture does not have it.
    pub fn get(&self, view: View) -> Option<&[f32; MASK_COUNT]> {
        self.views.iter().find(|(other, _)| *other == view).map(|(_, moments)| moments)
    }

    /// Whether every view of a feature set is there.
    pub fn covers(&self, features: &FeatureSet) -> bool {
        features.views().iter().all(|&view| self.get(view).is_some())
    }

    /// Whether at least one view of a feature set is there: a space can then place the texture.
    pub fn overlaps(&self, features: &FeatureSet) -> bool {
        features.views().iter().any(|&view| self.get(view).is_some())
    }

    /// The features of the texture. Those of views that it does not have are missing; see [`Features::missing`].
    pub fn features(&self, feature_set: &FeatureSet) -> Features {
        feature_set.collect(|view| self.get(view))
    }

    /// The views and their moments, in the order in which they were given.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (View, &[f32; MASK_COUNT])> {
        self.views.iter().map(|(view, moments)| (*view, moments))
    }

    /// The views, in the order in which they were given.
    pub fn views(&self) -> impl ExactSizeIterator<Item = View> {
        self.views.iter().map(|(view, _)| *view)
    }

    /// The number of views.
    pub fn len(&self) -> usize {
        self.views.len()
    }

    /// Whether there is no view.
    pub fn is_empty(&self) -> bool {
        self.views.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn views_are_found_in_any_order() {
        let (low, high) = ([0.25; MASK_COUNT], [0.75; MASK_COUNT]);
        let descriptor = Descriptor::from_moments([(View::Detail, high), (View::Full, low)]).unwrap();
        assert_eq!((descriptor.get(View::Full), descriptor.get(View::Detail)), (Some(&low), Some(&high)));
        assert_eq!(descriptor.get(View::LIKENESS[0]), None);
        assert_eq!(descriptor.views().collect::<Vec<_>>(), [View::Detail, View::Full]);
        assert_eq!(descriptor.iter().next(), Some((View::Detail, &high)));
        assert!(descriptor.covers(&FeatureSet::plain()) && !descriptor.covers(&FeatureSet::pooled()));
        assert!(descriptor.overlaps(&FeatureSet::pooled()) && !descriptor.overlaps(&FeatureSet::oriented()));
        assert!(Descriptor::default().is_empty() && descriptor.len() == 2);
        let features = descriptor.features(&FeatureSet::pooled());
        assert_eq!(features.missing().len(), 6);
        assert_eq!(FeatureSet::pooled().features_from(|view| descriptor.get(view)), Ok(features));
    }

    #[test]
    fn duplicate_views_and_wrong_numbers_are_refused() {
        let good = [0.5; MASK_COUNT];
        let twice = Descriptor::from_moments([(View::Full, good), (View::Detail, good), (View::Full, good)]);
        assert_eq!(twice, Err(SpaceError::DuplicateView { view: View::Full }));
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.1, 1.1] {
            let mut bad = good;
            bad[3] = value;
            let error = Descriptor::from_moments([(View::Detail, good), (View::Full, bad)]).unwrap_err();
            assert!(
                matches!(error, SpaceError::NotAMoment { view: View::Full, ref mask, .. } if mask == "am"),
                "{error}"
            );
        }
    }
}
