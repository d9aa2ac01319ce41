//! [`LevelMap`]: from one sample to its level.

use super::calibration::Calibration;

/// The map from stored samples to levels.
pub(super) enum LevelMap {
    /// `lo` becomes 0, `hi` becomes 255 (`hi` may be the lower one).
    Line {
        lo: f64,
        range: f64,
        /// 1, or less where the difference of samples, times 255, would leave the range of `f64`.
        shrink: f64,
    },
    /// A sample that is 0 in the units of the file becomes 0, every other one 255.
    NonZero(Calibration),
}

impl LevelMap {
    /// The line from `lo` (0) to `hi` (255).
    pub(super) fn line(lo: f64, hi: f64) -> Self {
        let shrink = if (255.0 * (hi - lo)).is_finite() { 1.0 } else { 1.0 / 1024.0 };
        Self::Line { lo: lo * shrink, range: hi * shrink - lo * shrink, shrink }
    }

    /// The level of a stored sample.
    pub(super) fn of(&self, sample: f64) -> u8 {
        match *self {
            Self::NonZero(calibration) => {
                if calibration.unit(sample) == 0.0 {
                    0
                } else {
                    255
                }
            }
            Self::Line { range: 0.0, .. } => 0,
            Self::Line { lo, range, shrink } => {
                let level = (255.0 * (sample * shrink - lo) / range).clamp(0.0, 255.0);
                // As `round`, which baseline x86-64 makes a function call; both steps are exact from 0 to 255.
                let whole = level as u8;
                whole + u8::from(level - f64::from(whole) >= 0.5)
            }
        }
    }
}
