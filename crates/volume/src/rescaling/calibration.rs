//! [`Calibration`]: from stored samples to units.

/// A linear map from stored samples to the units of the file: `slope * stored + intercept`.
///
/// Invariant: the slope is finite and not zero, the intercept is finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibration {
    slope: f64,
    intercept: f64,
}

impl Calibration {
    /// Stored samples are in the units of the file.
    pub const IDENTITY: Self = Self { slope: 1.0, intercept: 0.0 };

    /// The map by these numbers; `None` if they do not make an invertible linear map.
    pub fn new(slope: f64, intercept: f64) -> Option<Self> {
        (slope.is_finite() && slope != 0.0 && intercept.is_finite()).then_some(Self { slope, intercept })
    }

    /// Units per stored unit.
    pub fn slope(self) -> f64 {
        self.slope
    }

    /// The unit value of a stored 0.
    pub fn intercept(self) -> f64 {
        self.intercept
    }

    /// The units of a stored sample.
    pub(super) fn unit(self, stored: f64) -> f64 {
        self.slope * stored + self.intercept
    }

    /// The stored sample of some units.
    pub(super) fn stored(self, unit: f64) -> f64 {
        (unit - self.intercept) / self.slope
    }
}

impl Default for Calibration {
    fn default() -> Self {
        Self::IDENTITY
    }
}
