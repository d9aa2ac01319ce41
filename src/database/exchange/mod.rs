//! What goes out of a store and comes in: arrays of moments, archives of whole textures.

pub mod arrays;
pub(crate) mod moments;
pub(crate) mod textures;
