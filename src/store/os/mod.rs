//! What lies below the store: the engine's panics and the process that holds the file.

pub(in crate::store) mod lock_owner;
pub(in crate::store) mod panic_boundary;
