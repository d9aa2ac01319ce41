//! The axis that slices are taken across.

use std::fmt;
use std::str::FromStr;

use crate::volume::Shape;

/// The axis that slices are taken across.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum SliceAxis {
    /// A slice shows Y downwards and X to the right.
    #[default]
    Z,
    /// A slice shows Z downwards and X to the right.
    Y,
    /// A slice shows Z downwards and Y to the right.
    X,
}

impl SliceAxis {
    /// The number of slices of a volume of this shape (Z, Y, X).
    pub fn slices(self, [z, y, x]: Shape) -> usize {
        match self {
            Self::Z => z,
            Self::Y => y,
            Self::X => x,
        }
    }

    /// Rows and columns of one slice, in voxels.
    pub fn slice_shape(self, [z, y, x]: Shape) -> [usize; 2] {
        match self {
            Self::Z => [y, x],
            Self::Y => [z, x],
            Self::X => [z, y],
        }
    }
}

impl fmt::Display for SliceAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Z => "Z",
            Self::Y => "Y",
            Self::X => "X",
        })
    }
}

/// The text names no axis.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown axis '{found}': expected z, y or x")]
pub struct ParseSliceAxisError {
    /// The text.
    pub found: String,
}

impl FromStr for SliceAxis {
    type Err = ParseSliceAxisError;

    /// `z`, `y` or `x`, in either case.
    fn from_str(text: &str) -> Result<Self, ParseSliceAxisError> {
        match text {
            "Z" | "z" => Ok(Self::Z),
            "Y" | "y" => Ok(Self::Y),
            "X" | "x" => Ok(Self::X),
            _ => Err(ParseSliceAxisError { found: text.into() }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_read_in_either_case() {
        assert_eq!(["z", "Y", "x"].map(|text| text.parse()), [Ok(SliceAxis::Z), Ok(SliceAxis::Y), Ok(SliceAxis::X)]);
        assert!("w".parse::<SliceAxis>().unwrap_err().to_string().contains("'w'"));
    }
}
