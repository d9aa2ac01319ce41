//! A panel of bars: one row per class, one column per space.

use super::RenderError;
use super::page::{Anchor, Area, FAINT, GRID, INK, color, fill, font, shortened, text};

/// The most rows of the panel.
pub(super) const MAX_ROWS: usize = 60;

/// The height of the heading and of a row, in pixels.
const HEADING: f64 = 52.0;
const ROW: f64 = 16.0;

/// The width of the class names and of the number beside a bar, in pixels.
const NAMES: f64 = 176.0;
const NUMBER: f64 = 34.0;

/// A table of bars with values from 0 to 1.
pub(super) struct Bars<'a> {
    pub(super) title: String,
    /// The names of the columns.
    pub(super) spaces: Vec<&'a str>,
    /// Each class with its value in every space.
    pub(super) rows: Vec<(&'a str, Vec<f64>)>,
}

impl Bars<'_> {
    /// The height of the panel, in pixels.
    pub(super) fn height(&self) -> f64 {
        HEADING + ROW * self.rows.len() as f64 + 12.0
    }

    /// Draws the panel, `width` pixels wide.
    pub(super) fn draw(&self, area: &Area<'_>, width: f64) -> Result<(), RenderError> {
        text(area, &self.title, (16.0, 12.0), &font(13.0, INK, Anchor::Left))?;
        let column = (width - 16.0 - NAMES) / self.spaces.len().max(1) as f64;
        let left = |number: usize| NAMES + column * number as f64;
        let letters = ((column - 8.0) / 7.0).max(3.0) as usize;
        for (number, space) in self.spaces.iter().enumerate() {
            text(area, &shortened(space, letters), (left(number), 38.0), &font(12.0, INK, Anchor::Left))?;
        }
        for (row, (class, values)) in self.rows.iter().enumerate() {
            let middle = HEADING + ROW * (row as f64 + 0.5);
            let name = shortened(class, 26);
            text(area, &name, (NAMES - 10.0, middle), &font(11.0, INK, Anchor::Right))?;
            for (number, &value) in values.iter().enumerate() {
                let track = (column - NUMBER - 12.0).max(4.0);
                let corner = (left(number), middle - 4.5);
                fill(area, corner, (track, 9.0), GRID)?;
                fill(area, corner, (track * value.clamp(0.0, 1.0), 9.0), color(number))?;
                let at = (left(number) + track + 5.0, middle);
                text(area, &format!("{value:.2}"), at, &font(10.5, FAINT, Anchor::Left))?;
            }
        }
        Ok(())
    }
}
