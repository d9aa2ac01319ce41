//! Locks whose content is always whole.

/// A lock's content, whether or not a thread panicked while it held it: what it guards is replaced whole, never half.
pub(crate) fn held<T>(locked: Result<T, std::sync::PoisonError<T>>) -> T {
    locked.unwrap_or_else(std::sync::PoisonError::into_inner)
}
