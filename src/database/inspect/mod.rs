//! What a store holds: textures, spaces, statistics, catalogue, map and explanations.

pub(crate) mod explain;
pub(crate) mod list;
pub(crate) mod map;
pub(crate) mod spaces;
pub(crate) mod statistics;
pub(crate) mod textures;
