//! Lower bounds of distances from a few numbers per row, and the margin that keeps them safe from rounding.
//!
//! The *key* of a point is its leading coordinates and, where it has more than those, the norm of the rest (L2 norm for
//! L2, L1 norm for L1). By the triangle inequality the distance between two keys is never more than the distance
//! between their points, so a row whose key is too far away is no neighbour. Keys are `f32` and their distances are
//! computed in `f32`, so the comparison needs a margin. With `u = 2^-24`, true (real) distance `D` and key distance `K`:
//!
//! * The rest norm is summed in `f64` and rounded once: off by less than `2 u` of itself. A norm beyond the range of
//!   `f32` is cut to its maximum, which only brings norms nearer. So the rounded keys are at most
//!   `s = 2 u (rest of the query + greatest rest of all rows)` farther apart than the exact ones: `K <= D + s`.
//! * A difference and a square cost a factor `(1 + u)^3` at most, each addition `1 + u`: with at most 9 numbers
//!   in a key ([`WIDTHS`]) the sum of a scan is below `K^2 (1 + u)^12`. The tree replaces one axis' share in the
//!   sum on every level, two operations of at most `2 u K^2` in all, on at most 64 levels: 128 `u` more.
//! * The distance that ranks a row is computed in `f64`, off by less than `2^-30` of itself for as many coordinates as
//!   memory holds.
//! * Where squares underflow, every operation may add `2^-150`: less than `2^-126` in all.
//!
//! All factors together stay below `1 + 160 u < 1 + 2^-16`; [`Probe::threshold`] takes `1 + 2^-15` and the smallest
//! normal `f32` for the underflow, and rounds up. A row that is a neighbour within `limit` therefore never has a
//! computed key distance above `threshold(limit)`; a row below it is only a candidate. Overflow to infinity happens only
//! where the threshold is infinite as well.

use super::Metric;

/// Rows whose keys stand interleaved, so that one pass of vector instructions bounds them all.
pub(super) const LANES: usize = 16;

/// The keys of [`LANES`] rows, one array per number of the key.
pub(super) type KeyBlock = [[f32; LANES]];

/// Which numbers make a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct KeyShape {
    /// The coordinates taken as they are, ascending.
    axes: Vec<usize>,
    /// The other coordinates, whose norm is the last number; empty where there are none.
    rest: Vec<usize>,
}

/// Numbers in the key of a point of few and of many coordinates: two widths, so that two kinds of tree serve all.
pub(super) const WIDTHS: [usize; 2] = [4, 8];

/// Numbers in the key of a point, and how many of its coordinates lead. Keys of fewer than four coordinates are filled
/// up with zeros.
fn width_and_leading(dims: usize) -> (usize, usize) {
    let [few, many] = WIDTHS;
    match dims {
        _ if dims <= few => (few, dims),
        _ if dims < many => (few, few - 1),
        _ => (many, many - 1),
    }
}

impl KeyShape {
    /// The first coordinates lead: right for points whose coordinates are ordered by variance.
    pub(super) fn first(dims: usize) -> Self {
        Self::new(dims, (0..width_and_leading(dims).1).collect())
    }

    /// The coordinates of greatest `spread` lead; equal ones in their own order.
    pub(super) fn widest(spread: &[f64]) -> Self {
        let mut order: Vec<usize> = (0..spread.len()).collect();
        order.sort_by(|&a, &b| spread[b].total_cmp(&spread[a]).then(a.cmp(&b)));
        order.truncate(width_and_leading(spread.len()).1);
        order.sort_unstable();
        Self::new(spread.len(), order)
    }

    fn new(dims: usize, axes: Vec<usize>) -> Self {
        let rest = (0..dims).filter(|axis| axes.binary_search(axis).is_err()).collect();
        Self { axes, rest }
    }

    /// Numbers in a key: one of [`WIDTHS`].
    pub(super) fn width(&self) -> usize {
        width_and_leading(self.axes.len() + self.rest.len()).0
    }

    /// The key of a point, one number at a time.
    pub(super) fn key<'a>(&'a self, metric: Metric, point: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        let norm = (!self.rest.is_empty()).then(|| {
            let norm = metric.norm(self.rest.iter().map(|&axis| point[axis]));
            // Cut, not infinite: the difference of two infinities would be NaN and lose the row.
            norm.min(f64::from(f32::MAX)) as f32
        });
        let zeros = std::iter::repeat(0.0);
        self.axes.iter().map(|&axis| point[axis]).chain(norm).chain(zeros).take(self.width())
    }

    /// Numbers of a key that say something: those taken as they are, and the norm.
    pub(super) fn told(&self) -> usize {
        self.axes.len() + usize::from(self.has_rest())
    }

    /// Whether the last number of a key is a rounded norm.
    pub(super) fn has_rest(&self) -> bool {
        !self.rest.is_empty()
    }
}

/// The key of a query, ready to be compared with the keys of rows.
pub(super) struct Probe {
    metric: Metric,
    key: [f32; WIDTHS[1]],
    width: usize,
    /// How much rounded norms may add to the distance of two keys.
    slack: f64,
}

impl Probe {
    /// For rows whose rest norms are at most `reach`.
    pub(super) fn new(metric: Metric, shape: &KeyShape, point: &[f32], reach: f32) -> Self {
        let mut key = [0.0; WIDTHS[1]];
        let mut width = 0;
        for value in shape.key(metric, point) {
            key[width] = value;
            width += 1;
        }
        let rest = if shape.has_rest() { key[width - 1] } else { 0.0 };
        let slack = (f64::from(rest) + f64::from(reach)) * f64::from(f32::EPSILON);
        Self { metric, key, width, slack }
    }

    /// The numbers of the query's key.
    pub(super) fn key(&self) -> &[f32] {
        &self.key[..self.width]
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

    /// The computed key distances of the rows of a block (squared for L2).
    #[inline]
    pub(super) fn distances(&self, block: &KeyBlock) -> [f32; LANES] {
        match self.metric {
            Metric::L2 => self.lanes(block, |d| d * d),
            Metric::L1 => self.lanes(block, f32::abs),
        }
    }

    /// The computed distance of one row's key (squared for L2).
    #[inline]
    pub(super) fn distance(&self, key: &[f32]) -> f32 {
        let differences = key.iter().zip(&self.key).map(|(value, own)| own - value);
        match self.metric {
            Metric::L2 => differences.map(|d| d * d).sum(),
            Metric::L1 => differences.map(f32::abs).sum(),
        }
    }

    /// The computed distances of the key from boxes (squared for L2): two arrays for each number of a key, the least and
    /// the greatest. 0 inside a box, infinite for one that is empty (its least infinite).
    #[inline]
    pub(super) fn box_distances(&self, boxes: &KeyBlock) -> [f32; LANES] {
        match self.metric {
            Metric::L2 => self.box_lanes(boxes, |d| d * d),
            Metric::L1 => self.box_lanes(boxes, |d| d),
        }
    }

    #[inline(always)]
    fn box_lanes(&self, boxes: &KeyBlock, term: impl Fn(f32) -> f32) -> [f32; LANES] {
        let mut sums = [0.0f32; LANES];
        let (pairs, _) = boxes.as_chunks::<2>();
        for ([least, most], &own) in pairs.iter().zip(&self.key) {
            for lane in 0..LANES {
                let (below, above) = (least[lane] - own, own - most[lane]);
                // Plain comparisons: single instructions on vectors, which `f32::max` is not.
                let outside = if below > above { below } else { above };
                sums[lane] += term(if outside > 0.0 { outside } else { 0.0 });
            }
        }
        sums
    }

    #[inline(always)]
    fn lanes(&self, block: &KeyBlock, term: impl Fn(f32) -> f32) -> [f32; LANES] {
        let mut sums = [0.0f32; LANES];
        for (values, &own) in block.iter().zip(&self.key) {
            for lane in 0..LANES {
                sums[lane] += term(own - values[lane]);
            }
        }
        sums
    }
}
