//! A map of the whole store: two coordinates for every texture.

use serde::Serialize;

use crate::TextureId;
use crate::database::handle::Database;
use crate::database::points::live::SpaceState;
use crate::error::Error;
use crate::index::Points;
use crate::space::linalg::{axpy, dot_in_order, orthogonal_iteration};

/// A position in the plane for every texture.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TextureMap {
    /// The space whose points are shown.
    pub space: String,
    /// The number of the fit of the space.
    pub epoch: u64,
    /// The revision of the store.
    pub revision: u64,
    /// The number of textures that have a point: more than `ids` if there are more than the limit.
    pub total: u64,
    /// The shares of the points' variance along the two axes.
    pub explained: [f64; 2],
    /// The textures, by ascending id.
    pub ids: Vec<TextureId>,
    /// The first coordinate of each.
    pub x: Vec<f32>,
    /// The second coordinate of each.
    pub y: Vec<f32>,
}

/// The number of points that determine the axes: more make no visible difference.
const ENOUGH_POINTS: usize = 2048;
/// The number of iterations that determine an axis.
const STEPS: usize = 40;

impl Database {
    /// Projects the points of a space on the two axes along which they vary most.
    ///
    /// If more than `limit` textures have points, an evenly spread sample is returned. The same store gives the same map.
    ///
    /// # Errors
    /// [`QueryError::NoSuchSpace`](crate::QueryError::NoSuchSpace), [`Error::Store`].
    pub fn map(&self, space: &str, limit: usize) -> Result<TextureMap, Error> {
        let snapshot = self.store().read()?;
        let state = self.state(&snapshot, space)?;
        Ok(map_of(space, &state, limit))
    }
}

fn map_of(space: &str, state: &SpaceState, limit: usize) -> TextureMap {
    let points = state.index.points();
    let axes = Axes::of(points);
    let step = points.len().div_ceil(limit.max(1)).max(1);
    let shown = points.iter().step_by(step);
    let (mut ids, mut x, mut y) = (Vec::new(), Vec::new(), Vec::new());
    for (id, point) in shown {
        let [first, second] = axes.project(point);
        ids.push(id.into());
        x.push(first);
        y.push(second);
    }
    TextureMap {
        space: space.to_owned(),
        epoch: state.owner.space.epoch(),
        revision: state.owner.revision,
        total: points.len() as u64,
        explained: axes.explained,
        ids,
        x,
        y,
    }
}

/// The plane in which points vary most: their two leading principal axes.
struct Axes {
    mean: Vec<f64>,
    axes: [Vec<f64>; 2],
    explained: [f64; 2],
}

impl Axes {
    fn of(points: &Points) -> Self {
        let dims = points.dims();
        let step = points.len().div_ceil(ENOUGH_POINTS).max(1);
        let sample: Vec<&[f32]> = points.iter().step_by(step).map(|(_, point)| point).collect();
        let count = sample.len().max(1) as f64;
        let mut mean = vec![0.0; dims];
        for point in &sample {
            mean.iter_mut().zip(*point).for_each(|(sum, &value)| *sum += f64::from(value) / count);
        }
        let mut rows: Vec<Vec<f64>> = sample
            .iter()
            .map(|point| point.iter().zip(&mean).map(|(&value, mean)| f64::from(value) - mean).collect())
            .collect();
        let total: f64 = rows.iter().map(|row| dot_in_order(row, row)).sum();
        let mut explained = [0.0; 2];
        let axes = [0, 1].map(|number| {
            let (axis, variance) = leading(&rows, dims);
            explained[number] = if total > 0.0 { variance / total } else { 0.0 };
            // The part along the first axis is removed, so that the second axis is found in the same way.
            for row in &mut rows {
                let along = dot_in_order(row, &axis);
                row.iter_mut().zip(&axis).for_each(|(value, axis)| *value -= along * axis);
            }
            axis
        });
        Self { mean, axes, explained }
    }

    fn project(&self, point: &[f32]) -> [f32; 2] {
        let centred: Vec<f64> = point.iter().zip(&self.mean).map(|(&value, mean)| f64::from(value) - mean).collect();
        [0, 1].map(|axis| dot_in_order(&centred, &self.axes[axis]) as f32)
    }
}

/// The unit vector along which rows vary most, and the sum of their squares along it. Its largest component is positive, so
/// that maps of successive fits are not mirror images.
fn leading(rows: &[Vec<f64>], dims: usize) -> (Vec<f64>, f64) {
    // No symmetry of a data set makes it orthogonal to this start.
    let start = (0..dims).map(|at| 1.0 + at as f64 / dims as f64).collect();
    let scatter = |vector: &[f64]| {
        let mut product = vec![0.0; dims];
        for row in rows {
            axpy(&mut product, dot_in_order(row, vector), row);
        }
        product
    };
    let Some(found) = orthogonal_iteration(vec![start], STEPS, scatter, &[]).pop() else { return (vec![], 0.0) };
    let mut axis = found.vector;
    let largest = axis.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
    if largest < 0.0 {
        axis.iter_mut().for_each(|value| *value = -*value);
    }
    (axis, found.eigenvalue)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::Metric;

    #[test]
    fn the_axes_are_those_along_which_points_vary_most() {
        let mut points = Points::new(Metric::L2, 4).unwrap();
        for at in 0..200_u64 {
            let (a, b) = ((at as f32 * 0.7).sin() * 10.0, (at as f32 * 1.3).cos() * 3.0);
            points.push(at + 1, &[0.01 * a, b + 5.0, a - 2.0, 7.0]).unwrap();
        }
        let axes = Axes::of(&points);
        assert!(axes.axes[0][2] > 0.99 && axes.axes[1][1] > 0.99, "{:?}", axes.axes);
        assert!(axes.explained[0] > 0.85 && (axes.explained[0] + axes.explained[1] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn points_that_do_not_vary_have_one_position() {
        for count in [0, 1, 3] {
            let mut points = Points::new(Metric::L2, 3).unwrap();
            (1..=count).for_each(|id| points.push(id, &[1.0, 2.0, 3.0]).unwrap());
            let axes = Axes::of(&points);
            assert_eq!((axes.explained, axes.project(&[1.0, 2.0, 3.0])), ([0.0; 2], [0.0; 2]));
        }
    }

    #[test]
    fn the_bits_of_a_map_are_frozen() {
        let mut points = Points::new(Metric::L2, 6).unwrap();
        let value = |at: u64| ((at + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f32 / (1 << 24) as f32;
        for id in 1..500_u64 {
            let point: [f32; 6] = std::array::from_fn(|at| value(id * 6 + at as u64) * (at + 1) as f32);
            points.push(id, &point).unwrap();
        }
        let axes = Axes::of(&points);
        let numbers = axes.axes.iter().flatten().chain(&axes.explained).chain(&axes.mean);
        let bits: Vec<u64> = numbers.map(|number| number.to_bits()).collect();
        assert_eq!(xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(&bits)), 1_154_375_074_357_880_118);
    }
}
