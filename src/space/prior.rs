//! What is known about textures before a store has any.
//!
//! A prior is fitted on a large set of synthetic textures and copies of them under nuisances ([`Observations`]) and
//! shipped with the program ([`Prior::shipped`]); `cargo run --release --example fit_prior` makes the shipped one anew.
//! It has what likeness spaces need: mean, `T`, `O` and `N` of the pooled features of `full@1` and the seven views of
//! likeness (and so of any part of these eight: a store of imported `full@1` alone has its prior too), and mean, `T` and
//! `O` of the degree roots of `stretch@1`. Other feature sets have no prior: their spaces are fitted on the store's own
//! statistics alone.
//!
//! In a likeness fit the prior counts as [`WEIGHT`] textures, and its octants as theirs. The weight was chosen on
//! `datasets/families.toml` by `examples/quality.rs`, with each query's family left out of the prior and of the store's
//! statistics (mean average precision of `default`, then of `invariant`; 880 textures of 44 families):
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
//! 300 leaves a small store to the prior (a store of 30 counts a tenth), and gives a large one nearly all that its own
//! statistics have.
//!
//! # Bytes
//!
//! Covariances would lose their small directions in few bits; their square roots do not. With `z` the features by their
//! standard deviation, the pooled ones are kept as the upper triangles of the symmetric roots `T^1/2`, `O^1/2`,
//! `N^1/2` of `z` (row after row, each from the diagonal on). The oriented ones are averaged over the 48 symmetries of
//! the cube, as no prior should prefer a direction: what is left is one number for each orbit of masks, or of pairs of
//! masks (numbered by their first pair, row after row of the upper triangle).
//!
//! ```text
//! textures   u64
//! pairs      u64          textures with a copy
//! mean       f64 list     280
//! sd         f64 list     280
//! T, O, N    step f64, a power of two, and whole numbers of steps, packed (24 bits each): 280 * 281 / 2 each
//! oriented: mean f64 list (18), T f64 list, O f64 list (one each for an orbit of pairs)
//! ```

use std::sync::{Arc, LazyLock, OnceLock};

use super::bytes::{Header, Reader, Writer};
use super::fit::{Model, inverse_deviation};
use super::linalg::{Eigen, Matrix};
use super::scatter::Scatter;
use super::{Contribution, FeatureForm, FeatureSet, NuisanceStatistics, SpaceError, Statistics};
use crate::hlac::MASK_COUNT;
use crate::hlac::orbits::{ORBIT_COUNT, ORBIT_OF, members, symmetries};
use crate::volume::Volume;

const PRIOR: Header = Header { what: "prior", magic: *b"hPri", version: 2 };

/// How many textures the shipped prior counts as.
pub const WEIGHT: f64 = 300.0;

/// What is known about textures in general, and how many textures that counts as.
#[derive(Clone, Debug)]
pub struct Prior {
    weight: f64,
    known: Option<Arc<Known>>,
}

/// The content of a prior, and the models made of it when first asked for.
#[derive(Debug)]
struct Known {
    textures: u64,
    mean: Vec<f64>,
    deviations: Vec<f64>,
    /// The triangles of the roots of T, O and N.
    roots: [Vec<f64>; 3],
    oriented_mean: Vec<f64>,
    oriented: [Vec<f64>; 2],
    pooled_model: OnceLock<Model>,
    oriented_model: OnceLock<Model>,
}

impl Prior {
    /// Nothing is known: a fit looks at the store's own statistics only.
    pub fn none() -> Self {
        Self { weight: 0.0, known: None }
    }

    /// The prior that comes with the program, which counts as [`WEIGHT`] textures.
    pub fn shipped() -> Self {
        static SHIPPED: LazyLock<Prior> =
            LazyLock::new(|| Prior::decode(include_bytes!("prior.bin")).unwrap_or_else(|_| Prior::none()));
        SHIPPED.clone()
    }

    /// The same, counting as so many textures; a weight that is negative or not finite counts as 0.
    pub fn with_weight(self, weight: f64) -> Self {
        Self { weight: if weight.is_finite() { weight.max(0.0) } else { 0.0 }, ..self }
    }

    /// How many textures it counts as.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// How many textures it was fitted on; 0 where nothing is known.
    pub fn textures(&self) -> u64 {
        self.known.as_ref().map_or(0, |known| known.textures)
    }

    /// Whether something is known about the features of a feature set.
    pub fn knows(&self, feature_set: &FeatureSet) -> bool {
        self.known.is_some() && (*feature_set == FeatureSet::oriented() || selection(feature_set).is_some())
    }

    /// What is known about the features of a feature set.
    pub(super) fn model(&self, feature_set: &FeatureSet) -> Option<Model> {
        let known = self.known.as_ref()?;
        if *feature_set == FeatureSet::oriented() {
            return Some(known.oriented_model.get_or_init(|| known.oriented()).clone());
        }
        let selection = selection(feature_set)?;
        Some(known.pooled_model.get_or_init(|| known.pooled()).select(&selection))
    }

    /// The prior that [`Observations::encode`] wrote, which counts as [`WEIGHT`] textures.
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

/// Where the features of a feature set are among those of [`FeatureSet::stored`].
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
            // From one triangle: the two halves of a product may differ in a last bit.
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
    /// The orbit of each pair: the upper triangle, row after row.
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

    /// Where a pair is in the upper triangle.
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

    /// The matrix that has an orbit's value at all its pairs.
    fn spread(&self, values: &[f64]) -> Matrix {
        Matrix::from_fn(MASK_COUNT, MASK_COUNT, |i, j| values[self.orbit_of[Self::place(i, j)] as usize])
    }
}

/// What is gathered from textures to make a prior of. Additive and exact: gather in parts, in any order, and merge.
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
    /// Adds a texture and copies of it under nuisances, turns among them. One that is too small for all eight views is
    /// not counted.
    ///
    /// # Errors
    /// None that volumes can give.
    pub fn add(&mut self, texture: &Volume, copies: &[Volume]) -> Result<(), SpaceError> {
        let feature_set = FeatureSet::stored();
        let described = crate::describe(texture, feature_set.views());
        let oriented = Contribution::of_sums(&FeatureSet::oriented(), &described)?;
        let (Some(pooled), Some(oriented)) = (Contribution::of_sums(&feature_set, &described)?, oriented) else {
            return Ok(());
        };
        self.pooled.add(&pooled)?;
        self.oriented.add(&oriented)?;
        for copy in copies {
            if let Some(copy) = Contribution::of_sums(&feature_set, &crate::describe(copy, feature_set.views()))? {
                self.nuisance.add(&pooled, &copy)?;
            }
        }
        Ok(())
    }

    /// Adds what other textures gave.
    ///
    /// # Errors
    /// None: the feature sets are the same.
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

/// So many steps hold the largest number of a list: 24 bits with the sign.
const STEPS: f64 = 8_388_608.0;

/// Writes a list as whole numbers of one step, which is a power of two.
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
