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

use std::sync::{Arc, LazyLock, OnceLock};

use super::codec::{Header, Reader, Writer};
use super::fit::{Model, inverse_deviation};
use super::linalg::{Eigen, Matrix};
use super::scatter::Scatter;
use super::{Contribution, FeatureForm, FeatureSet, NuisanceStatistics, SpaceError, Statistics};
use crate::hlac::MASK_COUNT;
use crate::hlac::orbits::{ORBIT_COUNT, ORBIT_OF, members, symmetries};
use crate::volume::Volume;

const PRIOR: Header = Header { what: "prior", magic: *b"hPri", version: 2 };

/// The number of textures that the shipped prior counts as.
pub const WEIGHT: f64 = 300.0;

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

/// The orbits of unordered pairs of masks under the symmetries of the cube.
struct PairOrbits {
    /// The orbit of each pair: the upper triangle, row by row.
    orbit_of: Vec<u32>,
    count: usize,
}

impl PairOrbits {
    fn new() -> Self {
        const UNKNOWN: u32 = u32::MAX;
        let symmetries = symmetries();
        let mut orbit_of = vec![UNKNOWN; Scatter::length(MASK_COUNT)];
        let mut count = 0;
        for (at, [i, j]) in Self::pairs().enumerate() {
            if orbit_of[at] == UNKNOWN {
                for symmetry in &symmetries {
                    orbit_of[Self::place(usize::from(symmetry[i]), usize::from(symmetry[j]))] = count;
                }
                count += 1;
            }
        }
        Self { orbit_of, count: count as usize }
    }

    fn pairs() -> impl Iterator<Item = [usize; 2]> {
        (0..MASK_COUNT).flat_map(|i| (i..MASK_COUNT).map(move |j| [i, j]))
    }

    /// The index of a pair in the upper triangle.
    fn place(i: usize, j: usize) -> usize {
        let (i, j) = (i.min(j), i.max(j));
        i * MASK_COUNT - i * (i + 1) / 2 + j
    }

    /// The mean of a symmetric matrix over each orbit.
    fn average(&self, matrix: &Matrix) -> Vec<f64> {
        let mut sums = vec![(0.0, 0.0); self.count];
        for (&orbit, [i, j]) in self.orbit_of.iter().zip(Self::pairs()) {
            let (sum, count) = &mut sums[orbit as usize];
            *sum += matrix[(i, j)];
            *count += 1.0;
        }
        sums.into_iter().map(|(sum, count)| sum / count).collect()
    }

    /// The matrix whose elements are the values of their orbits.
    fn spread(&self, values: &[f64]) -> Matrix {
        Matrix::from_fn(MASK_COUNT, MASK_COUNT, |i, j| values[self.orbit_of[Self::place(i, j)] as usize])
    }
}

/// The statistics that a prior is made of. Additive and exact: parts can be collected in any order and merged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Observations {
    pooled: Statistics,
    nuisance: NuisanceStatistics,
    oriented: Statistics,
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

    /// The bytes that [`Prior::decode`] reads.
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

/// Reads what [`write_steps`] wrote.
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
