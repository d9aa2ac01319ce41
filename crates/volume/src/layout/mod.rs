//! Where and how the samples of a volume lie in a file ([`DataLayout`]), and reading them.
//!
//! Most formats are a header and one stretch of samples. Reading those has two steps: the header becomes a data layout,
//! which touches no samples, and the layout is opened as a [`VolumeReader`] that serves planes and boxes. Samples that
//! are not compressed are read where they lie; compressed ones are decoded in the order of the file, and going back
//! starts at the beginning again.

mod axes;
mod bytes;
mod data_layout;
mod decode;
mod header_lines;
mod reader;
mod region;
mod text;

pub(crate) use axes::{Axes, Axis, dense};
pub(crate) use bytes::append_promised;
#[cfg(feature = "npz")]
pub(crate) use data_layout::Checksum;
pub(crate) use data_layout::{DataLayout, Encoding, Meaning, Start};
#[cfg(feature = "gzip")]
pub(crate) use decode::gzip_start;
pub(crate) use decode::{check_inflated, open_file};
pub(crate) use header_lines::{HeaderLines, after_lines, beside};
