//! What microscopes write into the description of the first page: OME-XML.
//!
//! Only three questions are asked of it: whether the pages are the slices of one volume, how far apart they are, and how
//! far apart pixels are. So no XML is parsed: the attributes of the first `Pixels` element are found by their names.

/// The first `Pixels` element of an OME description.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pixels {
    /// Images in the file, each with pixels of its own.
    pub(super) images: usize,
    /// Colour channels, the samples of RGB pages counted singly.
    pub(super) channels: u64,
    /// Slices of one moment.
    pub(super) slices: u64,
    /// Moments in time.
    pub(super) frames: u64,
    /// The physical size of a voxel (Z, Y, X); `None` where one is missing or none.
    pub(super) spacing: Option<[f64; 3]>,
}

impl Pixels {
    /// The pixels that a text describes; `None` where it is not OME-XML.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (_, ome) = text.split_once("<OME ")?;
        let (_, pixels) = ome.split_once("<Pixels ")?;
        let (pixels, _) = pixels.split_once('>')?;
        let attribute = |name: &str| {
            let (_, value) = pixels.split_once(&format!("{name}=\""))?;
            Some(value.split_once('"')?.0)
        };
        let count = |name| attribute(name).and_then(|value| value.parse().ok()).unwrap_or(1).max(1);
        let size = |name| attribute(name)?.parse().ok().filter(|&size: &f64| size.is_finite() && size > 0.0);
        let sizes = || Some([size("PhysicalSizeZ")?, size("PhysicalSizeY")?, size("PhysicalSizeX")?]);
        Some(Self {
            images: ome.matches("<Image ").count(),
            channels: count("SizeC"),
            slices: count("SizeZ"),
            frames: count("SizeT"),
            spacing: sizes(),
        })
    }

    /// Whether pages of so many samples per pixel are more than the slices of one volume.
    pub(super) fn is_hyperstack(&self, samples: usize) -> bool {
        let channels = self.channels > 1 && self.channels != samples as u64;
        self.images > 1 || channels || self.frames > 1 && self.slices > 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_pixels_element_is_asked() {
        let text = r#"<?xml version="1.0"?><OME xmlns="x"><Image ID="Image:0"><Pixels ID="Pixels:0" SizeX="9" SizeY="7"
            SizeZ="5" SizeC="1" SizeT="1" PhysicalSizeX="0.5" PhysicalSizeY="0.25" PhysicalSizeZ="3.0"><Channel/>"#;
        let pixels = Pixels::parse(text).unwrap();
        let spacing = Some([3.0, 0.25, 0.5]);
        assert_eq!(pixels, Pixels { images: 1, channels: 1, slices: 5, frames: 1, spacing });
        assert!(!pixels.is_hyperstack(1));
        assert_eq!(Pixels::parse("<Pixels SizeC=\"2\">"), None);
        assert_eq!(Pixels::parse("<OME >"), None);
    }

    #[test]
    fn channels_moments_and_further_images_are_told() {
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
