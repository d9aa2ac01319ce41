//! Pictures: contact sheets and slice images of volumes, and SVG plots of what was measured.

pub mod plot;
pub mod sheet;
