//! [`Metric`]: the one definition of a distance. Spaces name their metric, and the index computes with it.
//!
//! A distance is defined to the bit. Coordinates are converted to `f64` and subtracted; the square (L2) or absolute
//! value (L1) of the difference of coordinate `i` is added to lane `i % 8`, in ascending `i`; lanes are added as
//! `((0+4) + (2+6)) + ((1+5) + (3+7))`; L2 takes the square root. IEEE 754 fixes each of these steps, and Rust neither
//! reorders nor contracts them, so every CPU, index and thread computes the same bits. The lanes allow the compiler to
//! use vectors of any width.

use std::fmt;
use std::str::FromStr;

/// The distance between two points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[non_exhaustive]
pub enum Metric {
    /// The square root of the sum of squared differences.
    L2,
    /// The sum of absolute differences.
    L1,
}

/// Lanes of the sum. They are part of the definition: another number changes the last bits of a distance.
const LANES: usize = 8;

impl Metric {
    /// `L2` or `L1`.
    pub const fn name(self) -> &'static str {
        match self {
            Metric::L2 => "L2",
            Metric::L1 => "L1",
        }
    }

    /// The distance between two points of the same length: >= 0, NaN only if a coordinate is not finite.
    ///
    /// It is symmetric to the bit, and 0 exactly if the points are equal. If lengths differ, the extra coordinates of the
    /// longer point are ignored; the index refuses such points beforehand.
    ///
    /// ```
    /// use hlacdb::space::Metric;
    /// assert_eq!(Metric::L2.distance(&[0.0, 3.0], &[4.0, 0.0]), 5.0);
    /// assert_eq!(Metric::L1.distance(&[0.0, 3.0], &[4.0, 0.0]), 7.0);
    /// ```
    pub fn distance(self, a: &[f32], b: &[f32]) -> f64 {
        match self {
            Metric::L2 => sum(a, b, |d| d * d).sqrt(),
            Metric::L1 => sum(a, b, f64::abs),
        }
    }

    /// The distance of a point from the origin, by the same definition.
    pub(crate) fn norm(self, a: impl Iterator<Item = f32>) -> f64 {
        let a = a.map(f64::from);
        match self {
            Metric::L2 => a.map(|v| v * v).sum::<f64>().sqrt(),
            Metric::L1 => a.map(f64::abs).sum(),
        }
    }
}

/// The sum over coordinates in the order that the module defines.
#[inline(always)]
fn sum(a: &[f32], b: &[f32], term: impl Fn(f64) -> f64) -> f64 {
    let mut lanes = [0.0f64; LANES];
    let (a, a_rest) = a.as_chunks::<LANES>();
    let (b, b_rest) = b.as_chunks::<LANES>();
    for (a, b) in a.iter().zip(b) {
        for lane in 0..LANES {
            lanes[lane] += term(f64::from(a[lane]) - f64::from(b[lane]));
        }
    }
    for ((lane, &a), &b) in lanes.iter_mut().zip(a_rest).zip(b_rest) {
        *lane += term(f64::from(a) - f64::from(b));
    }
    let [l0, l1, l2, l3, l4, l5, l6, l7] = lanes;
    ((l0 + l4) + (l2 + l6)) + ((l1 + l5) + (l3 + l7))
}

impl fmt::Display for Metric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The name of no metric.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("metrics are L2 and L1 (got {0:?})")]
pub struct UnknownMetric(String);

impl FromStr for Metric {
    type Err = UnknownMetric;

    fn from_str(name: &str) -> Result<Self, UnknownMetric> {
        match name {
            "L2" | "l2" => Ok(Metric::L2),
            "L1" | "l1" => Ok(Metric::L1),
            _ => Err(UnknownMetric(name.to_owned())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The definition, written out.
    fn plain(a: &[f32], b: &[f32], term: impl Fn(f64) -> f64) -> f64 {
        let mut lanes = [0.0f64; 8];
        for i in 0..a.len() {
            lanes[i % 8] += term(f64::from(a[i]) - f64::from(b[i]));
        }
        let pairs: Vec<f64> = (0..4).map(|i| lanes[i] + lanes[i + 4]).collect();
        (pairs[0] + pairs[2]) + (pairs[1] + pairs[3])
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(256))]

        #[test]
        fn distances_follow_the_definition_at_every_length(
            pairs in prop::collection::vec((-1e6f32..1e6, -1e6f32..1e6), 0..300)
        ) {
            let (a, b): (Vec<f32>, Vec<f32>) = pairs.into_iter().unzip();
            let l2 = plain(&a, &b, |d| d * d).sqrt();
            let l1 = plain(&a, &b, f64::abs);
            prop_assert_eq!(Metric::L2.distance(&a, &b).to_bits(), l2.to_bits());
            prop_assert_eq!(Metric::L1.distance(&a, &b).to_bits(), l1.to_bits());
            prop_assert_eq!(Metric::L2.distance(&b, &a).to_bits(), l2.to_bits());
        }
    }

    #[test]
    fn golden_bits() {
        // From numbers that are the same on every platform: other lanes or another order show in the last bits.
        let a: Vec<f32> = (0..251u16).map(|i| f32::from(i * 37 % 101) / 101.0).collect();
        let b: Vec<f32> = (0..251u16).map(|i| 1.0 / (1.0 + f32::from(i))).collect();
        assert_eq!(Metric::L2.distance(&a, &b).to_bits(), 0x4021_bd43_48dc_14a7);
        assert_eq!(Metric::L1.distance(&a, &b).to_bits(), 0x405e_1b78_af2b_0000);
        let differences = a.iter().zip(&b).map(|(&a, &b)| f64::from(a) - f64::from(b));
        assert!((Metric::L2.distance(&a, &b) - differences.map(|d| d * d).sum::<f64>().sqrt()).abs() < 1e-12);
        assert_eq!(Metric::L2.distance(&[1e30, 0.0], &[-1e30, 1e-30]), f64::from(1e30f32) * 2.0);
    }

    #[test]
    fn names_are_parsed() {
        for metric in [Metric::L2, Metric::L1] {
            assert_eq!(metric.to_string().parse::<Metric>().unwrap(), metric);
        }
        assert!("cosine".parse::<Metric>().is_err());
    }
}
