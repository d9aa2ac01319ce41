//! Moments, statistics and points of textures, as they are stored and in memory.

pub(crate) mod contributions;
pub(crate) mod descriptors;
pub(crate) mod fitting;
pub(crate) mod live;
pub(crate) mod loading;
pub(crate) mod spaces;
pub(crate) mod statistics_cache;
pub(crate) mod stored;
