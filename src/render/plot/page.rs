//! The page of a plot: units, colours, text, and the head of the SVG document.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::RenderError;

/// The drawing area of a plot or of a part of it.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Units of the drawing library per pixel. It knows whole units only, so this keeps curves smooth.
const UNITS: i32 = 8;

/// The drawing library draws text smaller than requested by this factor.
const FONT_SCALE: f64 = 1.24;

/// A position or length in pixels, as units of the drawing library.
pub(super) fn px(pixels: f64) -> i32 {
    (pixels * f64::from(UNITS)).round() as i32
}

/// Text and important lines.
pub(super) const INK: RGBColor = RGBColor(0x22, 0x26, 0x2b);
/// Secondary text.
pub(super) const FAINT: RGBColor = RGBColor(0x5b, 0x63, 0x6d);
/// Grid lines.
pub(super) const GRID: RGBColor = RGBColor(0xe3, 0xe6, 0xea);

/// The colours of the spaces, in order; they repeat where there are more spaces.
const COLORS: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x44, 0x44, 0x44),
];

/// The colour of the n-th space.
pub(super) fn color(number: usize) -> RGBColor {
    COLORS[number % COLORS.len()]
}

/// Which end of a text is at its position. Vertically, texts are centred on it.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Left,
    Right,
    Centre,
}

/// A text style of this height in pixels.
pub(super) fn font(pixels: f64, color: RGBColor, anchor: Anchor) -> TextStyle<'static> {
    let across = match anchor {
        Anchor::Left => HPos::Left,
        Anchor::Right => HPos::Right,
        Anchor::Centre => HPos::Center,
    };
    let size = f64::from(px(pixels)) * FONT_SCALE;
    ("sans-serif", size).into_font().color(&color).pos(Pos::new(across, VPos::Center))
}

/// An error of the drawing library.
pub(super) fn plot_error(error: impl std::fmt::Display) -> RenderError {
    RenderError::Plot { message: error.to_string() }
}

/// Writes a text at a position in pixels.
pub(super) fn text(
    area: &Area<'_>,
    words: &str,
    at: (f64, f64),
    style: &TextStyle<'static>,
) -> Result<(), RenderError> {
    area.draw(&Text::new(printable(words), (px(at.0), px(at.1)), style.clone())).map_err(plot_error)
}

/// Fills a rectangle, given by its left top corner and its size in pixels.
pub(super) fn fill(
    area: &Area<'_>,
    at: (f64, f64),
    size: (f64, f64),
    color: impl Into<RGBAColor>,
) -> Result<(), RenderError> {
    let corners = [(px(at.0), px(at.1)), (px(at.0 + size.0), px(at.1 + size.1))];
    area.draw(&Rectangle::new(corners, color.into().filled())).map_err(plot_error)
}

/// Draws a line between two positions in pixels.
pub(super) fn line(
    area: &Area<'_>,
    from: (f64, f64),
    to: (f64, f64),
    color: RGBColor,
    width: f64,
) -> Result<(), RenderError> {
    let ends = vec![(px(from.0), px(from.1)), (px(to.0), px(to.1))];
    area.draw(&PathElement::new(ends, color.stroke_width(px(width).unsigned_abs()))).map_err(plot_error)
}

/// Draws a page of `size` pixels as an SVG document.
pub(super) fn draw(
    title: &str,
    description: &str,
    size: (u32, u32),
    on: impl FnOnce(&Area<'_>) -> Result<(), RenderError>,
) -> Result<String, RenderError> {
    let mut drawn = String::new();
    {
        let units = UNITS.unsigned_abs();
        let area = SVGBackend::with_string(&mut drawn, (size.0 * units, size.1 * units)).into_drawing_area();
        area.fill(&WHITE).map_err(plot_error)?;
        on(&area)?;
        area.present().map_err(plot_error)?;
    }
    // The library's own head lacks the size in pixels, the title and the description.
    let (_, body) = drawn.split_once('\n').ok_or_else(|| plot_error("the document has no head"))?;
    let (width, height) = size;
    let (title, description) = (escaped(title), escaped(description));
    Ok(format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" \
         height=\"{height}\" viewBox=\"0 0 {} {}\" role=\"img\" aria-labelledby=\"plot-title plot-description\">\n\
         <title id=\"plot-title\">{title}</title>\n<desc id=\"plot-description\">{description}</desc>\n{body}",
        width as i32 * UNITS,
        height as i32 * UNITS
    ))
}

/// The text on one line, with characters that XML forbids replaced.
fn printable(words: &str) -> String {
    words
        .chars()
        .map(|c| match c {
            '\t' | '\n' | '\r' => ' ',
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => '\u{fffd}',
            c => c,
        })
        .collect()
}

fn escaped(words: &str) -> String {
    printable(words).replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// A text of at most `max` characters: the middle of a longer one is replaced by an ellipsis.
pub(super) fn shortened(words: &str, max: usize) -> String {
    let length = words.chars().count();
    if length <= max {
        return words.to_owned();
    }
    let tail = max / 3;
    let head = max - tail - 1;
    let characters = || words.chars();
    characters().take(head).chain(std::iter::once('…')).chain(characters().skip(length - tail)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_shortened_in_the_middle() {
        assert_eq!(shortened("marble", 6), "marble");
        assert_eq!(shortened("a very long label", 9), "a ver…bel");
        assert_eq!(shortened("äöüäöüäöüäöü", 9).chars().count(), 9);
    }

    #[test]
    fn characters_that_xml_forbids_are_replaced() {
        assert_eq!(escaped("a<b>&\u{1}\n\u{ffff}"), "a&lt;b&gt;&amp;\u{fffd} \u{fffd}");
    }
}
