//! A panel of bars: one row a class, one column a space.

use super::PlotError;
use super::page::{Area, FAINT, GRID, INK, Stand, colour, fill, font, shortened, text};

/// So many classes are shown at most.
pub(super) const MOST_ROWS: usize = 60;

/// Heights of the heading and of a row, in pixels.
const HEADING: f64 = 52.0;
const ROW: f64 = 16.0;

/// The width of the classes' names, and of the number beside a bar.
const NAMES: f64 = 176.0;
const NUMBER: f64 = 34.0;

/// The table of bars: values in [0, 1].
pub(super) struct Bars<'a> {
    pub(super) title: String,
    /// Names of the columns.
    pub(super) spaces: Vec<&'a str>,
    /// A class and its value in each space.
    pub(super) rows: Vec<(&'a str, Vec<f64>)>,
}

impl Bars<'_> {
    /// How high the panel is, in pixels.
    pub(super) fn height(&self) -> f64 {
        HEADING + ROW * self.rows.len() as f64 + 12.0
    }

    /// Draws the panel, `width` pixels wide.
    pub(super) fn draw(&self, area: &Area<'_>, width: f64) -> Result<(), PlotError> {
        text(area, &self.title, (16.0, 12.0), &font(13.0, INK, Stand::Left))?;
        let column = (width - 16.0 - NAMES) / self.spaces.len().max(1) as f64;
        let left = |number: usize| NAMES + column * number as f64;
        let letters = ((column - 8.0) / 7.0).max(3.0) as usize;
        for (number, space) in self.spaces.iter().enumerate() {
            text(area, &shortened(space, letters), (left(number), 38.0), &font(12.0, INK, Stand::Left))?;
        }
        for (row, (class, values)) in self.rows.iter().enumerate() {
            let middle = HEADING + ROW * (row as f64 + 0.5);
            let name = shortened(class, 26);
            text(area, &name, (NAMES - 10.0, middle), &font(11.0, INK, Stand::Right))?;
            for (number, &value) in values.iter().enumerate() {
                let track = (column - NUMBER - 12.0).max(4.0);
                let corner = (left(number), middle - 4.5);
                fill(area, corner, (track, 9.0), GRID)?;
                fill(area, corner, (track * value.clamp(0.0, 1.0), 9.0), colour(number))?;
                let at = (left(number) + track + 5.0, middle);
                text(area, &format!("{value:.2}"), at, &font(10.5, FAINT, Stand::Left))?;
            }
        }
        Ok(())
    }
}
