//! What a sheet is drawn on: pixels, frames and lines of text in the colours of its ground.

use std::convert::Infallible;

use embedded_graphics::Drawable;
use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::pixelcolor::{Rgb888, RgbColor};
use embedded_graphics::text::{Baseline, Text};
use image::{Rgb, RgbImage};

use super::Ground;
use super::text::Face;

/// The colours of a ground.
#[derive(Clone, Copy)]
pub(super) struct Colours {
    ground: [u8; 3],
    panel: [u8; 3],
    edge: [u8; 3],
    /// Between slices: no grey of a texture, and visible beside black and white.
    pub(super) seam: [u8; 3],
    text: [u8; 3],
    /// Text of less weight.
    aside: [u8; 3],
    /// The query's frame and label, and what is written on the label.
    accent: [u8; 3],
    on_accent: [u8; 3],
}

impl Colours {
    pub(super) fn of(ground: Ground) -> Self {
        match ground {
            Ground::Light => Self {
                ground: [0xeb; 3],
                panel: [0xfb; 3],
                edge: [0xcf; 3],
                seam: [0x8a, 0x9b, 0xb0],
                text: [0x1c; 3],
                aside: [0x5a; 3],
                accent: [0x0b, 0x5c, 0xad],
                on_accent: [0xff; 3],
            },
            Ground::Dark => Self {
                ground: [0x1b; 3],
                panel: [0x28; 3],
                edge: [0x42; 3],
                seam: [0x5c, 0x6e, 0x86],
                text: [0xf0; 3],
                aside: [0xb0; 3],
                accent: [0xf2, 0xa9, 0x3b],
                on_accent: [0x14; 3],
            },
        }
    }
}

/// Pixels of the query's frame.
const FRAME: u32 = 4;

/// A picture under way.
pub(super) struct Canvas {
    image: RgbImage,
    pub(super) colours: Colours,
}

impl Canvas {
    pub(super) fn new(width: u32, height: u32, colours: Colours) -> Self {
        Self { image: RgbImage::from_pixel(width, height, Rgb(colours.ground)), colours }
    }

    pub(super) fn into_image(self) -> RgbImage {
        self.image
    }

    /// Sets a pixel; those outside are left out.
    pub(super) fn pixel(&mut self, x: u32, y: u32, colour: [u8; 3]) {
        if let Some(pixel) = self.image.get_pixel_mut_checked(x, y) {
            *pixel = Rgb(colour);
        }
    }

    fn fill(&mut self, (left, top): (u32, u32), (width, height): (u32, u32), colour: [u8; 3]) {
        for y in top..top.saturating_add(height) {
            for x in left..left.saturating_add(width) {
                self.pixel(x, y, colour);
            }
        }
    }

    /// A panel's ground with its frame; the query's frame is thick and lies around the panel.
    pub(super) fn frame(&mut self, (left, top): (u32, u32), (width, height): (u32, u32), query: bool) {
        let Colours { panel, edge, accent, .. } = self.colours;
        if query {
            let around = (width + 2 * FRAME, height + 2 * FRAME);
            self.fill((left.saturating_sub(FRAME), top.saturating_sub(FRAME)), around, accent);
        } else {
            self.fill((left.saturating_sub(1), top.saturating_sub(1)), (width + 2, height + 2), edge);
        }
        self.fill((left, top), (width, height), panel);
    }

    /// A line of text whose upper left corner is at `place`, cut to `width` pixels.
    pub(super) fn text(&mut self, line: &str, place: (u32, u32), face: Face, width: u32, aside: bool) {
        let colour = if aside { self.colours.aside } else { self.colours.text };
        self.write(&face.fit(line, width), place, face, colour);
    }

    /// A word on a coloured field that ends at x; the pixels that it takes, its distance to the left included.
    pub(super) fn label(&mut self, word: &str, (right, top): (u32, u32), face: Face) -> u32 {
        let (accent, on_accent) = (self.colours.accent, self.colours.on_accent);
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
        let place = Point::new(i32::try_from(x).unwrap_or(i32::MAX), i32::try_from(y).unwrap_or(i32::MAX));
        let Ok(_) = Text::with_baseline(line, place, style, Baseline::Top).draw(self);
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.image.width(), self.image.height())
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(place, colour) in pixels {
            if let (Ok(x), Ok(y)) = (u32::try_from(place.x), u32::try_from(place.y)) {
                self.pixel(x, y, [colour.r(), colour.g(), colour.b()]);
            }
        }
        Ok(())
    }
}
