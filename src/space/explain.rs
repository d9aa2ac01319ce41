//! [`Explanation`]: the distance between two textures, split by view, number of cells and orbit.

use serde::Serialize;

use super::fitted::{Map, present};
use super::linalg::dot;
use super::{FeaturePart, FeatureSet, Features, Metric, Space, SpaceError};
use crate::hlac::{MASKS, View, orbits};

/// The distance between two textures, split by view, by number of cells and by orbit.
///
/// `total` is a sum with one term for each feature: the squared distance for L2, the distance for L1. Shares are
/// fractions of it and add up to 1; all are 0 where the total is 0.
///
/// - In a likeness space let `y = (x - mean) / length`, where `length` is that of the texture's own point before it is
///   scaled to unit length. The points differ by `D = sum over features of (y_a - y_b) * weights`, and the squared
///   distance is `sum over features of (y_a - y_b) (weights . D)`. A feature with a negative term reduces the distance.
/// - In `zscore` a term is the squared difference of a coordinate, in a histogram space the absolute difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Explanation {
    /// The distance of the points before they are rounded to `f32`.
    pub distance: f64,
    /// The squared distance for L2, the distance for L1.
    pub total: f64,
    /// The share of each view, by code.
    pub views: Vec<(View, f64)>,
    /// The shares of the masks of one, two and three cells.
    pub cells: [f64; 3],
    /// The share of each aspect of each orbit of each view, by falling absolute value.
    pub orbits: Vec<OrbitShare>,
}

/// The share of one orbit of one view in a distance.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct OrbitShare {
    /// The view.
    pub view: View,
    /// The orbit, 0 to 17.
    pub orbit: u8,
    /// The aspect of the orbit: `masks` (each of them), `mean` or `deviation` (over the orbit; the deviation measures
    /// anisotropy).
    pub aspect: &'static str,
    /// The letters of the orbit's masks, in the paper's order.
    pub masks: Vec<String>,
    /// The share of the total. A negative share reduces the distance.
    pub share: f64,
}

impl Space {
    /// Splits the distance between two textures.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`] for features of another feature set.
    pub fn explain(&self, a: &Features, b: &Features) -> Result<Explanation, SpaceError> {
        let terms = self.terms(a, b)?;
        let total: f64 = terms.iter().sum();
        let distance = match self.metric() {
            Metric::L1 => total,
            Metric::L2 => total.max(0.0).sqrt(),
        };
        let shares: Vec<f64> = terms.iter().map(|term| if total > 0.0 { term / total } else { 0.0 }).collect();
        let feature_set = self.feature_set();
        let per_view = feature_set.form().per_view();
        let views = feature_set.views().iter().zip(shares.chunks_exact(per_view));
        let mut cells = [0.0; 3];
        for (at, share) in shares.iter().enumerate() {
            if let Some(feature) = feature_set.feature(at) {
                cells[MASKS[usize::from(feature.part.mask())].order() - 1] += share;
            }
        }
        Ok(Explanation {
            distance,
            total,
            views: views.map(|(&view, shares)| (view, shares.iter().sum())).collect(),
            cells,
            orbits: by_orbit(feature_set, &shares),
        })
    }

    /// The term of each feature.
    fn terms(&self, a: &Features, b: &Features) -> Result<Vec<f64>, SpaceError> {
        if let Map::Likeness(projection) = &self.map {
            let (raw_a, raw_b) = (self.raw_point(a)?, self.raw_point(b)?);
            let inverse = |length: f64| if length > 0.0 { 1.0 / length } else { 0.0 };
            let (unit_a, unit_b) = (inverse(self.length(&raw_a)), inverse(self.length(&raw_b)));
            let apart: Vec<f64> = raw_a.iter().zip(&raw_b).map(|(a, b)| a * unit_a - b * unit_b).collect();
            let centred = |x: Option<f64>, mean: f64| x.map_or(0.0, |x| x - mean);
            let pairs = present(self.feature_set(), a).zip(present(self.feature_set(), b)).zip(&projection.mean);
            let terms = pairs.enumerate().map(|(feature, ((a, b), &mean))| {
                let difference = centred(a, mean) * unit_a - centred(b, mean) * unit_b;
                difference * dot(projection.weights.row(feature), &apart)
            });
            return Ok(terms.collect());
        }
        let (a, b) = (self.exact_point(a)?, self.exact_point(b)?);
        let term = |(a, b): (&f64, &f64)| match self.metric() {
            Metric::L1 => (a - b).abs(),
            Metric::L2 => (a - b) * (a - b),
        };
        Ok(a.iter().zip(&b).map(term).collect())
    }
}

/// The shares by view, orbit and aspect, by falling absolute value.
fn by_orbit(feature_set: &FeatureSet, shares: &[f64]) -> Vec<OrbitShare> {
    let mut orbits: Vec<OrbitShare> = Vec::new();
    for (at, &share) in shares.iter().enumerate() {
        let Some(feature) = feature_set.feature(at) else { continue };
        let aspect = match feature.part {
            FeaturePart::Mask(_) => "masks",
            FeaturePart::Mean(_) => "mean",
            FeaturePart::Deviation(_) => "deviation",
        };
        let (view, orbit) = (feature.view, feature.part.orbit());
        match orbits.iter_mut().find(|other| (other.view, other.orbit, other.aspect) == (view, orbit, aspect)) {
            Some(same) => same.share += share,
            None => {
                let members = orbits::members(usize::from(orbit));
                let masks = members.iter().map(|&mask| MASKS[usize::from(mask)].letters()).collect();
                orbits.push(OrbitShare { view, orbit, aspect, masks, share });
            }
        }
    }
    orbits.sort_by(|a, b| b.share.abs().total_cmp(&a.share.abs()));
    orbits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::fixtures::{described, features, statistics};
    use crate::space::{Definition, Prior};

    #[test]
    fn shares_add_up_to_the_distance_of_the_points() {
        let textures: Vec<_> = (0..30).map(described).collect();
        for name in Definition::BUILT_IN {
            let definition = Definition::built_in(name).unwrap();
            let own = statistics(&definition.feature_set, &textures);
            let space = Space::fit(&definition, &own, None, &Prior::none()).unwrap();
            let [a, b] = [3, 8].map(|at: usize| features(&definition.feature_set, &textures[at]));
            let explained = space.explain(&a, &b).unwrap();
            let pairs = space.point(&a).unwrap().into_iter().zip(space.point(&b).unwrap());
            let differences = pairs.map(|(a, b)| (f64::from(a) - f64::from(b)).abs());
            let distance = match space.metric() {
                Metric::L1 => differences.sum::<f64>(),
                Metric::L2 => differences.map(|d| d * d).sum::<f64>().sqrt(),
            };
            assert!((explained.distance / distance - 1.0).abs() < 1e-5, "{name}");
            let sums = [
                explained.views.iter().map(|(_, share)| share).sum::<f64>(),
                explained.cells.iter().sum(),
                explained.orbits.iter().map(|orbit| orbit.share).sum(),
            ];
            assert!(sums.iter().all(|sum| (sum - 1.0).abs() < 1e-8), "{name}: {sums:?}");
            assert!(explained.orbits.is_sorted_by(|a, b| a.share.abs() >= b.share.abs()));
            let same = space.explain(&a, &a).unwrap();
            assert!(same.distance == 0.0 && same.cells == [0.0; 3]);
        }
    }

    #[test]
    fn orbits_are_named_by_their_letters() {
        let textures: Vec<_> = (0..3).map(described).collect();
        let definition = Definition::built_in("zscore").unwrap();
        let own = statistics(&definition.feature_set, &textures);
        let space = Space::fit(&definition, &own, None, &Prior::none()).unwrap();
        let [a, b] = [0, 1].map(|at: usize| features(&definition.feature_set, &textures[at]));
        let explained = space.explain(&a, &b).unwrap();
        assert_eq!(explained.orbits.len(), orbits::ORBIT_COUNT);
        let pairs = explained.orbits.iter().find(|orbit| orbit.orbit == 1).unwrap();
        assert_eq!((pairs.aspect, pairs.masks.join(" ").as_str()), ("masks", "ab ad aj"));
    }
}
