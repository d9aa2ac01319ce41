//! Scalar quantisation: points in one byte per coordinate, whose distances bound those of the points.
//!
//! The *code* of a point holds its coordinates as integers from -127 to 127, in steps of one size. Let `e(x)` be the distance
//! between a point and the point that its code stands for. By the triangle inequality
//! `distance(code x, code q) <= distance(x, q) + e(x) + e(q)`, so a row with a more distant code is no neighbour. This holds for
//! any step size, and for clamped coordinates too. Distances between codes are integers (squared for L2); only the threshold
//! is rounded, and `2^-20` of it is added as a margin.

use rayon::prelude::*;

use crate::space::Metric;

/// The largest magnitude of a coordinate of a code.
pub(super) const STEPS: f32 = 127.0;

/// The code of a coordinate that is not finite: there is no point.
pub const NO_POINT: i8 = i8::MIN;

/// Quantises the coordinates of a point in steps of 1/127, clamped to [-1, 1]; [`NO_POINT`] for a coordinate that is not
/// finite. Stores contain these codes: they never change.
pub fn quantise(point: &[f32]) -> impl Iterator<Item = i8> + '_ {
    let code = |coordinate: f32| (coordinate.clamp(-1.0, 1.0) * STEPS).round_ties_even() as i8;
    point.iter().map(move |&coordinate| if coordinate.is_finite() { code(coordinate) } else { NO_POINT })
}

/// The largest number of coordinates for which the distance of two codes fits in 32 bits.
pub(super) const MAX_DIMS: usize = 16_384;

/// The distance between two codes of at most [`MAX_DIMS`] coordinates, in steps; squared for L2.
#[inline(always)]
pub(super) fn distance(metric: Metric, one: &[i8], other: &[i16]) -> u32 {
    let mut sum = 0i32;
    match metric {
        Metric::L2 => {
            for (&one, &other) in one.iter().zip(other) {
                let apart = i32::from(other - i16::from(one));
                sum += apart * apart;
            }
        }
        Metric::L1 => {
            for (&one, &other) in one.iter().zip(other) {
                sum += i32::from((other - i16::from(one)).abs());
            }
        }
    }
    sum as u32
}

/// The largest distance between codes (squared for L2) that corresponds to a distance of `reach` steps, rounded up.
pub(super) fn threshold(metric: Metric, reach: f64) -> u32 {
    let reach = reach * (1.0 + 1.0 / f64::from(1 << 20));
    let bound = match metric {
        Metric::L2 => reach * reach,
        Metric::L1 => reach,
    };
    // The conversion saturates at the largest number, which excludes no row.
    bound.ceil() as u32
}

/// Rows that one thread quantises at a time.
const PART: usize = 4096;

/// How numbers become codes: a midpoint for each number, and one step size, as fine as the number with the largest range
/// allows.
pub(super) struct Quantiser {
    pub(super) metric: Metric,
    /// The numbers that the code 0 stands for.
    middles: Vec<f64>,
    /// Steps per unit.
    scale: f64,
    /// The largest distance between a quantised row and what its code stands for.
    error: f64,
}

/// The code of a query, and the most by which the distance between codes exceeds that between what they were made of.
pub(super) struct QuantisedQuery {
    pub(super) code: Vec<i16>,
    slack: f64,
}

impl Quantiser {
    /// Quantises the `dims` numbers that `numbers` writes for each row; returns the quantiser and the codes.
    pub(super) fn fit(
        metric: Metric,
        rows: &[u32],
        dims: usize,
        numbers: impl Fn(usize, &mut [f32]) + Sync,
    ) -> (Self, Vec<i8>) {
        let wide = || vec![[f32::INFINITY, f32::NEG_INFINITY]; dims];
        let widen = |mut a: Vec<[f32; 2]>, b: &mut dyn Iterator<Item = [f32; 2]>| {
            a.iter_mut().zip(b).for_each(|(a, b)| *a = [a[0].min(b[0]), a[1].max(b[1])]);
            a
        };
        let extents = rows
            .par_chunks(PART)
            .map(|rows| {
                let mut row_numbers = vec![0.0; dims];
                rows.iter().fold(wide(), |extents, &row| {
                    numbers(row as usize, &mut row_numbers);
                    widen(extents, &mut row_numbers.iter().map(|&c| [c; 2]))
                })
            })
            .reduce(wide, |a, b| widen(a, &mut b.into_iter()));
        let middle = |&[least, most]: &[f32; 2]| (f64::from(least) + f64::from(most)) / 2.0;
        let most = extents.iter().fold(0.0, |reach: f64, e| reach.max((f64::from(e[1]) - f64::from(e[0])) / 2.0));
        // If no number varies, every code is zero.
        let scale = f64::from(STEPS) / most.max(1e-30);
        let mut quantiser = Self { metric, middles: extents.iter().map(middle).collect(), scale, error: 0.0 };
        let mut codes = vec![0; rows.len() * dims];
        quantiser.error = rows
            .par_chunks(PART)
            .zip(codes.par_chunks_mut(PART * dims))
            .map(|(rows, codes)| {
                let mut row_numbers = vec![0.0; dims];
                rows.iter().zip(codes.chunks_exact_mut(dims)).fold(0.0, |error: f64, (&row, code)| {
                    numbers(row as usize, &mut row_numbers);
                    error.max(quantiser.put(&row_numbers, code))
                })
            })
            .reduce(|| 0.0, f64::max);
        (quantiser, codes)
    }

    /// The number of numbers in a code.
    pub(super) fn numbers(&self) -> usize {
        self.middles.len()
    }

    /// Writes the code of some numbers; returns their distance from what it stands for.
    fn put(&self, numbers: &[f32], code: &mut [i8]) -> f64 {
        let mut sum = 0.0;
        for ((code, &number), middle) in code.iter_mut().zip(numbers).zip(&self.middles) {
            let apart = f64::from(number) - middle;
            // Rounds half up: `round` is a function call on CPUs without an instruction for it.
            *code = ((apart * self.scale + 127.5).clamp(0.0, 254.0) as i16 - 127) as i8;
            let left = apart - f64::from(*code) / self.scale;
            sum += if self.metric == Metric::L2 { left * left } else { left.abs() };
        }
        if self.metric == Metric::L2 { sum.sqrt() } else { sum }
    }

    /// Quantises a query.
    pub(super) fn query(&self, numbers: &[f32]) -> QuantisedQuery {
        let mut code = vec![0; numbers.len()];
        let slack = (self.error + self.put(numbers, &mut code)) * (1.0 + 1e-9);
        QuantisedQuery { code: code.into_iter().map(i16::from).collect(), slack }
    }

    /// The largest distance between the code of a query and that of a row at most `limit` away.
    pub(super) fn threshold(&self, own: &QuantisedQuery, limit: f64) -> u32 {
        threshold(self.metric, (limit + own.slack) * self.scale)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(hlacdb_testing::cases(256))]

        /// Codes of neighbours are within the threshold, clamped coordinates included.
        #[test]
        fn codes_are_lower_bounds(
            dims in 1usize..20, l1: bool,
            values in prop::collection::vec(prop_oneof![-1.0f32..1.0, 900.0f32..901.0, -1e30f32..1e30, Just(0.0f32)], 20..400),
            query in prop::collection::vec(prop_oneof![-2.0f32..2.0, -1e31f32..1e31], 20),
        ) {
            let metric = if l1 { Metric::L1 } else { Metric::L2 };
            let rows: Vec<u32> = (0..(values.len() / dims) as u32).collect();
            let point = |row: usize| &values[row * dims..][..dims];
            let (quantiser, codes) = Quantiser::fit(metric, &rows, dims, |row, into| into.copy_from_slice(point(row)));
            for query in [&query[..dims], point(0)] {
                let own = quantiser.query(query);
                for (&row, code) in rows.iter().zip(codes.chunks_exact(dims)) {
                    let apart = metric.distance(query, point(row as usize));
                    prop_assert!(distance(metric, code, &own.code) <= quantiser.threshold(&own, apart));
                }
            }
        }
    }

    #[test]
    fn codes_are_frozen() {
        assert_eq!(
            quantise(&[0.0, 1.0, -1.0, 7.0, 0.5, -0.004, f32::NAN]).collect::<Vec<_>>(),
            [0, 127, -127, 127, 64, -1, -128]
        );
    }

    #[test]
    fn equal_rows_have_equal_codes() {
        let (quantiser, codes) = Quantiser::fit(Metric::L2, &[0, 1], 3, |_, into| into.fill(7.5));
        assert_eq!((codes, quantiser.error), (vec![0; 6], 0.0));
    }
}
