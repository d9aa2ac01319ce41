//! Pixels in memory, and their PNG file.

use std::fs;
use std::path::Path;

use ::image::codecs::png::{CompressionType, FilterType, PngEncoder};
use ::image::{ExtendedColorType, ImageEncoder};

use super::RenderError;

/// What the bytes of a pixel mean. Every sample is 8 bits; alpha is 0 (transparent) or 255.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PixelFormat {
    /// One grey level.
    Gray,
    /// A grey level and alpha.
    GrayAlpha,
    /// Red, green and blue.
    Rgb,
    /// Red, green, blue and alpha.
    RgbAlpha,
}

impl PixelFormat {
    /// The format for a volume's channels (1 or 3), with or without alpha.
    pub(super) fn new(channels: usize, alpha: bool) -> Self {
        match (channels, alpha) {
            (1, false) => Self::Gray,
            (1, true) => Self::GrayAlpha,
            (_, false) => Self::Rgb,
            (_, true) => Self::RgbAlpha,
        }
    }

    /// Bytes per pixel.
    pub fn bytes(self) -> usize {
        match self {
            Self::Gray => 1,
            Self::GrayAlpha => 2,
            Self::Rgb => 3,
            Self::RgbAlpha => 4,
        }
    }
}

/// How much time the PNG encoder spends on a small file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PngEffort {
    /// Fast: for pictures that are shown once.
    Fast,
    /// Small: for pictures that are kept.
    #[default]
    Small,
}

/// A picture in memory: pixels row by row from the top left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: u32,
    height: u32,
    format: PixelFormat,
    pixels: Vec<u8>,
}

impl Image {
    /// `pixels` holds `width * height` pixels of `format`.
    pub(super) fn new(width: u32, height: u32, format: PixelFormat, pixels: Vec<u8>) -> Self {
        debug_assert_eq!(pixels.len(), width as usize * height as usize * format.bytes());
        Self { width, height, format, pixels }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// What the bytes of a pixel mean.
    pub fn format(&self) -> PixelFormat {
        self.format
    }

    /// The pixels, row by row from the top left.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }

    /// The bytes of one pixel; `None` outside the picture.
    pub(super) fn pixel_mut(&mut self, x: u32, y: u32) -> Option<&mut [u8]> {
        if x >= self.width {
            return None;
        }
        let start = (y as usize * self.width as usize + x as usize) * self.format.bytes();
        self.pixels.get_mut(start..start + self.format.bytes())
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// [`RenderError::Encode`].
    pub fn encode_png(&self, effort: PngEffort) -> Result<Vec<u8>, RenderError> {
        let (compression, filter) = match effort {
            PngEffort::Fast => (CompressionType::Fast, FilterType::Up),
            PngEffort::Small => (CompressionType::Default, FilterType::Adaptive),
        };
        let color = match self.format {
            PixelFormat::Gray => ExtendedColorType::L8,
            PixelFormat::GrayAlpha => ExtendedColorType::La8,
            PixelFormat::Rgb => ExtendedColorType::Rgb8,
            PixelFormat::RgbAlpha => ExtendedColorType::Rgba8,
        };
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, compression, filter)
            .write_image(&self.pixels, self.width, self.height, color)
            .map_err(RenderError::encode)?;
        Ok(bytes)
    }

    /// Writes the picture as a small PNG file, whatever the extension of `path`; an existing file is replaced.
    ///
    /// # Errors
    /// [`RenderError::Encode`], [`RenderError::Write`].
    pub fn write_png(&self, path: &Path) -> Result<(), RenderError> {
        fs::write(path, self.encode_png(PngEffort::Small)?).map_err(|source| RenderError::write(path, source))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_survives_png() {
        for format in [PixelFormat::Gray, PixelFormat::GrayAlpha, PixelFormat::Rgb, PixelFormat::RgbAlpha] {
            let pixels: Vec<u8> = (0..6 * format.bytes()).map(|byte| (byte * 10) as u8).collect();
            let image = Image::new(3, 2, format, pixels.clone());
            for effort in [PngEffort::Fast, PngEffort::Small] {
                let decoded = ::image::load_from_memory(&image.encode_png(effort).unwrap()).unwrap();
                assert_eq!((decoded.width(), decoded.height(), decoded.as_bytes()), (3, 2, &pixels[..]));
            }
        }
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let image = Image::new(1, 1, PixelFormat::Gray, vec![7]);
        let path = folder.path().join("image.png");
        image.write_png(&path).unwrap();
        assert_eq!(::image::open(&path).unwrap().as_bytes(), [7]);
        let error = image.write_png(&folder.path().join("none/image.png")).unwrap_err();
        assert!(error.to_string().contains("none/image.png") && std::error::Error::source(&error).is_some());
    }
}
