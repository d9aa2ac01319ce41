//! Every type that reaches the disk, and its bytes. `docs/format.md` is the specification; the tests beside each type
//! compare its encoding with bytes that were written down by hand.

pub(in crate::store) mod bits;
pub(in crate::store) mod chunks;
pub(in crate::store) mod codec;
pub(in crate::store) mod descriptors;
pub(in crate::store) mod frame;
pub(in crate::store) mod header;
pub(in crate::store) mod keys;
pub(in crate::store) mod points;
pub(in crate::store) mod record;
pub(in crate::store) mod rows;
pub(in crate::store) mod sums;
pub(in crate::store) mod voxels;
