//! Why two textures are alike: their distance, taken apart.

use serde::Serialize;

use super::fitted::{Map, present};
use super::linalg::dot;
use super::{FeaturePart, FeatureSet, Features, Metric, Space, SpaceError};
use crate::hlac::{MASKS, View, orbits};

/// The distance between two textures, taken apart by view, by number of cells and by orbit.
///
/// What is shared out is `total`: the squared distance for L2, the distance itself for L1. It is a sum over features,
/// so that the shares add up to 1 (where the total is not 0; else all are 0):
///
/// - in a likeness space, with `y = (x - mean) / length` (each texture's own length before its point is scaled to unit
///   length), the points differ by `D = sum over features of (y_a - y_b) * weights`, and the squared distance is `sum
///   of (y_a - y_b) (weights . D)`. A feature whose term is below 0 brings the two together: without it they would be
///   further apart;
/// - in `zscore` a term is the squared difference of one coordinate, in a histogram space its absolute difference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Explanation {
    /// The distance, before coordinates are rounded to `f32`.
    pub distance: f64,
    /// What the shares are shares of.
    pub total: f64,
    /// One share for each view, by code.
    pub views: Vec<(View, f64)>,
    /// The shares of masks of one, two and three cells.
    pub cells: [f64; 3],
    /// One share for each orbit of each view and each aspect of it, the largest in absolute value first.
    pub orbits: Vec<OrbitShare>,
}

/// What one orbit of one view does to the distance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OrbitShare {
    /// The view.
    pub view: View,
    /// The orbit, 0 to 17.
    pub orbit: u8,
    /// What of the orbit: `masks` (one by one), `mean` or `deviation` (over the orbit: the strength of anisotropy).
    pub aspect: &'static str,
    /// The letters of the orbit's masks, in the paper's order.
    pub masks: Vec<String>,
    /// The share: above 0 it keeps the two apart, below 0 it brings them together.
    pub share: f64,
}

impl Space {
    /// Takes the distance between two textures apart.
    ///
    /// # Errors
    /// [`SpaceError::FeatureSet`] for features of another number than the feature set's.
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

    /// What each feature adds to the total.
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

/// The shares of each orbit, the largest first.
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
    fn shares_make_up_the_distance_between_the_points() {
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
