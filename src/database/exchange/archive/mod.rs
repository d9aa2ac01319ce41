//! Archives: whole textures out of a store and into another one, in a form that later versions and other programs can read.
//!
//! An archive is a folder or a tar file. It holds `textures.jsonl`, one JSON object per line, and the arrays that its lines
//! name: first a line `{"format":"hlacdb textures","version":1}`, then a line per texture in id order. Voxels are NumPy arrays
//! of `u8`, (Z, Y, X) or (Z, Y, X, 3). A texture without voxels has its moments, `f32`, one row of 251 per view. In a tar
//! file `textures.jsonl` comes first. Readers ignore unknown fields and refuse a higher version.

mod arrays;
pub(crate) mod export;
pub(crate) mod import;
mod list;

/// For the fuzzer: lists and arrays from any bytes.
#[cfg(feature = "fuzz")]
pub fn fuzz_list(bytes: &[u8]) {
    list::fuzz(bytes);
    arrays::fuzz(bytes);
}
