//! Points for benchmarks: many, of 32 coordinates and unit norm, with the low intrinsic dimension of descriptors.
//!
//! If `../shared/data/moments_20k.npy` exists, real descriptors are mapped by a fit like that of the default space
//! (degree roots, z-scores, principal axes weighted by a falling spectrum, unit norm, rotated to their own principal
//! axes), and rows beyond 20 000 lie between two near ones, with noise of 1e-4 on the degree roots. Otherwise points
//! are drawn around smooth surfaces of eight latent coordinates. Either way the seed fixes every bit of the input.

use std::path::Path;

use hlacdb::hlac::MASKS;
use hlacdb::internals::index::{Graph, Index, Points};
use hlacdb::space::Metric;
use hlacdb::volume::npy::NpyReader;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// The number of coordinates of a point.
pub(crate) const DIMS: usize = 32;

/// Rows drawn from one stream of random numbers.
const PART: usize = 4096;

/// The origin of the points.
pub(crate) enum Origin {
    /// Real descriptors, interpolated.
    Moments(Fit),
    /// Latent coordinates.
    Latent,
}

impl Origin {
    /// The real descriptors, if they exist.
    pub(crate) fn find() -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/moments_20k.npy");
        if !Path::new(path).exists() {
            return Origin::Latent;
        }
        let mut file = NpyReader::open(Path::new(path)).expect("moments_20k.npy is a NumPy file");
        Origin::Moments(Fit::new(&file.read_all::<f32>(u64::MAX).expect("its values are f32")))
    }

    /// The name printed with the figures.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Origin::Moments(_) => "moments_20k.npy, interpolated",
            Origin::Latent => "eight latent coordinates (no shared data)",
        }
    }

    /// `rows` points, row after row.
    pub(crate) fn points(&self, rows: usize, seed: u64) -> Vec<f32> {
        match self {
            Origin::Moments(fit) if rows * MOMENTS <= fit.roots.len() => fit.map_rows(&fit.roots[..rows * MOMENTS]),
            _ => self.drawn(rows, seed),
        }
    }

    /// `rows` points that differ from those of any other seed.
    pub(crate) fn drawn(&self, rows: usize, seed: u64) -> Vec<f32> {
        let draw = |(part, rows): (u64, usize)| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            rng.set_stream(part);
            match self {
                Origin::Moments(fit) => fit.between(rows, &mut rng),
                Origin::Latent => latent(rows, &mut rng),
            }
        };
        let parts: Vec<(u64, usize)> = (0..).zip((0..rows).step_by(PART).map(|start| PART.min(rows - start))).collect();
        parts.into_par_iter().map(draw).collect::<Vec<_>>().concat()
    }
}

/// Real descriptors, and their map to points.
pub(crate) struct Fit {
    /// Degree roots, 251 per row.
    roots: Vec<f64>,
    mean: DVector<f64>,
    map: DMatrix<f64>,
    rotation: DMatrix<f64>,
    /// The nearest rows of each row.
    near: Graph,
}

const MOMENTS: usize = 251;

impl Fit {
    fn new(moments: &[f32]) -> Self {
        let degrees: Vec<f64> = MASKS.iter().map(|mask| mask.cells().len() as f64).collect();
        let roots: Vec<f64> = moments
            .chunks_exact(MOMENTS)
            .flat_map(|row| row.iter().zip(&degrees).map(|(&m, d)| f64::from(m).powf(1.0 / d)))
            .collect();
        let rows = DMatrix::from_row_slice(roots.len() / MOMENTS, MOMENTS, &roots);
        let (mean, covariance) = scatter(&rows);
        let deviations = covariance.diagonal().map(|v| v.sqrt().max(1e-12));
        let scaled = DMatrix::from_fn(MOMENTS, MOMENTS, |i, j| covariance[(i, j)] / (deviations[i] * deviations[j]));
        let (values, vectors) = descending(scaled);
        // The axes of the fit: full weight for the first, a tenth for the last, like those of a fit on real textures.
        let kept = 64;
        let weight = |j: usize| 1.0 / ((j as f64 / kept as f64 + 0.02).sqrt() * values[j].sqrt());
        let map = DMatrix::from_fn(MOMENTS, DIMS, |i, j| vectors[(i, j)] * weight(j) / deviations[i]);
        let mut fit = Self { roots, mean, map, rotation: DMatrix::identity(DIMS, DIMS), near: Graph::default() };
        let points = fit.map_rows(&fit.roots);
        let rows = DMatrix::from_row_iterator(points.len() / DIMS, DIMS, points.iter().map(|&v| f64::from(v)));
        fit.rotation = descending(scatter(&rows).1).1;
        let points = fit.map_rows(&fit.roots);
        let ids: Vec<u64> = (0..points.len() as u64 / DIMS as u64).collect();
        let mut index = Index::from_points(Points::from_rows(Metric::L2, DIMS, &ids, &points).expect("finite points"));
        index.rebuild();
        fit.near = index.graph(10).expect("10 is not 0");
        fit
    }

    /// Maps degree roots to points.
    fn map_rows(&self, roots: &[f64]) -> Vec<f32> {
        let rows = DMatrix::from_row_slice(roots.len() / MOMENTS, MOMENTS, roots);
        let centred = DMatrix::from_fn(rows.nrows(), MOMENTS, |i, j| rows[(i, j)] - self.mean[j]);
        let mut points = centred * &self.map;
        for mut row in points.row_iter_mut() {
            let norm = row.norm();
            row /= norm;
        }
        let points = points * &self.rotation;
        (0..points.nrows()).flat_map(|i| (0..DIMS).map(move |j| (i, j))).map(|at| points[at] as f32).collect()
    }

    /// Points between neighbouring rows.
    fn between(&self, rows: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
        let mut roots = Vec::with_capacity(rows * MOMENTS);
        for _ in 0..rows {
            let one = rng.random_range(0..self.near.ids.len());
            let near = &self.near.neighbours[one];
            let other = near[rng.random_range(0..near.len())].id as usize;
            let share: f64 = rng.random();
            let pair = self.roots[one * MOMENTS..].iter().zip(&self.roots[other * MOMENTS..]);
            roots.extend(pair.take(MOMENTS).map(|(a, b)| share * a + (1.0 - share) * b + 1e-4 * normal(rng)));
        }
        self.map_rows(&roots)
    }
}

/// The mean and the covariance of rows.
fn scatter(rows: &DMatrix<f64>) -> (DVector<f64>, DMatrix<f64>) {
    let mean = rows.row_mean().transpose();
    let centred = DMatrix::from_fn(rows.nrows(), rows.ncols(), |i, j| rows[(i, j)] - mean[j]);
    (mean, centred.transpose() * &centred / rows.nrows() as f64)
}

/// Eigenvalues and eigenvectors, greatest first.
fn descending(matrix: DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let eigen = SymmetricEigen::new(matrix);
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let vectors = DMatrix::from_fn(order.len(), order.len(), |i, j| eigen.eigenvectors[(i, order[j])]);
    (order.iter().map(|&i| eigen.eigenvalues[i].max(1e-12)).collect(), vectors)
}

/// An approximately normal number of variance 1: the sum of four uniform ones.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let bits = rng.next_u64();
    let sum: u64 = (0..4).map(|part| bits >> (16 * part) & 0xffff).sum();
    (sum as f64 / 65535.0 - 2.0) * 3f64.sqrt()
}

/// Points of unit norm around forty smooth surfaces of eight latent coordinates.
fn latent(rows: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    const LATENT: usize = 8;
    const FAMILIES: usize = 40;
    let mut fixed = ChaCha8Rng::seed_from_u64(7);
    let mut draw = |n: usize| -> Vec<f64> { (0..n).map(|_| normal(&mut fixed)).collect() };
    let centres = draw(FAMILIES * DIMS);
    let directions = draw(FAMILIES * DIMS * LATENT);
    let mut points = Vec::with_capacity(rows * DIMS);
    for _ in 0..rows {
        let family = rng.random_range(0..FAMILIES);
        let latent: [f64; LATENT] = std::array::from_fn(|_| normal(rng));
        let point: Vec<f64> = (0..DIMS)
            .map(|i| {
                let at = family * DIMS + i;
                let along: f64 = directions[at * LATENT..][..LATENT].iter().zip(&latent).map(|(d, l)| d * l).sum();
                let weight = 1.0 / (1.0 + i as f64 / 4.0);
                weight * (centres[at] + 0.4 * (along * 0.5).sin()) + 0.002 * normal(rng)
            })
            .collect();
        let norm = point.iter().map(|v| v * v).sum::<f64>().sqrt();
        points.extend(point.iter().map(|v| (v / norm) as f32));
    }
    points
}
