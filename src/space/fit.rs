//! The fit of likeness spaces: from statistics to directions that vary much between textures and little within one.

use super::definition::MAX_DIMS;
use super::linalg::{Eigen, Matrix, axpy};
use super::{NuisanceStatistics, Statistics};

/// Features with at most this standard deviation are constant: quantisation alone causes it.
const CONSTANT: f64 = 1e-9;

/// Eigenvalues of `T` below this fraction of the largest are noise.
const LEAST_EIGENVALUE: f64 = 1e-10;

/// Added to the variance within a texture before dividing by it.
const RIDGE: f64 = 0.02;

/// The input of a fit: the mean and three covariances of the features.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Model {
    pub(super) mean: Vec<f64>,
    /// `T`: between textures.
    pub(super) between: Matrix,
    /// `O`: of octants within a texture.
    pub(super) within: Matrix,
    /// `N`: between a texture and its copies under nuisances.
    pub(super) nuisance: Matrix,
}

impl Model {
    /// Combines a store's statistics with a prior that counts as `weight` textures. Nuisance statistics of the store
    /// replace those of the prior.
    pub(super) fn combine(
        own: &Statistics,
        nuisance: Option<&NuisanceStatistics>,
        prior: Option<(f64, &Model)>,
    ) -> Self {
        let dims = own.feature_set().dims();
        let (count, octants) = (own.count() as f64, own.octant_count() as f64);
        let (mut mean, mut between) = (own.mean(), own.between());
        let mut within = own.within().unwrap_or(Matrix::zero(dims, dims));
        let mut of_nuisance = Matrix::zero(dims, dims);
        if let Some((weight, prior)) = prior.filter(|(weight, _)| *weight > 0.0) {
            let share = count / (count + weight);
            let apart: Vec<f64> = mean.iter().zip(&prior.mean).map(|(own, prior)| own - prior).collect();
            // The covariance of the mixture: within both parts, and between their means.
            between = Matrix::from_fn(dims, dims, |i, j| {
                let parts = share * between[(i, j)] + (1.0 - share) * prior.between[(i, j)];
                parts + share * (1.0 - share) * (apart[i] * apart[j])
            });
            mean = apart.iter().zip(&prior.mean).map(|(apart, prior)| prior + share * apart).collect();
            let share = octants / (octants + weight);
            within = Matrix::from_fn(dims, dims, |i, j| share * within[(i, j)] + (1.0 - share) * prior.within[(i, j)]);
            of_nuisance = prior.nuisance.clone();
        }
        if let Some(own) = nuisance.filter(|own| own.count() > 0) {
            of_nuisance = own.covariance();
        }
        Self { mean, between, within, nuisance: of_nuisance }
    }
}

impl Model {
    /// The model of some of the features.
    pub(super) fn select(&self, features: &[usize]) -> Self {
        let part = |matrix: &Matrix| {
            Matrix::from_fn(features.len(), features.len(), |i, j| matrix[(features[i], features[j])])
        };
        Self {
            mean: features.iter().map(|&feature| self.mean[feature]).collect(),
            between: part(&self.between),
            within: part(&self.within),
            nuisance: part(&self.nuisance),
        }
    }
}

/// A fitted map: `(x - mean) weights`, before the scaling to unit length.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Projection {
    pub(super) mean: Vec<f64>,
    /// A row for each feature, a column for each coordinate.
    pub(super) weights: Matrix,
    /// The correlation of each feature (row) with each coordinate (column) over the textures; 0 for constant ones.
    pub(super) correlations: Matrix,
    /// The standard deviation of each feature over the textures; 0 for constant ones.
    pub(super) deviations: Vec<f64>,
    /// The variance of each coordinate over the textures, falling. Where the statistics have fewer directions than there
    /// are dimensions, the last coordinates are always 0.
    pub(super) variances: Vec<f64>,
}

impl Projection {
    pub(super) fn fit(model: Model, nuisance_weight: f64, dims: usize) -> Self {
        let features = model.mean.len();
        let scale: Vec<f64> = (0..features).map(|at| inverse_deviation(model.between[(at, at)])).collect();
        let scaled = |matrix: &Matrix| Matrix::from_fn(features, features, |i, j| matrix[(i, j)] * scale[i] * scale[j]);
        let between = scaled(&model.between);
        let mut within = scaled(&model.within);
        if nuisance_weight > 0.0 {
            let nuisance = scaled(&model.nuisance);
            within = Matrix::from_fn(features, features, |i, j| within[(i, j)] + nuisance_weight * nuisance[(i, j)]);
        }
        // Each row is a whitened direction: in these the scatter between textures is the identity.
        let white = whitening(Eigen::of(between.clone()));
        let inner = white.times(&within).times(&white.transposed());
        let size = white.rows();
        let symmetric = Matrix::from_fn(size, size, |i, j| 0.5 * (inner[(i, j)] + inner[(j, i)]));
        let Eigen { values, vectors } = Eigen::of(symmetric);
        let found = dims.min(size);
        // Rounding can make an eigenvalue of a scatter negative.
        let mut variances: Vec<f64> = values[..found].iter().map(|value| 1.0 / (value.max(0.0) + RIDGE)).collect();
        let directions = Matrix::from_fn(found, size, |i, j| vectors[(i, j)] * variances[i].sqrt());
        let directions = directions.times(&white);
        let structure = directions.times(&between);
        let signs: Vec<f64> = (0..found).map(|at| sign(directions.row(at))).collect();
        let mut weights = Matrix::zero(features, dims);
        let mut correlations = Matrix::zero(features, dims);
        for at in 0..found {
            let unit = signs[at] / variances[at].sqrt();
            for feature in 0..features {
                weights[(feature, at)] = signs[at] * directions[(at, feature)] * scale[feature];
                correlations[(feature, at)] = structure[(at, feature)] * unit;
            }
        }
        variances.resize(dims, 0.0);
        let deviations = scale.iter().map(|&scale| if scale > 0.0 { 1.0 / scale } else { 0.0 }).collect();
        Self { mean: model.mean, weights, correlations, deviations, variances }
    }

    /// The coordinates of `x`, not scaled to unit length. Missing features count as average.
    pub(super) fn project(&self, x: impl Iterator<Item = Option<f64>>) -> Vec<f64> {
        self.apply(x.zip(&self.mean).map(|(x, mean)| x.map(|x| x - mean)))
    }

    /// Maps a difference of features; missing ones count as 0.
    pub(super) fn apply(&self, difference: impl Iterator<Item = Option<f64>>) -> Vec<f64> {
        let mut point = vec![0.0; self.weights.columns()];
        for (feature, difference) in difference.enumerate() {
            if let Some(difference) = difference {
                axpy(&mut point, difference, self.weights.row(feature));
            }
        }
        point
    }
}

/// The inverse of the standard deviation; 0 for a constant feature.
pub(super) fn inverse_deviation(variance: f64) -> f64 {
    let deviation = variance.max(0.0).sqrt();
    if deviation > CONSTANT { 1.0 / deviation } else { 0.0 }
}

/// Eigenvectors divided by the root of their eigenvalues, as rows, by falling eigenvalue: at most [`MAX_DIMS`], without
/// noise.
fn whitening(eigen: Eigen) -> Matrix {
    let largest = eigen.values.last().copied().unwrap_or(0.0);
    let good = |value: &f64| *value > LEAST_EIGENVALUE * largest && *value > 0.0;
    let kept = eigen.values.iter().rev().take(MAX_DIMS).take_while(|value| good(value)).count();
    let last = eigen.values.len();
    let row = |at: usize| last - 1 - at;
    Matrix::from_fn(kept, last, |i, j| eigen.vectors[(row(i), j)] / eigen.values[row(i)].sqrt())
}

/// The sign that makes the largest weight positive, since the sign of an eigenvector is arbitrary.
fn sign(direction: &[f64]) -> f64 {
    let largest =
        direction.iter().fold(0.0_f64, |largest, &weight| if weight.abs() > largest.abs() { weight } else { largest });
    if largest < 0.0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, SymmetricEigen};
    use proptest::prelude::*;

    use super::*;

    /// A random covariance of `dims` features with `rank` directions.
    fn covariance(dims: usize, rank: usize, numbers: &[f64]) -> DMatrix<f64> {
        let factor = DMatrix::from_fn(dims, rank, |i, j| numbers[(7 * i + 31 * j + i * j) % numbers.len()]);
        &factor * factor.transpose() / dims as f64
    }

    fn matrix(matrix: &DMatrix<f64>) -> Matrix {
        Matrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)])
    }

    /// The formula as it is written, on another eigensolver: the squared distance between two points, not of unit length.
    fn reference(model: &[DMatrix<f64>; 3], weight: f64, dims: usize, difference: &DVector<f64>) -> f64 {
        let scale = model[0].diagonal().map(|variance| if variance > 0.0 { variance.sqrt().recip() } else { 0.0 });
        let scale = DMatrix::from_diagonal(&scale);
        let [between, within, nuisance] = model.each_ref().map(|matrix| &scale * matrix * &scale);
        let eigen = SymmetricEigen::new(between);
        let largest = eigen.eigenvalues.max();
        let kept: Vec<usize> =
            (0..eigen.eigenvalues.len()).filter(|&at| eigen.eigenvalues[at] > LEAST_EIGENVALUE * largest).collect();
        let white = DMatrix::from_fn(scale.nrows(), kept.len(), |i, j| {
            eigen.eigenvectors[(i, kept[j])] / eigen.eigenvalues[kept[j]].sqrt()
        });
        let inner = SymmetricEigen::new(white.transpose() * (within + nuisance * weight) * &white);
        let mut order: Vec<usize> = (0..kept.len()).collect();
        order.sort_by(|&a, &b| inner.eigenvalues[a].total_cmp(&inner.eigenvalues[b]));
        let z = difference.transpose() * scale * white;
        let coordinate =
            |at: &usize| (&z * inner.eigenvectors.column(*at))[0].powi(2) / (inner.eigenvalues[*at] + RIDGE);
        order.iter().take(dims).map(coordinate).sum()
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(24))]

        #[test]
        fn distances_follow_the_formula(
            features in 2..40_usize, dims in 1..12_usize, weight in 0.0..2.0_f64,
            numbers in proptest::collection::vec(-1.0..1.0_f64, 997), other in proptest::collection::vec(-1.0..1.0_f64, 991),
        ) {
            let model = [
                covariance(features, features + 5, &numbers),
                covariance(features, features, &other),
                covariance(features, 3, &numbers[100..]),
            ];
            let [between, within, nuisance] = model.each_ref().map(matrix);
            let mean = vec![0.5; features];
            let projection = Projection::fit(Model { mean, between, within, nuisance }, weight, dims);
            let difference: Vec<f64> = other[..features].to_vec();
            let point = projection.apply(difference.iter().map(|&d| Some(d)));
            prop_assert_eq!(point.len(), dims);
            let squared: f64 = point.iter().map(|c| c * c).sum();
            let expected = reference(&model, weight, dims, &DVector::from_vec(difference));
            prop_assert!((squared / expected - 1.0).abs() < 1e-6, "{} {}", squared, expected);
        }
    }

    #[test]
    fn constant_features_and_missing_directions_are_zero() {
        // The third feature is constant, the fourth equals the first.
        let copies = [0, 1, usize::MAX, 0];
        let of = |i: usize, j: usize| if copies[i] == copies[j] && copies[i] < 2 { 0.04 } else { 0.0 };
        let model = Model {
            mean: vec![0.5; 4],
            between: Matrix::from_fn(4, 4, of),
            within: Matrix::from_fn(4, 4, |i, j| of(i, j) * if copies[i] == 1 { 0.5 } else { 0.01 }),
            nuisance: Matrix::zero(4, 4),
        };
        let projection = Projection::fit(model, 1.0, 5);
        assert_eq!(projection.variances[2..], [0.0; 3]);
        assert!(projection.weights.row(2).iter().all(|&weight| weight == 0.0));
        assert!((projection.weights[(0, 0)] - projection.weights[(3, 0)]).abs() < 1e-12);
        assert!(projection.weights[(0, 0)] > 0.0 && projection.weights[(1, 0)].abs() < 1e-9);
        assert!(projection.weights.values().iter().all(|weight| weight.is_finite()));
    }
}
