//! Work over the whole file: verification, compaction, copies, salvage, sizes, removal of damaged textures.

pub(in crate::store) mod compact;
pub(in crate::store) mod copy;
mod remove_damaged;
pub(in crate::store) mod salvage;
pub(in crate::store) mod sizes;
pub(in crate::store) mod verify;
