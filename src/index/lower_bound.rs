//! Lower bounds of distances from a few numbers per row, and the margin that makes them safe under rounding.
//!
//! The *key* of a point consists of its leading coordinates and, if it has more, the norm of the rest (the L2 norm for L2,
//! the L1 norm for L1). By the triangle inequality the distance between two keys is at most the distance between their
//! points, so a row with a distant key cannot be a neighbour. Points of many coordinates also have a *fine* key: seven more
//! coordinates, and the norm of the rest after these. It is used where the first, *coarse* key is near enough.
//!
//! The leading coordinates are the first ones, or those of largest variance, or, for L2, projections on the directions of
//! largest variance ([`super::projection`]), which leave a smaller rest. Rows left by the bound of 100 k points of a store
//! of moments (32 coordinates, k = 10): 1743 with seven coordinates and the norm, 977 with seven directions, 100 with
//! fifteen directions.
//!
//! # The margin
//!
//! Keys are `f32` and their distances are computed in `f32`, so comparisons need a margin. Let `u = 2^-24`, `D` the exact
//! distance between two points and `K` that between their keys.
//!
//! * The numbers of a key are computed in `f64` and rounded once. Each has a relative error of at most `u`, so all together
//!   have an error of at most `u |x|`, where `|x|` is the norm of the point. The norm of the rest after projection is the
//!   root of a difference: for `d` coordinates `f64` loses up to `d 2^-51 |x|^2` of the difference, and at most
//!   `sqrt(d 2^-51) |x|` of the root. Numbers beyond the range of `f32` are clamped, which only reduces distances. So
//!   rounded keys are at most `s = (2 u + sqrt(d 2^-51)) (|query| + largest |x|)` farther apart than exact ones:
//!   `K <= D + s`.
//! * Directions are orthonormal to `2^-40` or better: a factor of `1 + 2^-40`.
//! * A difference and a square contribute a factor of at most `(1 + u)^3`, an addition `1 + u`. A key has at most 15
//!   numbers ([`WIDTHS`], [`FINE`]), so the sum of a scan is below `K^2 (1 + u)^20`. kiddo's tree replaces the term of one
//!   axis on every level: two operations with an error of at most `2 u K^2` in all, on at most 64 levels, add `128 u`.
//! * The distance of a row is computed in `f64` with a relative error below `2^-30` for any number of coordinates that fits
//!   in memory.
//! * Where squares underflow, every operation may add `2^-150`: less than `2^-126` in all.
//!
//! The product of all factors is below `1 + 200 u < 1 + 2^-16`. [`QueryKey::threshold`] uses `1 + 2^-15`, adds the smallest
//! normal `f32` for underflow, and rounds up. So a neighbour within `limit` never has a computed key distance above
//! `threshold(limit)`; a row below it is only a candidate. Sums overflow to infinity only where the threshold is infinite.

use super::projection::{DIRECTIONS, Projection};
use crate::space::Metric;

/// Rows whose keys are interleaved, so that one pass over vectors bounds them all.
pub(super) const LANES: usize = 16;

/// The keys of [`LANES`] rows: an array for each number of a key.
pub(super) type KeyBlock = [[f32; LANES]];

/// Numbers in the coarse key of a point of few and of many coordinates. Two widths, so that two kinds of tree are enough.
pub(super) const WIDTHS: [usize; 2] = [4, 8];

/// Numbers in the fine key.
pub(super) const FINE: usize = 8;

/// Points of fewer coordinates have no fine key, since their distances cost little more.
const FEWEST_FOR_FINE: usize = 20;

// A coarse and a fine key together hold all directions, and a norm each.
const _: () = assert!(DIRECTIONS == WIDTHS[1] - 1 + FINE - 1);

/// The numbers of one point's keys.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Key {
    pub(super) coarse: [f32; WIDTHS[1]],
    pub(super) fine: [f32; FINE],
}

impl Key {
    /// The numbers of the longest key: the coarse one or, if there is a fine one, the leading numbers of the coarse one
    /// followed by those of the fine one.
    pub(super) fn numbers(&self, width: usize, fine: bool) -> impl Iterator<Item = f32> {
        let leading = if fine { width - 1 } else { width };
        self.coarse.into_iter().take(leading).chain(self.fine.into_iter().take(if fine { FINE } else { 0 }))
    }
}

/// How keys are computed from points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct KeyLayout {
    dims: usize,
    /// The coordinates, leading ones first. Not used if there is a projection.
    order: Vec<usize>,
    projection: Option<Projection>,
    fine: bool,
}

/// The number of numbers in a coarse key and of leading coordinates in it. Keys of fewer coordinates than their width are
/// padded with zeros.
fn width_and_leading(dims: usize) -> (usize, usize) {
    let [few, many] = WIDTHS;
    match dims {
        _ if dims <= few => (few, dims),
        _ if dims <= many => (many, dims),
        _ => (many, many - 1),
    }
}

impl KeyLayout {
    /// Keys of the first coordinates, without fine keys: for points whose coordinates are ordered by variance.
    pub(super) fn first(dims: usize) -> Self {
        Self { dims, order: (0..dims).collect(), projection: None, fine: false }
    }

    /// Keys of the directions of largest variance (L2) or of the coordinates of largest variance (L1) of `rows`: points,
    /// one after another.
    pub(super) fn learned(metric: Metric, dims: usize, rows: &[f32]) -> Self {
        let spread = super::projection::spread(dims, rows);
        let mut order: Vec<usize> = (0..dims).collect();
        order.sort_by(|&a, &b| spread[b].total_cmp(&spread[a]).then(a.cmp(&b)));
        let fine = dims >= FEWEST_FOR_FINE;
        let projection = if fine && metric == Metric::L2 { Projection::learned(dims, rows, &order) } else { None };
        // Leading coordinates in ascending order, so that their sums do not depend on the order of variances.
        let (_, leading) = width_and_leading(dims);
        order[..leading].sort_unstable();
        Self { dims, order, projection, fine }
    }

    /// The number of numbers in a coarse key: one of [`WIDTHS`].
    pub(super) fn width(&self) -> usize {
        width_and_leading(self.dims).0
    }

    /// Whether the last number of a coarse key is a norm.
    pub(super) fn has_rest(&self) -> bool {
        width_and_leading(self.dims).1 < self.dims
    }

    /// Whether there are fine keys.
    pub(super) fn has_fine(&self) -> bool {
        self.fine
    }

    /// The keys of a point.
    pub(super) fn key(&self, metric: Metric, point: &[f32]) -> Key {
        let mut key = Key::default();
        let (width, leading) = width_and_leading(self.dims);
        match &self.projection {
            Some(projection) => {
                let (along, left) = projection.apply(point);
                let (first, second) = along.split_at(leading);
                put(&mut key.coarse, first, left[leading]);
                put(&mut key.fine, second, left[DIRECTIONS]);
            }
            None => {
                let value = |&axis: &usize| f64::from(point[axis]);
                let rest = |from: usize| metric.norm(self.order[from..].iter().map(|&axis| point[axis]));
                let first: Vec<f64> = self.order[..leading].iter().map(value).collect();
                put(&mut key.coarse[..width], &first, if self.has_rest() { rest(leading) } else { 0.0 });
                if self.fine {
                    let second: Vec<f64> = self.order[leading..DIRECTIONS].iter().map(value).collect();
                    put(&mut key.fine, &second, rest(DIRECTIONS));
                }
            }
        }
        key
    }

    /// The most that rounding adds to the distance of two keys, for each unit of the norms of their points.
    fn slack(&self) -> f64 {
        let projected = if self.projection.is_some() { (self.dims as f64 / (1_u64 << 51) as f64).sqrt() } else { 0.0 };
        f64::from(f32::EPSILON) + projected
    }
}

/// Writes numbers and a norm, rounded. Clamped, not infinite: the difference of two infinities would be NaN and lose the row.
fn put(into: &mut [f32], numbers: &[f64], norm: f64) {
    let most = f64::from(f32::MAX);
    for (into, number) in into.iter_mut().zip(numbers.iter().copied().chain([norm])) {
        *into = number.clamp(-most, most) as f32;
    }
}

/// The key of a query, to be compared with the keys of rows.
pub(super) struct QueryKey {
    metric: Metric,
    key: Key,
    width: usize,
    fine: bool,
    /// The most that rounding adds to the distance of two keys.
    slack: f64,
}

/// The distances of the coarse keys of a block, and their sums over the leading numbers, which fine keys continue.
pub(super) struct Coarse {
    pub(super) bounds: [f32; LANES],
    leading: [f32; LANES],
}

impl QueryKey {
    /// The key of a query over points with norms of at most `max_norm`.
    pub(super) fn new(metric: Metric, layout: &KeyLayout, point: &[f32], max_norm: f64) -> Self {
        let norm = metric.norm(point.iter().copied());
        let slack = (norm + max_norm) * layout.slack();
        Self { metric, key: layout.key(metric, point), width: layout.width(), fine: layout.has_fine(), slack }
    }

    /// The numbers of the coarse key.
    pub(super) fn key(&self) -> &[f32] {
        &self.key.coarse[..self.width]
    }

    /// Whether rows have fine keys.
    pub(super) fn has_fine(&self) -> bool {
        self.fine
    }

    /// The numbers of the longest key: see [`Key::numbers`].
    pub(super) fn numbers(&self) -> Vec<f32> {
        self.key.numbers(self.width, self.fine).collect()
    }

    /// The most that rounding adds to the distance of two keys.
    pub(super) fn slack(&self) -> f64 {
        self.slack
    }

    /// The largest computed key distance (squared for L2) of a row at most `limit` away. Infinite if `limit` is, or if its
    /// square exceeds the range of `f32`.
    pub(super) fn threshold(&self, limit: f64) -> f32 {
        const MARGIN: f64 = 1.0 + 1.0 / 32768.0;
        let limit = limit + self.slack;
        let bound = match self.metric {
            Metric::L2 => limit * limit * MARGIN,
            Metric::L1 => limit * MARGIN,
        };
        ((bound + f64::from(f32::MIN_POSITIVE)) as f32).next_up()
    }

    /// The distances (squared for L2) between the coarse key and those of a block.
    #[inline(always)]
    pub(super) fn coarse(&self, block: &KeyBlock) -> Coarse {
        let Some((last, leading)) = block.split_last() else {
            return Coarse { bounds: [0.0; LANES], leading: [0.0; LANES] };
        };
        let own = self.key.coarse[self.width - 1];
        let leading = self.lanes([0.0; LANES], leading, &self.key.coarse);
        Coarse { bounds: self.lanes(leading, std::slice::from_ref(last), &[own]), leading }
    }

    /// The distances (squared for L2) between the longest key and those of a block, given those of the coarse keys.
    #[inline(always)]
    pub(super) fn fine(&self, coarse: &Coarse, block: &KeyBlock) -> [f32; LANES] {
        self.lanes(coarse.leading, block, &self.key.fine)
    }

    #[inline(always)]
    fn lanes(&self, sums: [f32; LANES], block: &KeyBlock, key: &[f32]) -> [f32; LANES] {
        match self.metric {
            Metric::L2 => add_lanes(sums, block, key, |d| d * d),
            Metric::L1 => add_lanes(sums, block, key, f32::abs),
        }
    }
}

#[inline(always)]
fn add_lanes(mut sums: [f32; LANES], block: &KeyBlock, key: &[f32], term: impl Fn(f32) -> f32) -> [f32; LANES] {
    for (values, &own) in block.iter().zip(key) {
        for lane in 0..LANES {
            sums[lane] += term(own - values[lane]);
        }
    }
    sums
}
