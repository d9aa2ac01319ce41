//! The page that plots are drawn on: sizes, colours, text, and the head of the SVG document.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::PlotError;

/// Where plots are drawn.
pub(super) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The drawing library knows whole pixels only: a pixel is so many of its units, so that curves are smooth.
const UNITS: i32 = 8;

/// The library draws text smaller than it is told, by this.
const FONT_SCALE: f64 = 1.24;

/// A place or a size in pixels, as units of the drawing library.
pub(super) fn px(pixels: f64) -> i32 {
    (pixels * f64::from(UNITS)).round() as i32
}

/// What is written and the lines that matter.
pub(super) const INK: RGBColor = RGBColor(0x22, 0x26, 0x2b);
/// What is written beside.
pub(super) const FAINT: RGBColor = RGBColor(0x5b, 0x63, 0x6d);
/// Lines that guide the eye.
pub(super) const GRID: RGBColor = RGBColor(0xe3, 0xe6, 0xea);

/// One for each space, in order, and again from the first where there are more.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0x00, 0x72, 0xb2),
    RGBColor(0xd5, 0x5e, 0x00),
    RGBColor(0x00, 0x9e, 0x73),
    RGBColor(0xcc, 0x79, 0xa7),
    RGBColor(0xe6, 0x9f, 0x00),
    RGBColor(0x56, 0xb4, 0xe9),
    RGBColor(0x44, 0x44, 0x44),
];

/// The colour of the n-th space.
pub(super) fn colour(number: usize) -> RGBColor {
    COLOURS[number % COLOURS.len()]
}

/// How a text stands to its place: beginning, ending or centred there; always centred up and down.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Stand {
    Left,
    Right,
    Centre,
}

/// The style of a text of so many pixels.
pub(super) fn font(pixels: f64, colour: RGBColor, stand: Stand) -> TextStyle<'static> {
    let across = match stand {
        Stand::Left => HPos::Left,
        Stand::Right => HPos::Right,
        Stand::Centre => HPos::Center,
    };
    let size = f64::from(px(pixels)) * FONT_SCALE;
    ("sans-serif", size).into_font().color(&colour).pos(Pos::new(across, VPos::Center))
}

/// The library's complaint as ours.
pub(super) fn refused(error: impl std::fmt::Display) -> PlotError {
    PlotError::Draw { why: error.to_string() }
}

/// Writes a text at a place in pixels.
pub(super) fn text(area: &Area<'_>, words: &str, at: (f64, f64), style: &TextStyle<'static>) -> Result<(), PlotError> {
    area.draw(&Text::new(printable(words), (px(at.0), px(at.1)), style.clone())).map_err(refused)
}

/// Fills a rectangle from a corner in pixels with a width and a height.
pub(super) fn fill(
    area: &Area<'_>,
    at: (f64, f64),
    size: (f64, f64),
    colour: impl Into<RGBAColor>,
) -> Result<(), PlotError> {
    let corners = [(px(at.0), px(at.1)), (px(at.0 + size.0), px(at.1 + size.1))];
    area.draw(&Rectangle::new(corners, colour.into().filled())).map_err(refused)
}

/// Draws a line from place to place, in pixels.
pub(super) fn line(
    area: &Area<'_>,
    from: (f64, f64),
    to: (f64, f64),
    colour: RGBColor,
    width: f64,
) -> Result<(), PlotError> {
    let ends = vec![(px(from.0), px(from.1)), (px(to.0), px(to.1))];
    area.draw(&PathElement::new(ends, colour.stroke_width(px(width).unsigned_abs()))).map_err(refused)
}

/// A page of `size` pixels, as an SVG document.
pub(super) fn draw(
    title: &str,
    description: &str,
    size: (u32, u32),
    on: impl FnOnce(&Area<'_>) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    let mut drawn = String::new();
    {
        let units = UNITS.unsigned_abs();
        let area = SVGBackend::with_string(&mut drawn, (size.0 * units, size.1 * units)).into_drawing_area();
        area.fill(&WHITE).map_err(refused)?;
        on(&area)?;
        area.present().map_err(refused)?;
    }
    // The library's own first line has neither size in pixels nor words for those who do not see the picture.
    let (_, body) = drawn.split_once('\n').ok_or_else(|| refused("the library's document has no head"))?;
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

/// What may stand in an XML document and be seen on one line: controls and the like become a replacement character.
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

/// A text of at most so many characters: a longer one loses its middle.
pub(super) fn shortened(words: &str, most: usize) -> String {
    let length = words.chars().count();
    if length <= most {
        return words.to_owned();
    }
    let tail = most / 3;
    let head = most - tail - 1;
    let characters = || words.chars();
    characters().take(head).chain(std::iter::once('…')).chain(characters().skip(length - tail)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_lose_their_middle() {
        assert_eq!(shortened("marble", 6), "marble");
        assert_eq!(shortened("a very long label", 9), "a ver…bel");
        assert_eq!(shortened("äöüäöüäöüäöü", 9).chars().count(), 9);
    }

    #[test]
    fn what_xml_cannot_hold_is_replaced() {
        assert_eq!(escaped("a<b>&\u{1}\n\u{ffff}"), "a&lt;b&gt;&amp;\u{fffd} \u{fffd}");
    }
}
