//! Every type that reaches the disk, and its bytes. `docs/format.md` is the specification; the tests beside each type
//! compare its encoding with bytes that are written out by hand.
//!
//! Most modules have two layers: `encode` and `decode` for the payload of a value, and `seal` and `open` for the whole
//! value in its [frame], which carries kind, length and checksum.

pub(crate) mod bits;
pub(crate) mod blobs;
pub(crate) mod chunks;
pub(crate) mod codec;
pub(crate) mod descriptors;
pub(crate) mod frame;
pub(crate) mod hashes;
pub(crate) mod header;
pub(crate) mod keys;
pub(crate) mod points;
pub(crate) mod record;
pub(crate) mod rows;
pub(crate) mod sums;
pub(crate) mod tables;
pub(crate) mod tags;
pub(crate) mod voxels;
