//! The open file: creating and opening, snapshots, reads and the transaction of the one writer.

pub(crate) mod blobs;
pub(crate) mod handle;
pub(crate) mod meta;
pub(crate) mod open;
pub(crate) mod reads;
pub(crate) mod snapshot;
pub(crate) mod tables;
pub(crate) mod transaction;
pub(crate) mod values;
pub(crate) mod write_buffer;
