//! Work over the whole file: verification, compaction, copies, salvage, sizes, removal of damaged textures.

pub(crate) mod compact;
pub(crate) mod copy;
mod job;
mod remove_damaged;
pub(crate) mod salvage;
pub(crate) mod sizes;
pub(crate) mod verify;
