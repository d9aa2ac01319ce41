//! Looking at what a store holds.

pub(crate) mod explain;
pub(crate) mod list;
pub(crate) mod map;
pub(crate) mod spaces;
pub(crate) mod statistics;
pub(crate) mod textures;
