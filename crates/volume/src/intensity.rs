//! The rule that maps deep samples to 256 levels, as it is asked for and as it is recorded.

use std::fmt;
use std::str::FromStr;

/// How samples deeper than 8 bits become the 256 levels of a volume. Samples of `u8` are always taken as they are.
///
/// A sample `v` becomes `255 (v - lo) / (hi - lo)`, computed in `f64`, rounded half away from zero and clamped to
/// 0..=255; where `hi == lo` every voxel is 0. For colour, `lo` and `hi` are common to the three channels. (Integers of 64
/// bits are rounded to the nearest `f64` first.)
///
/// Written as text: `full`, `auto`, `nonzero`, or `LO..HI` (`-1000..3000`).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Intensity {
    /// From the lowest to the highest sample of the volume.
    #[default]
    Full,
    /// From the 0.1 to the 99.9 percentile of the volume's samples, by nearest rank: of `n` samples in ascending order
    /// (counted from 1) `lo` is number `ceil(n / 1000)` and `hi` is number `ceil(999 n / 1000)`; nothing is interpolated.
    Auto,
    /// From `lo` to `hi`, in the file's own units (after the linear scaling of a NIfTI header).
    Window {
        /// The sample that becomes 0.
        lo: f64,
        /// The sample that becomes 255.
        hi: f64,
    },
    /// 0 where a sample is 0 in the file's own units, 255 where it is not: for labels and masks, none of which are lost
    /// then however small or negative they are. No line: `lo` and `hi` are recorded as 0.
    NonZero,
}

/// The rule that was applied and the numbers it came to: what a record keeps so that the levels can be traced back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mapping {
    /// The rule that was asked for.
    pub rule: Intensity,
    /// The sample that became 0, in the file's own units.
    pub lo: f64,
    /// The sample that became 255, in the file's own units.
    pub hi: f64,
}

/// A text that names no intensity rule.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{found}` is no intensity rule: write full, auto, nonzero, or LO..HI with two finite numbers, LO below HI")]
pub struct IntensityError {
    /// The text.
    pub found: String,
}

impl FromStr for Intensity {
    type Err = IntensityError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let window = || {
            let (lo, hi) = text.split_once("..")?;
            let (lo, hi) = (lo.trim().parse::<f64>().ok()?, hi.trim().parse::<f64>().ok()?);
            (lo.is_finite() && hi.is_finite() && lo < hi).then_some(Self::Window { lo, hi })
        };
        match text {
            "full" => Ok(Self::Full),
            "auto" => Ok(Self::Auto),
            "nonzero" => Ok(Self::NonZero),
            _ => window().ok_or_else(|| IntensityError { found: text.into() }),
        }
    }
}

impl fmt::Display for Intensity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Full => f.write_str("full"),
            Self::Auto => f.write_str("auto"),
            Self::Window { lo, hi } => write!(f, "{lo}..{hi}"),
            Self::NonZero => f.write_str("nonzero"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_written_as_they_are_read() {
        for text in ["full", "auto", "nonzero", "0..1", "-1000..3000.5", "-2..-1", "0.5..0.75"] {
            assert_eq!(text.parse::<Intensity>().unwrap().to_string(), text);
        }
        assert_eq!("1e3..2e3".parse(), Ok(Intensity::Window { lo: 1000.0, hi: 2000.0 }));
        for text in ["", "Full", "1..", "..", "2..1", "1..1", "nan..1", "0..inf", "1-2"] {
            assert!(text.parse::<Intensity>().is_err(), "{text}");
        }
    }
}
