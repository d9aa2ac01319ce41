//! Points, moments and statistics of the textures, as they are stored and in memory.

pub(crate) mod contributions;
pub(crate) mod descriptors;
pub(crate) mod live;
pub(crate) mod loading;
pub(crate) mod spaces;
pub(crate) mod statistics_cache;
pub(crate) mod stored;
