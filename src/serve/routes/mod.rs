//! The routes of the API, one file per group.

pub(crate) mod jobs;
pub(crate) mod metrics;
pub(crate) mod pictures;
pub(crate) mod query;
pub(crate) mod store;
pub(crate) mod textures;
pub(crate) mod voxels;
