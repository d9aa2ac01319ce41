//! Points in a byte a coordinate, whose distances tell those of the points to within a known margin.
//!
//! A point's *code* is its coordinates in whole steps from -127 to 127. With `e(x)` the distance of a point from what its
//! code stands for, the triangle inequality gives `distance(code x, code q) <= distance(x, q) + e(x) + e(q)`: a row whose
//! code is farther away than that is no neighbour, whatever the steps are and wherever coordinates were cut. Distances of
//! codes are whole numbers (squared for L2), so only the threshold is rounded, and it is widened by `2^-20` for that.

use rayon::prelude::*;

use crate::space::Metric;

/// Quantiser from 0 to 1, or to the number that is farthest from the middle.
pub(super) const STEPS: f32 = 127.0;

/// The code of a coordinate that is not finite.
pub const NO_POINT: i8 = i8::MIN;

/// The codes of a point's coordinates in steps of 1/127, cut at -1 and 1; [`NO_POINT`] where one is not finite.
pub fn quantise(point: &[f32]) -> impl Iterator<Item = i8> + '_ {
    let code = |coordinate: f32| (coordinate.clamp(-1.0, 1.0) * STEPS).round_ties_even() as i8;
    point.iter().map(move |&coordinate| if coordinate.is_finite() { code(coordinate) } else { NO_POINT })
}

/// Of so many coordinates the distance of two codes still fits its number.
pub(super) const MOST_DIMS: usize = 16_384;

/// The distance of two codes in steps, squared for L2, of at most [`MOST_DIMS`] coordinates.
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

/// A distance of at most `reach` steps, as codes have it (squared for L2), rounded up.
pub(super) fn threshold(metric: Metric, reach: f64) -> u32 {
    let reach = reach * (1.0 + 1.0 / f64::from(1 << 20));
    let bound = match metric {
        Metric::L2 => reach * reach,
        Metric::L1 => reach,
    };
    // The conversion stops at the greatest number, where nothing is left out.
    bound.ceil() as u32
}

/// Rows that one thread codes at a time.
const PART: usize = 4096;

/// How numbers become codes: in steps of one size, as fine as the number that varies most allows.
pub(super) struct Quantiser {
    pub(super) metric: Metric,
    /// What the code 0 stands for.
    middles: Vec<f64>,
    /// Quantiser of one unit.
    scale: f64,
    /// The greatest distance of anything coded from what its code stands for.
    error: f64,
}

/// A query's code, and how much the distance of two codes may exceed that of what they stand for.
pub(super) struct QuantisedQuery {
    pub(super) code: Vec<i16>,
    slack: f64,
}

impl Quantiser {
    /// Quantiser for the `dims` numbers that `numbers` gives of each row, and their codes.
    pub(super) fn code(
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
        // Where nothing varies, or hardly, every code is zero.
        let scale = f64::from(STEPS) / most.max(1e-30);
        let mut steps = Self { metric, middles: extents.iter().map(middle).collect(), scale, error: 0.0 };
        let mut codes = vec![0; rows.len() * dims];
        steps.error = rows
            .par_chunks(PART)
            .zip(codes.par_chunks_mut(PART * dims))
            .map(|(rows, codes)| {
                let mut row_numbers = vec![0.0; dims];
                rows.iter().zip(codes.chunks_exact_mut(dims)).fold(0.0, |error: f64, (&row, code)| {
                    numbers(row as usize, &mut row_numbers);
                    error.max(steps.put(&row_numbers, code))
                })
            })
            .reduce(|| 0.0, f64::max);
        (steps, codes)
    }

    /// How many numbers are coded.
    pub(super) fn numbers(&self) -> usize {
        self.middles.len()
    }

    /// The code of some numbers; returns how far they are from what it stands for.
    fn put(&self, numbers: &[f32], code: &mut [i8]) -> f64 {
        let mut sum = 0.0;
        for ((code, &number), middle) in code.iter_mut().zip(numbers).zip(&self.middles) {
            let apart = f64::from(number) - middle;
            // Rounded half up: `round` is a call on machines without an instruction for it.
            *code = ((apart * self.scale + 127.5).clamp(0.0, 254.0) as i16 - 127) as i8;
            let left = apart - f64::from(*code) / self.scale;
            sum += if self.metric == Metric::L2 { left * left } else { left.abs() };
        }
        if self.metric == Metric::L2 { sum.sqrt() } else { sum }
    }

    /// A query's code.
    pub(super) fn of(&self, numbers: &[f32]) -> QuantisedQuery {
        let mut code = vec![0; numbers.len()];
        let slack = (self.error + self.put(numbers, &mut code)) * (1.0 + 1e-9);
        QuantisedQuery { code: code.into_iter().map(i16::from).collect(), slack }
    }

    /// What is at most `limit` away has codes at most this far away.
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

        /// What codes bound is never nearer than they say, whatever was cut.
        #[test]
        fn codes_bound_what_they_stand_for(
            dims in 1usize..20, l1: bool,
            values in prop::collection::vec(prop_oneof![-1.0f32..1.0, 900.0f32..901.0, -1e30f32..1e30, Just(0.0f32)], 20..400),
            query in prop::collection::vec(prop_oneof![-2.0f32..2.0, -1e31f32..1e31], 20),
        ) {
            let metric = if l1 { Metric::L1 } else { Metric::L2 };
            let rows: Vec<u32> = (0..(values.len() / dims) as u32).collect();
            let point = |row: usize| &values[row * dims..][..dims];
            let (steps, codes) = Quantiser::code(metric, &rows, dims, |row, into| into.copy_from_slice(point(row)));
            for query in [&query[..dims], point(0)] {
                let own = steps.of(query);
                for (&row, code) in rows.iter().zip(codes.chunks_exact(dims)) {
                    let apart = metric.distance(query, point(row as usize));
                    prop_assert!(distance(metric, code, &own.code) <= steps.threshold(&own, apart));
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
        let (steps, codes) = Quantiser::code(Metric::L2, &[0, 1], 3, |_, into| into.fill(7.5));
        assert_eq!((codes, steps.error), (vec![0; 6], 0.0));
    }
}
