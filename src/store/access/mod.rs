//! The open file: handles, snapshots, reads and the one writer's transaction.

pub(in crate::store) mod blobs;
pub(in crate::store) mod handle;
pub(in crate::store) mod reads;
pub(in crate::store) mod snapshot;
pub(in crate::store) mod tables;
pub(in crate::store) mod transaction;
pub(in crate::store) mod write_buffer;
