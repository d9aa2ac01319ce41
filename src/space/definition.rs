//! [`Definition`]: the name, features and kind of a space, before it is fitted.

use serde::{Deserialize, Serialize};

use super::Metric;
use super::{FeatureForm, FeatureSet, SpaceError};
use crate::hlac::View;

/// The largest number of dimensions of a likeness space: the number of directions that its fit keeps.
pub const MAX_DIMS: usize = 128;

/// How a space maps features to points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum SpaceKind {
    /// The paper's histogram: the sums per window, `moment * 255^cells`; L1. Other features than moments are taken as
    /// they are.
    Histogram,
    /// The same histogram divided by twice its total; L1. The distance is then 1 minus the histogram intersection,
    /// `sum of min(a, b)`, of the two histograms scaled to a total of 1.
    Intersection,
    /// `(x - mean) / sd` by the store's own statistics, 0 for features that do not vary; L2.
    ZScore,
    /// The whitened directions that vary much between textures and little within one, scaled to unit length; L2. The
    /// formula is in the [module's documentation](crate::space).
    Likeness {
        /// The weight of the nuisance scatter, relative to that of the octants; finite, >= 0. 0 ignores nuisances.
        nuisance: f64,
        /// The number of dimensions, 1 to [`MAX_DIMS`].
        dims: usize,
    },
}

/// The definition of a space: its name, its features, and how they become points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Definition {
    /// 1 to 64 letters, digits, `-` or `_`.
    pub name: String,
    /// The features. The field is called `recipe` in JSON and in stores.
    #[serde(rename = "recipe")]
    pub feature_set: FeatureSet,
    /// How they become points.
    pub kind: SpaceKind,
}

impl Definition {
    /// The names of the built-in spaces.
    pub const BUILT_IN: [&'static str; 5] = ["paper", "zscore", "oriented", "default", "invariant"];

    /// A definition, checked.
    ///
    /// # Errors
    /// As [`Definition::check`].
    pub fn new(name: &str, features: FeatureSet, kind: SpaceKind) -> Result<Self, SpaceError> {
        let definition = Self { name: name.to_owned(), feature_set: features, kind };
        definition.check()?;
        Ok(definition)
    }

    /// The definition of a built-in space; `None` for other names than those in [`Definition::BUILT_IN`].
    ///
    /// The nuisance weight of `default` was chosen by mean average precision (mAP) and by copies found:
    ///
    /// - *clean*, *nuisances*: mAP on `datasets/families.toml`, without nuisances and with all of them;
    /// - *copies*: the fraction of 880 copies (turned, 5 to 15 % brighter, with noise of 2 to 5 %) whose nearest texture
    ///   belongs to their family;
    /// - *wide*: mAP on `datasets/wide.toml`, without nuisances;
    /// - *real*: mAP on blocks of 64^3 voxels of real volumes.
    ///
    /// | weight | clean | nuisances | copies | wide | real |
    /// |---|---|---|---|---|---|
    /// | 0.2 | .987 | .915 | .941 | .792 | .972 |
    /// | 0.3 | .986 | .922 | .955 | .787 | .971 |
    /// | 0.4 | .987 | .925 | .968 | .782 | .971 |
    /// | **0.5** | .987 | .927 | .975 | .777 | .971 |
    /// | 0.7 | .986 | .930 | .974 | .767 | .972 |
    /// | 1 (`invariant`) | .986 | .933 | .971 | .753 | .969 |
    ///
    /// ```
    /// use hlacdb::space::Definition;
    /// let default = Definition::built_in("default").ok_or("no such space")?;
    /// assert_eq!((default.feature_set.dims(), default.dims()), (245, 32));
    /// # Ok::<(), &str>(())
    /// ```
    pub fn built_in(name: &str) -> Option<Self> {
        const DIMS: usize = 32;
        let (feature_set, kind) = match name {
            "paper" => (FeatureSet::plain(), SpaceKind::Histogram),
            "zscore" => (FeatureSet::plain(), SpaceKind::ZScore),
            "oriented" => (FeatureSet::oriented(), SpaceKind::Likeness { nuisance: 0.0, dims: DIMS }),
            "default" => (FeatureSet::pooled(), SpaceKind::Likeness { nuisance: 0.5, dims: DIMS }),
            "invariant" => (FeatureSet::pooled(), SpaceKind::Likeness { nuisance: 1.0, dims: DIMS }),
            _ => return None,
        };
        Some(Self { name: name.to_owned(), feature_set, kind })
    }

    /// The definition of a likeness space, of the degree roots of some views or of the pooled ones.
    ///
    /// # Errors
    /// [`SpaceError::Name`], [`SpaceError::NoViews`], [`SpaceError::Weight`], [`SpaceError::Dims`].
    pub fn likeness(name: &str, views: &[View], pooled: bool, nuisance: f64, dims: usize) -> Result<Self, SpaceError> {
        let features = FeatureSet::new(if pooled { FeatureForm::Pooled } else { FeatureForm::Roots }, views)?;
        Self::new(name, features, SpaceKind::Likeness { nuisance, dims })
    }

    /// Checks that the definition can be fitted.
    ///
    /// # Errors
    /// [`SpaceError::Name`], [`SpaceError::Weight`], [`SpaceError::Dims`].
    pub fn check(&self) -> Result<(), SpaceError> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if self.name.is_empty() || self.name.len() > 64 || !self.name.chars().all(allowed) {
            return Err(SpaceError::Name { found: self.name.clone() });
        }
        if let SpaceKind::Likeness { nuisance, dims } = self.kind {
            if !nuisance.is_finite() || nuisance < 0.0 {
                return Err(SpaceError::Weight { found: nuisance });
            }
            if !(1..=MAX_DIMS).contains(&dims) {
                return Err(SpaceError::Dims { found: dims, limit: MAX_DIMS });
            }
        }
        Ok(())
    }

    /// The same definition without the views that are not among `views`, for a store that keeps only these. `None` where
    /// no view is left.
    pub fn restricted_to(&self, views: &[View]) -> Option<Self> {
        let kept: Vec<View> = self.feature_set.views().iter().copied().filter(|view| views.contains(view)).collect();
        let feature_set = FeatureSet::new(self.feature_set.form(), &kept).ok()?;
        Some(Self { name: self.name.clone(), feature_set, kind: self.kind })
    }

    /// The metric of the space.
    pub fn metric(&self) -> Metric {
        match self.kind {
            SpaceKind::Histogram | SpaceKind::Intersection => Metric::L1,
            SpaceKind::ZScore | SpaceKind::Likeness { .. } => Metric::L2,
        }
    }

    /// The number of coordinates of a point.
    pub fn dims(&self) -> usize {
        match self.kind {
            SpaceKind::Likeness { dims, .. } => dims,
            _ => self.feature_set.dims(),
        }
    }

    /// Whether the space depends on statistics. Histogram spaces do not.
    pub fn is_fitted(&self) -> bool {
        matches!(self.kind, SpaceKind::ZScore | SpaceKind::Likeness { .. })
    }

    /// The formula of points and distance, in one line.
    pub fn formula(&self) -> String {
        let features = match self.feature_set.form() {
            FeatureForm::Moments => "x = moments",
            FeatureForm::Roots => "x = degree roots of the moments",
            FeatureForm::Pooled => {
                "x = mean and deviation, over each of the 18 orbits, of the degree roots of the moments"
            }
        };
        let views: Vec<&str> = self.feature_set.views().iter().map(|view| view.name()).collect();
        let point = match self.kind {
            SpaceKind::Histogram => "point = x * 255^cells, the sums per window".to_owned(),
            SpaceKind::Intersection => {
                "h = x * 255^cells; point = h / (2 sum h), so that L1 is 1 - sum of min".to_owned()
            }
            SpaceKind::ZScore => "point = (x - mean) / sd".to_owned(),
            SpaceKind::Likeness { nuisance, dims } => format!(
                "z = (x - mean) / sd; V = eigenvectors of the scatter T of z / sqrt(eigenvalue); V' (O + {nuisance} N) V \
                 = Q L Q' with octant scatter O and nuisance scatter N; point = z V Q / sqrt(L + 0.02), the {dims} \
                 coordinates of least L, scaled to unit length"
            ),
        };
        format!("{features} of {}; {point}; distance {}", views.join(", "), self.metric())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_definitions_are_valid_and_survive_json() {
        for name in Definition::BUILT_IN {
            let definition = Definition::built_in(name).unwrap();
            definition.check().unwrap();
            let text = serde_json::to_string(&definition).unwrap();
            assert_eq!(serde_json::from_str::<Definition>(&text).unwrap(), definition, "{text}");
        }
        assert!(Definition::built_in("nothing").is_none());
    }

    #[test]
    fn invalid_definitions_are_refused() {
        let define = |name: &str, nuisance, dims| Definition::likeness(name, &View::LIKENESS, true, nuisance, dims);
        assert!(define("mine_2", 0.5, 16).is_ok());
        assert!(matches!(define("", 0.5, 16), Err(SpaceError::Name { .. })));
        assert!(matches!(define("a b", 0.5, 16), Err(SpaceError::Name { .. })));
        assert!(matches!(define("a", f64::NAN, 16), Err(SpaceError::Weight { .. })));
        assert!(matches!(define("a", -1.0, 16), Err(SpaceError::Weight { .. })));
        assert!(matches!(define("a", 0.5, 0), Err(SpaceError::Dims { .. })));
        assert!(matches!(define("a", 0.5, 129), Err(SpaceError::Dims { .. })));
        assert_eq!(Definition::likeness("a", &[], true, 0.5, 1), Err(SpaceError::NoViews));
    }

    #[test]
    fn a_definition_is_restricted_to_the_views_of_a_store() {
        let default = Definition::built_in("default").unwrap();
        let rest = default.restricted_to(&[View::Full, View::Detail]).unwrap();
        assert_eq!((rest.feature_set.key().as_str(), rest.dims()), ("pooled:detail@1", 32));
        assert!(default.restricted_to(&[View::Full]).is_none());
        assert_eq!(default.restricted_to(&View::STANDARD).unwrap(), default);
    }
}
