//! The description that ImageJ writes for the first page of a stack.
//!
//! Stacks of more than 4 GiB do not fit the offsets of a TIFF file. ImageJ and others write them with a single directory:
//! the description says `images=N`, and the other planes follow the first one without a gap.

use crate::LengthUnit;

/// What the lines of a description say.
#[cfg_attr(not(feature = "tiff"), allow(dead_code))]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Description {
    /// Planes in the file.
    pub(super) images: u64,
    /// Planes that are colour channels of one slice.
    pub(super) channels: u64,
    /// Slices of one time point.
    pub(super) slices: u64,
    /// Time points.
    pub(super) frames: u64,
    /// The distance between slices, in the unit of the resolution tags.
    pub(super) spacing: Option<f64>,
    /// The unit of the resolution tags.
    pub(super) unit: Option<LengthUnit>,
}

impl Description {
    /// The description in a text; `None` if it is not ImageJ's.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        lines.next().filter(|line| line.starts_with("ImageJ="))?;
        let mut description = Self { images: 1, channels: 1, slices: 1, frames: 1, spacing: None, unit: None };
        for (key, value) in lines.filter_map(|line| line.split_once('=')) {
            let number = || value.trim().parse::<u64>().unwrap_or(1).max(1);
            match key.trim() {
                "images" => description.images = number(),
                "channels" => description.channels = number(),
                "slices" => description.slices = number(),
                "frames" => description.frames = number(),
                "unit" => description.unit = LengthUnit::from_name(value),
                "spacing" => {
                    description.spacing = value.trim().parse().ok().filter(|&s: &f64| s.is_finite() && s > 0.0);
                }
                _ => {}
            }
        }
        Some(description)
    }

    /// Whether the planes are more than the slices of one volume. (A stack whose slices are called frames is one volume.)
    #[cfg(feature = "tiff")]
    pub(super) fn is_hyperstack(&self) -> bool {
        self.channels > 1 || self.frames > 1 && self.slices > 1
    }
}

#[cfg(feature = "tiff")]
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_whatever_their_order() {
        let text = "ImageJ=1.54f\nunit=micron\nspacing=2.5\nslices=30\nimages=30\nloop=false\n";
        let unit = Some(LengthUnit::Micrometer);
        let expected = Description { images: 30, channels: 1, slices: 30, frames: 1, spacing: Some(2.5), unit };
        assert_eq!(Description::parse(text), Some(expected));
        assert!(!expected.is_hyperstack());
        assert_eq!(Description::parse("unit=micron\nImageJ=1.54f"), None);
        assert_eq!(Description::parse(""), None);
    }

    #[test]
    fn other_values_count_as_one_and_hyperstacks_are_recognised() {
        let hyper = Description::parse("ImageJ=\nimages=-3\nchannels=2\nspacing=nan").unwrap();
        assert_eq!((hyper.images, hyper.spacing, hyper.is_hyperstack()), (1, None, true));
        assert!(!Description::parse("ImageJ=1\nimages=9\nframes=9").unwrap().is_hyperstack());
        assert!(Description::parse("ImageJ=1\nimages=9\nframes=3\nslices=3").unwrap().is_hyperstack());
    }
}
