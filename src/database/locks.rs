//! Locks.

use std::sync::PoisonError;

/// The content of a lock, even if a thread has panicked while it held it: what our locks protect is always replaced as a
/// whole.
pub(crate) fn held<T>(locked: Result<T, PoisonError<T>>) -> T {
    locked.unwrap_or_else(PoisonError::into_inner)
}
