//! What leaves a store and enters it besides volumes: arrays of moments and points, and archives of whole textures.

#[cfg(feature = "archives")]
pub(crate) mod archive;
pub mod arrays;
mod graph;
pub(crate) mod moments;
