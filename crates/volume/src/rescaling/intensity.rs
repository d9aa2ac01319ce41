//! The rule that maps samples to 256 levels, as it is requested and as it is recorded.

use std::fmt;
use std::str::FromStr;

/// How samples deeper than 8 bits become the 256 levels of a volume. Samples of `u8` are always taken as they are.
///
/// A sample `v` becomes `255 (v - lo) / (hi - lo)`, computed in `f64`, rounded half away from zero and clamped to
/// 0..=255. If `hi == lo`, every voxel is 0. The channels of colours share `lo` and `hi`. Integers of 64 bits are rounded
/// to the nearest `f64` first.
///
/// As text: `full`, `auto`, `nonzero`, or `LO..HI`.
///
/// ```
/// use hlacdb_volume::Intensity;
/// assert_eq!("-1000..3000".parse(), Ok(Intensity::Window { lo: -1000.0, hi: 3000.0 }));
/// assert_eq!(Intensity::Auto.to_string(), "auto");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum Intensity {
    /// From the lowest to the highest sample of the volume.
    #[default]
    Full,
    /// From the 0.1 to the 99.9 percentile of the volume's samples, by nearest rank: of `n` samples in ascending order
    /// (counted from 1) `lo` is number `ceil(n / 1000)` and `hi` is number `ceil(999 n / 1000)`; nothing is interpolated.
    Auto,
    /// From `lo` to `hi`, in the units of the file (after the [calibration](crate::Calibration) of its header).
    Window {
        /// The sample that becomes 0.
        lo: f64,
        /// The sample that becomes 255.
        hi: f64,
    },
    /// 0 where a sample is 0 in the units of the file, 255 elsewhere: for label masks, so that no label is lost however
    /// small or negative it is. `lo` and `hi` are recorded as 0.
    NonZero,
}

/// The rule that was applied, and the range it found: enough to compute samples back from levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mapping {
    /// The rule that was requested.
    pub rule: Intensity,
    /// The sample that became 0, in the units of the file.
    pub lo: f64,
    /// The sample that became 255, in the units of the file.
    pub hi: f64,
}

/// A text that is not an intensity rule.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{found}` is not an intensity rule: expected full, auto, nonzero, or LO..HI with two finite numbers, LO below HI"
)]
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
    fn rules_are_displayed_as_they_are_parsed() {
        for text in ["full", "auto", "nonzero", "0..1", "-1000..3000.5", "-2..-1", "0.5..0.75"] {
            assert_eq!(text.parse::<Intensity>().unwrap().to_string(), text);
        }
        assert_eq!("1e3..2e3".parse(), Ok(Intensity::Window { lo: 1000.0, hi: 2000.0 }));
        for text in ["", "Full", "1..", "..", "2..1", "1..1", "nan..1", "0..inf", "1-2"] {
            assert!(text.parse::<Intensity>().is_err(), "{text}");
        }
    }
}
