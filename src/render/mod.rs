//! Pictures: slices of volumes as PNG, and plots of measurements as SVG.
//!
//! | to draw | use | result |
//! |---|---|---|
//! | several volumes with captions, the query marked | [`contact_sheet`], [`answer_sheet`] | [`Image`] |
//! | one volume with its name and size | [`texture_sheet`] | [`Image`] |
//! | slices and nothing else | [`slice_image`], [`slice()`], [`thumbnail`] | [`Image`] |
//! | an evaluation, the statistics of a store | [`evaluation_plot`], [`statistics_plot`] | SVG text |
//!
//! Voxels are enlarged by whole factors or averaged over whole blocks, never interpolated. The same input gives the same
//! bytes on every machine.

mod contact_sheet;
mod error;
mod image;
mod plot;
mod sheets;
mod slice_axis;
mod slice_grid;
mod slice_image;

pub use self::contact_sheet::{ContactSheetOptions, Panel, Theme, contact_sheet};
pub use self::error::RenderError;
pub use self::image::{Image, PixelFormat, PngEffort};
pub use self::plot::{evaluation_plot, statistics_plot, write_svg};
pub use self::sheets::{answer_sheet, texture_sheet};
pub use self::slice_axis::{ParseSliceAxisError, SliceAxis};
pub use self::slice_image::{SliceImageOptions, slice, slice_image, thumbnail};

/// The most pixels of one picture: 2^25, about 100 MB of memory while it is drawn.
pub const MAX_PIXELS: u64 = 1 << 25;
