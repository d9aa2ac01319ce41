//! What lies below the store: the engine's panics, the process that holds the lock, files and their names.

pub(crate) mod files;
pub(crate) mod lock_owner;
pub(crate) mod panic_boundary;
