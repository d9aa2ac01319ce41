//! [`Projection`]: the few directions in which points vary most.
//!
//! They approximate the leading principal axes of a sample of the points, by orthogonal iteration. Projection on orthonormal
//! directions increases no distance, so bounds hold for any directions; good ones make them tight.

use crate::space::linalg::{dot_in_order, orthogonal_iteration};

/// The number of directions.
pub(super) const DIRECTIONS: usize = 14;

/// Points with larger coordinates are not projected: their squares could overflow.
const MAGNITUDE: f32 = (1u64 << 60) as f32;

/// The largest number of multiplications for the covariance of the sample.
const EFFORT: usize = 1 << 26;

/// Rounds of the iteration.
const ROUNDS: usize = 12;

/// Orthonormal directions, by falling variance. Points are projected without subtracting their mean.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Projection {
    /// For each coordinate its component in each direction.
    components: Vec<[f64; DIRECTIONS]>,
}

impl Projection {
    /// The directions in which `rows`, points of `dims` coordinates one after another, vary most; `order` lists the
    /// coordinates by falling variance. `None` if there are too few coordinates, or if one is too large or not finite.
    pub(super) fn learned(dims: usize, rows: &[f32], order: &[usize]) -> Option<Self> {
        if dims < DIRECTIONS || rows.is_empty() {
            return None;
        }
        let covariance = covariance(dims, rows)?;
        let start = order.iter().take(DIRECTIONS).map(|&axis| unit(dims, axis)).collect();
        let product = |vector: &[f64]| covariance.chunks_exact(dims).map(|row| dot_in_order(row, vector)).collect();
        let directions = orthogonal_iteration(start, ROUNDS, product, order);
        let mut components = vec![[0.0; DIRECTIONS]; dims];
        for (at, direction) in directions.iter().enumerate() {
            for (component, &value) in components.iter_mut().zip(&direction.vector) {
                component[at] = value;
            }
        }
        Some(Self { components })
    }

    /// The coordinates of a point along the directions, and the norm of the rest of it after the first 0, 1, 2, ... of
    /// them.
    pub(super) fn apply(&self, point: &[f32]) -> ([f64; DIRECTIONS], [f64; DIRECTIONS + 1]) {
        let mut along = [0.0; DIRECTIONS];
        let mut square = 0.0;
        for (components, &coordinate) in self.components.iter().zip(point) {
            let coordinate = f64::from(coordinate);
            square += coordinate * coordinate;
            for (along, component) in along.iter_mut().zip(components) {
                *along += component * coordinate;
            }
        }
        let mut left = [0.0; DIRECTIONS + 1];
        for (left, along) in left.iter_mut().zip(along.iter().copied().chain([0.0])) {
            *left = f64::max(square, 0.0).sqrt();
            square -= along * along;
        }
        (along, left)
    }
}

/// The scatter of a sample of points about their mean, row-major; `None` if a coordinate is too large or not finite.
fn covariance(dims: usize, rows: &[f32]) -> Option<Vec<f64>> {
    let count = rows.len() / dims;
    let most = (EFFORT / (dims * dims)).clamp(256, 8192);
    let step = count.div_ceil(most).max(1);
    let sample = || rows.chunks_exact(dims).step_by(step);
    if !sample().flatten().all(|coordinate| coordinate.abs() <= MAGNITUDE) {
        return None;
    }
    let taken = sample().count() as f64;
    let mut mean = vec![0.0; dims];
    for row in sample() {
        mean.iter_mut().zip(row).for_each(|(mean, &c)| *mean += f64::from(c) / taken);
    }
    let mut covariance = vec![0.0; dims * dims];
    let mut apart = vec![0.0; dims];
    for row in sample() {
        apart.iter_mut().zip(row).zip(&mean).for_each(|((apart, &c), mean)| *apart = f64::from(c) - mean);
        for (line, &one) in covariance.chunks_exact_mut(dims).zip(&apart) {
            line.iter_mut().zip(&apart).for_each(|(sum, other)| *sum += one * other);
        }
    }
    Some(covariance)
}

fn unit(dims: usize, axis: usize) -> Vec<f64> {
    (0..dims).map(|at| if at == axis { 1.0 } else { 0.0 }).collect()
}

/// The scatter of each coordinate over an even sample of a few thousand rows: an estimate, to order coordinates by.
pub(super) fn spread(dims: usize, coordinates: &[f32]) -> Vec<f64> {
    const SAMPLE: usize = 4096;
    let mut moments = vec![(0.0f64, 0.0f64); dims];
    if dims == 0 {
        return vec![];
    }
    let step = (coordinates.len() / dims / SAMPLE).max(1);
    let mut count = 0.0;
    for row in coordinates.chunks_exact(dims).step_by(step) {
        count += 1.0;
        for ((mean, scatter), &value) in moments.iter_mut().zip(row) {
            let delta = f64::from(value) - *mean;
            *mean += delta / count;
            *scatter += delta * (f64::from(value) - *mean);
        }
    }
    // Rows with a coordinate that is not finite are refused later.
    moments.into_iter().map(|(_, scatter)| if scatter.is_nan() { 0.0 } else { scatter }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(hlacdb_testing::cases(60))]

        #[test]
        fn directions_are_orthonormal_for_any_points(
            dims in DIRECTIONS..40, flat in 0usize..40, rows in prop::collection::vec(-1.0f32..1.0, 40..4000), equal: bool,
        ) {
            let count = rows.len() / dims;
            // Coordinates from `flat` on do not vary, or all are the same.
            let value = |at: usize| if equal { rows[at % dims] } else if at % dims >= flat { 0.25 } else { rows[at] };
            let rows: Vec<f32> = (0..count * dims).map(value).collect();
            let order: Vec<usize> = (0..dims).rev().collect();
            let Some(projection) = Projection::learned(dims, &rows, &order) else { return Ok(()) };
            for i in 0..DIRECTIONS {
                for j in 0..DIRECTIONS {
                    let product: f64 = projection.components.iter().map(|components| components[i] * components[j]).sum();
                    prop_assert!((product - f64::from(u8::from(i == j))).abs() < 1e-13);
                }
            }
            let (along, left) = projection.apply(&rows[..dims]);
            let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
            let whole = norm(&mut rows[..dims].iter().map(|&c| f64::from(c)));
            prop_assert!((left[0] - whole).abs() < 1e-12);
            prop_assert!((norm(&mut along.into_iter().chain([left[DIRECTIONS]])) - whole).abs() < 1e-7);
        }
    }

    #[test]
    fn the_direction_of_largest_variance_leads() {
        // Points near one diagonal.
        let rows: Vec<f32> = (0..300 * 20)
            .map(|at| {
                ((at / 20) as f32 * 0.01 - 1.5) * if at % 2 == 0 { 1.0 } else { -1.0 } + (at * 7 % 13) as f32 * 1e-3
            })
            .collect();
        let projection = Projection::learned(20, &rows, &(0..20).collect::<Vec<_>>()).unwrap();
        let (along, left) = projection.apply(&rows[..20]);
        assert!(along[0].abs() > 6.0 && left[1] < 0.2, "{along:?} {left:?}");
        assert!(Projection::learned(20, &[f32::MAX; 40], &(0..20).collect::<Vec<_>>()).is_none());
    }

    /// Other arithmetic, in the covariance or in the iteration, shows in the last bits.
    #[test]
    fn the_bits_of_directions_are_frozen() {
        let value = |at: u64| ((at + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f32 / (1 << 24) as f32;
        let rows: Vec<f32> = (0..400 * 24).map(|at| value(at) * value(at % 24 + 7)).collect();
        let flat: Vec<f32> = rows.iter().enumerate().map(|(at, &v)| if at % 24 < 9 { v } else { 0.5 }).collect();
        let order: Vec<usize> = (0..24).rev().collect();
        let hash = |rows: &[f32]| {
            let projection = Projection::learned(24, rows, &order).unwrap();
            xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(projection.components.as_flattened()))
        };
        assert_eq!([hash(&rows), hash(&flat)], [6_925_808_283_992_956_490, 3_440_494_432_786_342_333]);
    }
}
