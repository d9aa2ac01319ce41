//! The panic boundary around the storage engine.
//!
//! The engine trusts the pages that it reads: a flipped bit in the header or in an offset of a page can make it panic.
//! Every call of the engine that touches pages therefore runs in [`contained`], which turns such a panic into
//! [`Damage`]. Nothing else runs there. A panic of our own code, or of a caller's callback, is a bug: it unwinds to the
//! caller like any other.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::store::damage::{Damage, DamageKey};
use crate::store::error::StoreError;

thread_local! {
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// Whether a panic of this thread, at this moment, comes from the storage engine over a damaged page and will be
/// reported as [`Damage`]. A panic hook can use this to print only the panics that are bugs.
pub fn panic_is_contained() -> bool {
    CONTAINED.get()
}

/// Runs one call of the engine that reads or writes pages of `table`. A panic of the engine is damage of those pages.
pub(crate) fn contained<T, E: Into<redb::Error>>(
    table: &'static str,
    doing: &'static str,
    call: impl FnOnce() -> Result<T, E>,
) -> Result<T, StoreError> {
    // Nothing of ours is left half changed: a snapshot never changes, and a transaction whose operation failed cannot be
    // committed. What the engine's own locks protect, the engine refuses from then on.
    let outer = CONTAINED.replace(true);
    let done = catch_unwind(AssertUnwindSafe(call));
    CONTAINED.set(outer);
    match done {
        Ok(done) => done.map_err(|error| StoreError::engine(table, doing, error)),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
            let text = text.unwrap_or("no message");
            let what = format!("the storage engine panicked on a damaged page while {doing} ({text})");
            Err(Damage::new(table, DamageKey::Pages, what).into())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_of_the_engine_is_damage_of_the_pages() {
        let call = || -> Result<(), redb::StorageError> { panic!("range end index {}", 9) };
        let error = contained("sums", "reading the store", call).unwrap_err();
        let StoreError::Damage(damage) = &error else { panic!("{error}") };
        assert_eq!((damage.table, &damage.key), ("sums", &DamageKey::Pages));
        assert!(error.to_string().contains("range end index 9"), "{error}");
        assert_eq!(contained("sums", "reading the store", || Ok::<_, redb::StorageError>(1)).unwrap(), 1);
        assert!(!panic_is_contained());
    }
}
