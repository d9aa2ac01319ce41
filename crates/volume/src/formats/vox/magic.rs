//! The bytes by which a model is recognised.

/// The first bytes of a file.
pub(super) const MAGIC: &[u8] = b"VOX ";
