//! [`Prior`]: statistics of textures in general, for stores with few textures of their own.
//!
//! The prior is fitted on a large set of synthetic textures and of copies of them under nuisances ([`Observations`]) and
//! is part of the program ([`Prior::shipped`]); `cargo run --release --example fit_prior` computes it again. It contains
//! what the fit of a likeness space needs (see [`crate::space`]): mean, `T`, `O` and `N` of the pooled features of the
//! eight views `View::STANDARD`, hence of any subset of these views, and mean, `T` and `O` of the degree roots of
//! `stretch@1`. Spaces of other feature sets are fitted on the store's own statistics alone.
//!
//! In a fit the prior counts as [`WEIGHT`] textures with their octants. The weight was chosen on
//! `datasets/families.toml` (880 textures of 44 families) by `examples/quality.rs`, with the family of each query left
//! out of the prior and of the store's statistics. Mean average precision of `default`, then of `invariant`:
//!
//! | fitted on | clean | all nuisances | nuisance query, clean store |
//! |---|---|---|---|
//! | prior alone | .985 .984 | .909 .920 | .883 .895 |
//! | prior as 10000, own | .985 .984 | .907 .920 | .883 .898 |
//! | prior as 3000, own | .985 .984 | .909 .921 | .888 .901 |
//! | prior as 1000, own | .985 .983 | .913 .921 | .890 .905 |
//! | **prior as 300, own** | .984 .981 | .918 .924 | .895 .904 |
//! | own alone (nuisances of the prior) | .979 .977 | .914 .918 | .879 .891 |
//!
//! With 300, the prior determines the space of a small store (30 textures count for a tenth), and a large store gets
//! nearly the full gain of its own statistics.
//!
//! # Bytes
//!
//! Covariances are stored as square roots, which keep their small directions in fewer bits. Let `z` be the pooled
//! features divided by their standard deviations: the bytes hold the upper triangles of the symmetric square roots of
//! `T`, `O` and `N` of `z` (row by row, each row from the diagonal on). The degree roots are averaged over the 48
//! symmetries of the cube, because a prior must not prefer a direction: one number is left for each orbit of masks, or of
//! pairs of masks (numbered by their first pair, row by row of the upper triangle).
//!
//! ```text
//! textures   u64
//! pairs      u64          pairs of a texture and a copy
//! mean       f64 list     280
//! sd         f64 list     280
//! T, O, N    each: the step (f64, a power of two) and 280 * 281 / 2 multiples of it, packed (24 bits each)
//! oriented: mean f64 list (18), T f64 list, O f64 list (one number for each orbit of pairs)
//! ```

#[cfg(any(test, feature = "unstable-internals"))]
mod observations;
mod pair_orbits;

use std::sync::{Arc, LazyLock, OnceLock};

use super::codec::{Header, Reader};
use super::fit::Model;
use super::linalg::Matrix;
use super::scatter::Scatter;
use super::{FeatureForm, FeatureSet, SpaceError};
use crate::hlac::MASK_COUNT;
use crate::hlac::orbits::{ORBIT_COUNT, ORBIT_OF};
#[cfg(any(test, feature = "unstable-internals"))]
pub use observations::Observations;
use pair_orbits::PairOrbits;

const PRIOR: Header = Header { what: "prior", magic: *b"hPri", version: 2 };

/// The number of textures that the shipped prior counts as.
const WEIGHT: f64 = 300.0;

/// Statistics of textures in general, and the number of textures that they count as.
#[derive(Clone, Debug)]
pub struct Prior {
    weight: f64,
    known: Option<Arc<Known>>,
}

/// The content of a prior, and the models that are computed from it on first use.
#[derive(Debug)]
struct Known {
    textures: u64,
    mean: Vec<f64>,
    deviations: Vec<f64>,
    /// The upper triangles of the square roots of T, O and N.
    roots: [Vec<f64>; 3],
    oriented_mean: Vec<f64>,
    oriented: [Vec<f64>; 2],
    pooled_model: OnceLock<Model>,
    oriented_model: OnceLock<Model>,
}

impl Prior {
    /// No prior: a fit uses the store's statistics only.
    pub fn none() -> Self {
        Self { weight: 0.0, known: None }
    }

    /// The prior that is part of the program. It counts as [`WEIGHT`] textures.
    pub fn shipped() -> Self {
        static SHIPPED: LazyLock<Prior> =
            LazyLock::new(|| Prior::decode(include_bytes!("prior.bin")).unwrap_or_else(|_| Prior::none()));
        SHIPPED.clone()
    }

    /// The same prior with another weight: the number of textures it counts as. A weight that is negative or not finite
    /// means 0.
    pub fn with_weight(self, weight: f64) -> Self {
        Self { weight: if weight.is_finite() { weight.max(0.0) } else { 0.0 }, ..self }
    }

    /// The number of textures that it counts as.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// The number of textures that it was fitted on; 0 for [`Prior::none`].
    pub fn textures(&self) -> u64 {
        self.known.as_ref().map_or(0, |known| known.textures)
    }

    /// Whether the prior covers the features of a feature set.
    pub fn covers(&self, feature_set: &FeatureSet) -> bool {
        self.known.is_some() && (*feature_set == FeatureSet::oriented() || selection(feature_set).is_some())
    }

    /// The model of the features of a feature set; `None` if the prior does not cover them.
    pub(super) fn model(&self, feature_set: &FeatureSet) -> Option<Model> {
        let known = self.known.as_ref()?;
        if *feature_set == FeatureSet::oriented() {
            return Some(known.oriented_model.get_or_init(|| known.oriented()).clone());
        }
        let selection = selection(feature_set)?;
        Some(known.pooled_model.get_or_init(|| known.pooled()).select(&selection))
    }

    /// Reads what [`Observations::encode`] wrote: a prior that counts as [`WEIGHT`] textures.
    ///
    /// # Errors
    /// [`SpaceError::Damaged`], [`SpaceError::Version`].
    pub fn decode(bytes: &[u8]) -> Result<Self, SpaceError> {
        let mut reader = Reader::new(PRIOR, bytes)?;
        let dims = FeatureSet::stored().dims();
        let triangle = Scatter::length(dims);
        let pairs = PairOrbits::new().count;
        let textures = reader.u64()?;
        reader.u64()?;
        let known = Known {
            textures,
            mean: reader.f64s(dims)?,
            deviations: reader.f64s(dims)?,
            roots: [steps(&mut reader, triangle)?, steps(&mut reader, triangle)?, steps(&mut reader, triangle)?],
            oriented_mean: reader.f64s(ORBIT_COUNT)?,
            oriented: [reader.f64s(pairs)?, reader.f64s(pairs)?],
            pooled_model: OnceLock::new(),
            oriented_model: OnceLock::new(),
        };
        reader.finish()?;
        Ok(Self { weight: WEIGHT, known: Some(Arc::new(known)) })
    }
}

/// The indices of the features of a feature set among those of [`FeatureSet::stored`].
fn selection(feature_set: &FeatureSet) -> Option<Vec<usize>> {
    let all = FeatureSet::stored();
    let width = FeatureForm::Pooled.per_view();
    if feature_set.form() != FeatureForm::Pooled {
        return None;
    }
    let places = feature_set.views().iter().map(|view| all.views().iter().position(|other| other == view));
    let places = places.collect::<Option<Vec<_>>>()?;
    Some(places.into_iter().flat_map(|place| place * width..(place + 1) * width).collect())
}

impl Known {
    fn pooled(&self) -> Model {
        let dims = self.mean.len();
        let covariance = |root: &Vec<f64>| {
            let mut values = root.iter().copied();
            let mut full = Matrix::zero(dims, dims);
            for i in 0..dims {
                for (j, value) in (i..dims).zip(&mut values) {
                    full[(i, j)] = value;
                    full[(j, i)] = value;
                }
            }
            let square = full.times(&full);
            // From one triangle, since the two halves of the product may differ in the last bit.
            Matrix::from_fn(dims, dims, |i, j| square[(i.min(j), i.max(j))] * self.deviations[i] * self.deviations[j])
        };
        let [between, within, nuisance] = self.roots.each_ref().map(covariance);
        Model { mean: self.mean.clone(), between, within, nuisance }
    }

    fn oriented(&self) -> Model {
        let orbits = PairOrbits::new();
        let [between, within] = self.oriented.each_ref().map(|values| orbits.spread(values));
        let mean = ORBIT_OF.iter().map(|&orbit| self.oriented_mean[usize::from(orbit)]).collect();
        Model { mean, between, within, nuisance: Matrix::zero(MASK_COUNT, MASK_COUNT) }
    }
}

/// Reads a list of multiples of one step.
fn steps(reader: &mut Reader<'_>, length: usize) -> Result<Vec<f64>, SpaceError> {
    let step = reader.f64()?;
    let values: Vec<f64> = reader.packed(length)?.into_iter().map(|count| count as f64 * step).collect();
    if values.iter().all(|value| value.is_finite()) {
        Ok(values)
    } else {
        Err(reader.damaged("a number in it is not finite"))
    }
}

#[cfg(test)]
mod tests;
