//! How files are read: the options that `ingest`, `query` and `extract` share.

use std::str::FromStr;

use clap::Args;
use hlacdb::volume::{Endian, Intensity, RawLayout, RawTypeError, ReadOptions, SampleType, Shape};

use super::values::whole;

/// How files are read.
#[derive(Args, Clone)]
#[command(next_help_heading = "Reading files")]
pub(crate) struct ReadArguments {
    /// How samples deeper than 8 bits become 256 levels: `full` (lowest to highest sample), `auto` (the 0.1 to 99.9
    /// percentile range), a window `LO..HI` or `nonzero` (0 stays 0, all else becomes 255); u8 is taken as it is
    #[arg(long, value_name = "RULE", default_value = "full", allow_hyphen_values = true)]
    intensity: Intensity,

    /// Refuse a file whose header promises more voxels than this
    #[arg(long, value_name = "N", default_value_t = ReadOptions::MAX_VOXELS, value_parser = whole::<u64>)]
    max_voxels: u64,

    /// Refuse a compressed file whose samples would take more bytes of memory than this, and more than 16 times its own
    #[arg(long, value_name = "BYTES", default_value_t = ReadOptions::MAX_INFLATED, value_parser = whole::<u64>)]
    max_inflated: u64,

    /// Files named .raw, .bin or .dat, and files of no known kind, are bare samples of this shape
    #[arg(long, value_name = "Z,Y,X", requires = "raw_type")]
    raw_shape: Option<RawShape>,

    /// ... of this type: u8, i8, or u16le, u16be, i16le, ..., f32le, f64be
    #[arg(long, value_name = "TYPE", requires = "raw_shape")]
    raw_type: Option<RawType>,

    /// ... after a header of so many bytes
    #[arg(long, value_name = "BYTES", default_value_t = 0, requires = "raw_shape", value_parser = whole::<u64>)]
    raw_offset: u64,
}

#[derive(Clone, Copy)]
struct RawShape(Shape);

impl FromStr for RawShape {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides: Result<Vec<usize>, _> = text.split(',').map(|side| side.trim().parse()).collect();
        let sides = sides.map_err(|_| format!("'{text}' is not three whole numbers Z,Y,X"))?;
        <Shape>::try_from(sides).map(Self).map_err(|_| format!("'{text}' is not three whole numbers Z,Y,X"))
    }
}

/// A type and byte order, e.g. `u16be`; the little one where it does not say.
#[derive(Clone, Copy)]
struct RawType(SampleType, Endian);

impl FromStr for RawType {
    type Err = RawTypeError;

    fn from_str(text: &str) -> Result<Self, RawTypeError> {
        RawLayout::parse_type(text).map(|(samples, endian)| Self(samples, endian))
    }
}

impl ReadArguments {
    /// The library's options.
    pub(crate) fn options(&self) -> ReadOptions {
        let options =
            ReadOptions::new().intensity(self.intensity).max_voxels(self.max_voxels).max_inflated(self.max_inflated);
        match (self.raw_shape, self.raw_type) {
            (Some(RawShape(shape)), Some(RawType(samples, endian))) => {
                options.raw(RawLayout::new(shape, samples, endian).offset(self.raw_offset))
            }
            _ => options,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_raw_shape_is_three_numbers() {
        assert!("1,2".parse::<RawShape>().is_err());
        assert!("1,2,x".parse::<RawShape>().is_err());
        assert!("4, 5,6".parse::<RawShape>().is_ok_and(|shape| shape.0 == [4, 5, 6]));
    }
}
