//! Plots as SVG: what [`eval`](crate::eval) measured, and what the statistics of a store look like.
//!
//! The one place for plots. A plot is drawn from plain data (a report that was made before), and is a text: a valid XML
//! document on a light ground with a title and a description for those who do not see it, the same bytes for the same
//! data on every machine. No font is read or embedded: text is laid out by an estimate and drawn in whatever sans-serif
//! the viewer has.
//!
//! Colours are told apart by the colour-blind too (Okabe and Ito's), and curves by their marks as well. Pictures of
//! volumes are drawn elsewhere: [`crate::render::sheet`](crate::crate::render::sheet).

mod classes;
mod curves;
mod page;
mod retrieval;
mod statistics;

#[cfg(test)]
mod tests;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::volume::display_path;

pub use retrieval::evaluation;
pub use statistics::statistics;

/// A plot that could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlotError {
    /// There are no data.
    #[error("there is nothing to plot: {missing}")]
    Nothing {
        /// What is missing.
        missing: &'static str,
    },
    /// The drawing library refused.
    #[error("the plot cannot be drawn: {why}")]
    Draw {
        /// Its own words.
        why: String,
    },
    /// The operating system refused.
    #[error("the plot cannot be written to {}: check that the folder exists and may be written to", display_path(path))]
    Write {
        /// Where it should have gone.
        path: PathBuf,
        /// The system's own words.
        #[source]
        source: io::Error,
    },
}

/// Writes a plot; a file of that name is replaced.
///
/// # Errors
/// [`PlotError::Write`].
pub fn write(path: &Path, svg: &str) -> Result<(), PlotError> {
    fs::write(path, svg).map_err(|source| PlotError::Write { path: path.into(), source })
}
