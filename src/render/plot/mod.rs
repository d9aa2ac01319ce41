//! Plots as SVG, drawn from reports: retrieval measures of [`eval`](crate::eval), and the statistics of a store.
//!
//! A plot is a valid XML document on a white background with a title and a description for screen readers. Fonts are not
//! read or embedded: text is laid out by an estimate and drawn in the viewer's sans-serif typeface. Colours are told apart
//! by colour-blind readers too (the palette of Okabe and Ito), and curves also carry marks of different shapes.

mod bars;
mod curves;
mod page;
mod retrieval;
mod statistics;

#[cfg(test)]
mod tests;

use std::fs;
use std::path::Path;

use super::RenderError;

pub use retrieval::evaluation_plot;
pub use statistics::statistics_plot;

/// Writes a plot; an existing file is replaced.
///
/// # Errors
/// [`RenderError::Write`].
pub fn write_svg(path: &Path, svg: &str) -> Result<(), RenderError> {
    fs::write(path, svg).map_err(|source| RenderError::write(path, source))
}
