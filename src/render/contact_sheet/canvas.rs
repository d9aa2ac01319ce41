//! The surface that a contact sheet is drawn on: frames, slices and lines of text in the colours of a theme.

use std::convert::Infallible;

use embedded_graphics::Drawable;
use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::text::{Baseline, Text};

use super::super::slice_grid::SliceGrid;
use super::super::{Image, PixelFormat};
use super::text::Face;
use super::theme::{SEAM, Theme};
use crate::volume::Volume;

/// The colours of a theme.
#[derive(Clone, Copy)]
pub(super) struct Colors {
    background: [u8; 3],
    panel: [u8; 3],
    edge: [u8; 3],
    /// Between slices: not a grey, so that it differs from every texture, and visible beside black and white.
    seam: [u8; 3],
    text: [u8; 3],
    /// Secondary text.
    faint: [u8; 3],
    /// The query's frame and label, and the text on the label.
    accent: [u8; 3],
    on_accent: [u8; 3],
}

impl Colors {
    pub(super) fn of(theme: Theme) -> Self {
        match theme {
            Theme::Light => Self {
                background: [0xeb; 3],
                panel: [0xfb; 3],
                edge: [0xcf; 3],
                seam: [0x8a, 0x9b, 0xb0],
                text: [0x1c; 3],
                faint: [0x5a; 3],
                accent: [0x0b, 0x5c, 0xad],
                on_accent: [0xff; 3],
            },
            Theme::Dark => Self {
                background: [0x1b; 3],
                panel: [0x28; 3],
                edge: [0x42; 3],
                seam: [0x5c, 0x6e, 0x86],
                text: [0xf0; 3],
                faint: [0xb0; 3],
                accent: [0xf2, 0xa9, 0x3b],
                on_accent: [0x14; 3],
            },
        }
    }
}

/// Pixels of the query's frame.
const FRAME: u32 = 4;

/// A contact sheet that is being drawn.
pub(super) struct Canvas {
    image: Image,
    colors: Colors,
}

impl Canvas {
    pub(super) fn new(width: u32, height: u32, colors: Colors) -> Self {
        let pixels = colors.background.repeat(width as usize * height as usize);
        Self { image: Image::new(width, height, PixelFormat::Rgb, pixels), colors }
    }

    pub(super) fn into_image(self) -> Image {
        self.image
    }

    /// Sets a pixel; pixels outside the canvas are ignored.
    fn pixel(&mut self, x: u32, y: u32, color: [u8; 3]) {
        if let Some(pixel) = self.image.pixel_mut(x, y) {
            pixel.copy_from_slice(&color);
        }
    }

    fn fill(&mut self, (left, top): (u32, u32), (width, height): (u32, u32), color: [u8; 3]) {
        for y in top..top.saturating_add(height) {
            for x in left..left.saturating_add(width) {
                self.pixel(x, y, color);
            }
        }
    }

    /// Draws the slices of a volume with a seam around each; the grid's left top corner is at `corner`.
    pub(super) fn slices(&mut self, (left, top): (u32, u32), grid: &SliceGrid, volume: &Volume) {
        let (width, height) = grid.slice_size();
        let (width, height, channels) = (width as u32, height as u32, volume.channels());
        for number in 0..grid.count() {
            let (x, y) = grid.position(number);
            let (left, top) = (left + x as u32, top + y as u32);
            self.fill((left - SEAM, top - SEAM), (width + 2 * SEAM, height + 2 * SEAM), self.colors.seam);
            let pixels = grid.pixels(volume, number);
            let positions = (0..height).flat_map(|y| (0..width).map(move |x| (left + x, top + y)));
            for ((x, y), voxel) in positions.zip(pixels.chunks_exact(channels)) {
                self.pixel(x, y, if let &[red, green, blue] = voxel { [red, green, blue] } else { [voxel[0]; 3] });
            }
        }
    }

    /// Draws a panel's background with its frame; the query's frame is thick and lies around the panel.
    pub(super) fn frame(&mut self, (left, top): (u32, u32), (width, height): (u32, u32), query: bool) {
        let Colors { panel, edge, accent, .. } = self.colors;
        if query {
            let around = (width + 2 * FRAME, height + 2 * FRAME);
            self.fill((left.saturating_sub(FRAME), top.saturating_sub(FRAME)), around, accent);
        } else {
            self.fill((left.saturating_sub(1), top.saturating_sub(1)), (width + 2, height + 2), edge);
        }
        self.fill((left, top), (width, height), panel);
    }

    /// Writes a line of text with its left top corner at `corner`, shortened to `width` pixels.
    pub(super) fn text(&mut self, line: &str, corner: (u32, u32), face: Face, width: u32, faint: bool) {
        let color = if faint { self.colors.faint } else { self.colors.text };
        self.write(&face.fit(line, width), corner, face, color);
    }

    /// Writes a word on a coloured field that ends at `right`. Returns the width of the field and of the space before it.
    pub(super) fn label(&mut self, word: &str, (right, top): (u32, u32), face: Face) -> u32 {
        let (accent, on_accent) = (self.colors.accent, self.colors.on_accent);
        let bold = face.bold();
        let space = bold.width(1);
        let width = bold.width(word.len()) + space;
        let left = right.saturating_sub(width);
        self.fill((left, top), (width, face.line() - 1), accent);
        self.write(word, (left + space / 2, top), bold, on_accent);
        width + space
    }

    fn write(&mut self, line: &str, (x, y): (u32, u32), face: Face, [r, g, b]: [u8; 3]) {
        let style = MonoTextStyle::new(face.font(), Rgb888::new(r, g, b));
        let corner = Point::new(i32::try_from(x).unwrap_or(i32::MAX), i32::try_from(y).unwrap_or(i32::MAX));
        let Ok(_) = Text::with_baseline(line, corner, style, Baseline::Top).draw(self);
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        let (width, height) = self.image.size();
        Size::new(width, height)
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(point, color) in pixels {
            if let (Ok(x), Ok(y)) = (u32::try_from(point.x), u32::try_from(point.y)) {
                self.pixel(x, y, [color.r(), color.g(), color.b()]);
            }
        }
        Ok(())
    }
}
