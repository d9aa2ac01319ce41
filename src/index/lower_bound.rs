//! Lower bounds of distances from a few numbers per row, and the margin that keeps them safe from rounding.
//!
//! The *key* of a point is its leading coordinates and, where it has more than those, the norm of the rest (L2 norm for
//! L2, L1 norm for L1). By the triangle inequality the distance between two keys is never more than the distance
//! between their points, so a row whose key is too far away is no neighbour. Points of many coordinates have a *fine* key
//! as well: seven further coordinates and the norm of what is left then. It is looked at where the first, *coarse* key is
//! near enough.
//!
//! Which coordinates lead: the first ones, those of greatest spread, or, for L2, projections on the directions of greatest
//! spread ([`super::projection`]), which leave less to the norm. Measured (100 k points of a store of moments, 32 coordinates,
//! k = 10): a bound of seven coordinates and the norm leaves 1743 rows, of seven directions 977, of fifteen 100.
//!
//! Keys are `f32` and their distances are computed in `f32`, so the comparison needs a margin. With `u = 2^-24`, true
//! (real) distance `D` and key distance `K`:
//!
//! * The numbers of a key are computed in `f64` and rounded once, each off by at most `u` of itself, and so all together
//!   by at most `u |x|`, with `|x|` the norm of the point. The norm of what directions leave is the root of a difference:
//!   `f64` loses up to `d 2^-51 |x|^2` of that for `d` coordinates, the root at most `sqrt(d 2^-51) |x|`. Numbers beyond the
//!   range of `f32` are cut, which only brings them nearer. So the rounded keys are at most
//!   `s = (2 u + sqrt(d 2^-51)) (|query| + greatest |x|)` farther apart than the exact ones: `K <= D + s`.
//! * Directions are orthonormal to `2^-40` or better: a factor of `1 + 2^-40`.
//! * A difference and a square cost a factor `(1 + u)^3` at most, each addition `1 + u`: with at most 15 numbers
//!   in a key ([`WIDTHS`], [`FINE`]) the sum of a scan is below `K^2 (1 + u)^20`. The tree replaces one axis' share in the
//!   sum on every level, two operations of at most `2 u K^2` in all, on at most 64 levels: 128 `u` more.
//! * The distance that ranks a row is computed in `f64`, off by less than `2^-30` of itself for as many coordinates as
//!   memory holds.
//! * Where squares underflow, every operation may add `2^-150`: less than `2^-126` in all.
//!
//! All factors together stay below `1 + 200 u < 1 + 2^-16`; [`Probe::threshold`] takes `1 + 2^-15` and the smallest
//! normal `f32` for the underflow, and rounds up. A row that is a neighbour within `limit` therefore never has a
//! computed key distance above `threshold(limit)`; a row below it is only a candidate. Overflow to infinity happens only
//! where the threshold is infinite as well.

use super::projection::Projection;
use crate::space::Metric;

/// Rows whose keys stand interleaved, so that one pass of vector instructions bounds them all.
pub(super) const LANES: usize = 16;

/// The keys of [`LANES`] rows, one array per number of the key.
pub(super) type KeyBlock = [[f32; LANES]];

/// Numbers in the coarse key of a point of few and of many coordinates: two widths, so that two kinds of tree serve all.
pub(super) const WIDTHS: [usize; 2] = [4, 8];

/// Numbers in the fine key.
pub(super) const FINE: usize = 8;

/// Points of fewer coordinates have no fine key: measuring them costs little more.
const FEWEST_FOR_FINE: usize = 20;

/// The coordinates of a coarse and a fine key together.
pub(super) const DIRECTIONS: usize = WIDTHS[1] - 1 + FINE - 1;

/// The numbers of one point's keys.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Key {
    pub(super) coarse: [f32; WIDTHS[1]],
    pub(super) fine: [f32; FINE],
}

impl Key {
    /// The numbers of the best key there is: the coarse one, or, where there is a fine one, the leading numbers of the
    /// coarse one and then those of the fine one.
    pub(super) fn numbers(&self, width: usize, fine: bool) -> impl Iterator<Item = f32> {
        let leading = if fine { width - 1 } else { width };
        self.coarse.into_iter().take(leading).chain(self.fine.into_iter().take(if fine { FINE } else { 0 }))
    }
}

/// Which numbers make a key.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct KeyShape {
    dims: usize,
    /// The coordinates by falling importance: those that lead first. Not looked at where directions lead.
    order: Vec<usize>,
    turn: Option<Projection>,
    fine: bool,
}

/// Numbers in the key of a point, and how many of its coordinates lead. Keys of fewer coordinates than their width are
/// filled up with zeros.
fn width_and_leading(dims: usize) -> (usize, usize) {
    let [few, many] = WIDTHS;
    match dims {
        _ if dims <= few => (few, dims),
        _ if dims <= many => (many, dims),
        _ => (many, many - 1),
    }
}

impl KeyShape {
    /// The first coordinates lead, and there is no fine key: right for points whose coordinates are ordered by variance.
    pub(super) fn first(dims: usize) -> Self {
        Self { dims, order: (0..dims).collect(), turn: None, fine: false }
    }

    /// The directions of greatest spread lead (for L2), or the coordinates (for L1), learned from `rows`, which hold
    /// some points one after another.
    pub(super) fn learned(metric: Metric, dims: usize, rows: &[f32]) -> Self {
        let spread = super::projection::spread(dims, rows);
        let mut order: Vec<usize> = (0..dims).collect();
        order.sort_by(|&a, &b| spread[b].total_cmp(&spread[a]).then(a.cmp(&b)));
        let fine = dims >= FEWEST_FOR_FINE;
        let turn = if fine && metric == Metric::L2 { Projection::learned(dims, rows, &order) } else { None };
        // Those that lead in their own order: the same sums for the same points, whatever the spread.
        let (_, leading) = width_and_leading(dims);
        order[..leading].sort_unstable();
        Self { dims, order, turn, fine }
    }

    /// Numbers in a coarse key: one of [`WIDTHS`].
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
        match &self.turn {
            Some(turn) => {
                let (along, left) = turn.along(point);
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

    /// What rounding may add to the distance of two keys, for each unit of the norms of their points.
    fn slack(&self) -> f64 {
        let turned = if self.turn.is_some() { (self.dims as f64 / (1_u64 << 51) as f64).sqrt() } else { 0.0 };
        f64::from(f32::EPSILON) + turned
    }
}

/// Numbers and a norm, rounded. Cut, not infinite: the difference of two infinities would be NaN and lose the row.
fn put(into: &mut [f32], numbers: &[f64], norm: f64) {
    let most = f64::from(f32::MAX);
    for (into, number) in into.iter_mut().zip(numbers.iter().copied().chain([norm])) {
        *into = number.clamp(-most, most) as f32;
    }
}

/// The key of a query, ready to be compared with the keys of rows.
pub(super) struct Probe {
    metric: Metric,
    key: Key,
    width: usize,
    fine: bool,
    /// How much rounded numbers may add to the distance of two keys.
    slack: f64,
}

/// The computed distances of the coarse keys of a block, and the part of them that fine keys go on from.
pub(super) struct Coarse {
    pub(super) bounds: [f32; LANES],
    leading: [f32; LANES],
}

impl Probe {
    /// For rows whose points have norms of at most `reach`.
    pub(super) fn new(metric: Metric, shape: &KeyShape, point: &[f32], reach: f64) -> Self {
        let norm = metric.norm(point.iter().copied());
        let slack = (norm + reach) * shape.slack();
        Self { metric, key: shape.key(metric, point), width: shape.width(), fine: shape.has_fine(), slack }
    }

    /// The numbers of the query's coarse key.
    pub(super) fn key(&self) -> &[f32] {
        &self.key.coarse[..self.width]
    }

    /// Whether rows have fine keys.
    pub(super) fn has_fine(&self) -> bool {
        self.fine
    }

    /// The numbers of the query's best key: see [`Key::numbers`].
    pub(super) fn numbers(&self) -> Vec<f32> {
        self.key.numbers(self.width, self.fine).collect()
    }

    /// How much rounding may add to the distance of two keys.
    pub(super) fn slack(&self) -> f64 {
        self.slack
    }

    /// Rows at most `limit` away have a computed key distance of at most this.
    ///
    /// Key distances are squared for L2. Infinite where `limit` is, or where the square leaves the range of `f32`.
    pub(super) fn threshold(&self, limit: f64) -> f32 {
        const MARGIN: f64 = 1.0 + 1.0 / 32768.0;
        let limit = limit + self.slack;
        let bound = match self.metric {
            Metric::L2 => limit * limit * MARGIN,
            Metric::L1 => limit * MARGIN,
        };
        ((bound + f64::from(f32::MIN_POSITIVE)) as f32).next_up()
    }

    /// The computed distances of the coarse keys of a block (squared for L2).
    #[inline(always)]
    pub(super) fn coarse(&self, block: &KeyBlock) -> Coarse {
        let Some((last, leading)) = block.split_last() else {
            return Coarse { bounds: [0.0; LANES], leading: [0.0; LANES] };
        };
        let own = self.key.coarse[self.width - 1];
        let leading = self.lanes([0.0; LANES], leading, &self.key.coarse);
        Coarse { bounds: self.lanes(leading, std::slice::from_ref(last), &[own]), leading }
    }

    /// The computed distances of the fine keys of a block whose coarse ones are known.
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
