//! The description that microscopes write for the first page: OME-XML.
//!
//! Only two things are needed of it: whether the pages are the slices of one volume, and the size of a voxel. So the XML
//! is not parsed: the attributes of the first `Pixels` element are found by their names.
//!
//! Format: <https://docs.openmicroscopy.org/ome-model/latest/ome-tiff/>

use crate::{LengthUnit, VoxelSpacing};

/// The first `Pixels` element of an OME description.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pixels {
    /// Images in the file, each with pixels of its own.
    pub(super) images: usize,
    /// Colour channels; the samples of an RGB page count as three.
    pub(super) channels: u64,
    /// Slices of one time point.
    pub(super) slices: u64,
    /// Time points.
    pub(super) frames: u64,
    /// The size of a voxel; `None` if it is not given for all axes.
    pub(super) spacing: Option<VoxelSpacing>,
}

impl Pixels {
    /// The pixels that a text describes; `None` if it is not OME-XML.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (_, ome) = text.split_once("<OME ")?;
        let (_, pixels) = ome.split_once("<Pixels ")?;
        let (pixels, _) = pixels.split_once('>')?;
        let attribute = |name: &str| {
            let (_, value) = pixels.split_once(&format!("{name}=\""))?;
            Some(value.split_once('"')?.0)
        };
        let count = |name| attribute(name).and_then(|value| value.parse().ok()).unwrap_or(1).max(1);
        let size = |name| attribute(name)?.parse::<f64>().ok();
        // The schema's default is the micrometre.
        let unit = |name| attribute(name).map_or(Some(LengthUnit::Micrometer), LengthUnit::from_name);
        let units = ["PhysicalSizeZUnit", "PhysicalSizeYUnit", "PhysicalSizeXUnit"].map(unit);
        let unit = units[0].filter(|_| units[1..].iter().all(|unit| *unit == units[0]));
        let sizes = || VoxelSpacing::new([size("PhysicalSizeZ")?, size("PhysicalSizeY")?, size("PhysicalSizeX")?]);
        Some(Self {
            images: ome.matches("<Image ").count(),
            channels: count("SizeC"),
            slices: count("SizeZ"),
            frames: count("SizeT"),
            spacing: sizes().map(|spacing| spacing.unit(unit)),
        })
    }

    /// Whether pages of `samples` samples per pixel are more than the slices of one volume.
    pub(super) fn is_hyperstack(&self, samples: usize) -> bool {
        let channels = self.channels > 1 && self.channels != samples as u64;
        self.images > 1 || channels || self.frames > 1 && self.slices > 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_pixels_element_is_used() {
        let text = r#"<?xml version="1.0"?><OME xmlns="x"><Image ID="Image:0"><Pixels ID="Pixels:0" SizeX="9" SizeY="7"
            SizeZ="5" SizeC="1" SizeT="1" PhysicalSizeX="0.5" PhysicalSizeY="0.25" PhysicalSizeZ="3.0"><Channel/>"#;
        let pixels = Pixels::parse(text).unwrap();
        let spacing = VoxelSpacing::new([3.0, 0.25, 0.5]).map(|spacing| spacing.unit(Some(LengthUnit::Micrometer)));
        assert_eq!(pixels, Pixels { images: 1, channels: 1, slices: 5, frames: 1, spacing });
        assert!(!pixels.is_hyperstack(1));
        assert_eq!(Pixels::parse("<Pixels SizeC=\"2\">"), None);
        assert_eq!(Pixels::parse("<OME >"), None);
    }

    #[test]
    fn channels_time_points_and_further_images_are_recognised() {
        let pixels = |attributes: &str| Pixels::parse(&format!("<OME ><Image ><Pixels {attributes}>")).unwrap();
        assert!(pixels(r#"SizeC="2" SizeZ="5""#).is_hyperstack(1));
        assert!(pixels(r#"SizeC="3" SizeZ="5""#).is_hyperstack(1));
        assert!(!pixels(r#"SizeC="3" SizeZ="5""#).is_hyperstack(3));
        assert!(pixels(r#"SizeT="2" SizeZ="5""#).is_hyperstack(1));
        assert!(!pixels(r#"SizeT="5""#).is_hyperstack(1));
        assert!(pixels(r#"SizeZ="5"/><Pixels "#).spacing.is_none());
        assert!(Pixels::parse("<OME ><Image ><Pixels SizeZ=\"3\"></Image><Image >").unwrap().is_hyperstack(1));
    }
}
