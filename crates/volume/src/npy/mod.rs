//! NumPy arrays of any rank: `.npy` files and streams, read and written value by value.
//!
//! [`NpyReader`] reads the header and then values in the order of the file; [`NpyWriter`] writes an array in C order.
//! Volumes in `.npy` files are read by [`read`](crate::read), which uses the same header.
//!
//! A header is a Python literal. It is parsed here and not by a parser of all literals, which a hostile header could
//! send into deep recursion: only a flat dictionary with `descr`, `fortran_order` and `shape` is accepted, and texts that
//! errors quote are cut. Memory grows with the values that are read, not with what the header promises.
//!
//! ```
//! use hlacdb_volume::npy::{NpyReader, NpyWriter};
//!
//! let mut bytes = Vec::new();
//! NpyWriter::new(&mut bytes, &[2, 3])?.finish_with(&[1.0_f32, 2.0, 3.0, 4.0, 5.0, 6.0])?;
//! let mut reader = NpyReader::new(&bytes[..])?;
//! assert_eq!(reader.header().shape(), [2, 3]);
//! assert_eq!(reader.read::<f32>(3)?, [1.0, 2.0, 3.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Format: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>

mod element;
mod header;
mod reader;
#[cfg(test)]
mod tests;
mod writer;

pub use element::NpyElement;
pub use header::NpyHeader;
pub use reader::NpyReader;
pub use writer::NpyWriter;
