//! Maintenance: integrity, size, backups and repair.

pub(crate) mod backup;
mod migrate;
pub(crate) mod repair;
pub(crate) mod verify;
