//! Maintenance: integrity, size, backups and repair.

pub(crate) mod backup;
pub(crate) mod repair;
pub(crate) mod verify;
