//! [`VoxelSpacing`]: the distance between voxels.

use std::fmt;

/// The distance between neighbouring voxels, as a file gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct VoxelSpacing {
    /// The distances along (Z, Y, X), each finite and above 0.
    pub zyx: [f64; 3],
    /// Their unit; `None` if the file does not name one that is known.
    pub unit: Option<LengthUnit>,
}

impl VoxelSpacing {
    /// The spacing by these distances along (Z, Y, X); `None` unless each is finite and above 0.
    pub fn new(zyx: [f64; 3]) -> Option<Self> {
        zyx.iter().all(|step| step.is_finite() && *step > 0.0).then_some(Self { zyx, unit: None })
    }

    /// The same distances in a unit.
    #[must_use]
    pub fn unit(self, unit: Option<LengthUnit>) -> Self {
        Self { unit, ..self }
    }
}

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum LengthUnit {
    /// Metres.
    Meter,
    /// Centimetres.
    Centimeter,
    /// Millimetres.
    Millimeter,
    /// Micrometres.
    Micrometer,
    /// Nanometres.
    Nanometer,
    /// Inches.
    Inch,
}

impl LengthUnit {
    /// The symbol: `m`, `cm`, `mm`, `um`, `nm`, `in`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Meter => "m",
            Self::Centimeter => "cm",
            Self::Millimeter => "mm",
            Self::Micrometer => "um",
            Self::Nanometer => "nm",
            Self::Inch => "in",
        }
    }

    /// The unit that a file calls by a symbol or a name, such as `mm`, `µm`, `micron` or `inch`.
    ///
    /// ```
    /// use hlacdb_volume::LengthUnit;
    /// assert_eq!(LengthUnit::from_name("µm"), Some(LengthUnit::Micrometer));
    /// assert_eq!(LengthUnit::from_name("pixel"), None);
    /// ```
    pub fn from_name(name: &str) -> Option<Self> {
        Some(match name.trim() {
            "m" | "meter" | "metre" | "meters" => Self::Meter,
            "cm" | "centimeter" | "centimetre" | "centimeters" => Self::Centimeter,
            "mm" | "millimeter" | "millimetre" | "millimeters" => Self::Millimeter,
            // The micro sign, the Greek letter, and the escape that ImageJ writes.
            "um" | "\u{b5}m" | "\u{3bc}m" | "\\u00B5m" | "micron" | "microns" | "micrometer" | "micrometre" => {
                Self::Micrometer
            }
            "nm" | "nanometer" | "nanometre" | "nanometers" => Self::Nanometer,
            "in" | "inch" | "inches" => Self::Inch,
            _ => return None,
        })
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_found_by_their_symbols() {
        use LengthUnit::{Centimeter, Inch, Meter, Micrometer, Millimeter, Nanometer};
        for unit in [Meter, Centimeter, Millimeter, Micrometer, Nanometer, Inch] {
            assert_eq!(LengthUnit::from_name(unit.symbol()), Some(unit));
        }
        assert_eq!(LengthUnit::from_name("furlong"), None);
    }

    #[test]
    fn distances_are_finite_and_positive() {
        assert!(VoxelSpacing::new([2.0, 0.75, 0.5]).is_some());
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(VoxelSpacing::new([1.0, bad, 1.0]), None);
        }
    }
}
