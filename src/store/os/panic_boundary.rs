//! The engine's panics, contained.
//!
//! The engine trusts the pages that it reads: a flipped bit in a page's own head or offsets makes it panic. A library
//! that promises to name damage must not fall with it, so whatever touches pages runs in [`guarded`].

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::store::error::StoreError;

thread_local! {
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// Whether a panic of this thread, here and now, is the engine's over a damaged page, and told as damage. A program's panic
/// hook may ask, so as not to print what is told in a better way.
pub fn panic_is_contained() -> bool {
    CONTAINED.get()
}

/// Runs `work`, which reads or writes pages of `table`; a panic in it is damage of that table's pages.
pub(in crate::store) fn guarded<T>(
    table: &'static str,
    work: impl FnOnce() -> Result<T, StoreError>,
) -> Result<T, StoreError> {
    // Nothing of ours is seen half-changed afterwards: a snapshot never changes, and a transaction whose operation did
    // not return is broken. What the engine's own locks guarded it refuses from then on.
    let outer = CONTAINED.replace(true);
    let done = catch_unwind(AssertUnwindSafe(work));
    CONTAINED.set(outer);
    done.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
        let what = format!("the engine stumbled over a damaged page ({})", text.unwrap_or("no message"));
        Err(StoreError::damage(table, "(pages)", what))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_damage() {
        let error = guarded::<()>("sums", || panic!("range end index {}", 9)).unwrap_err();
        let text = error.to_string();
        assert!(text.contains("sums") && text.contains("range end index 9"), "{text}");
        assert_eq!(guarded("sums", || Ok(1)).unwrap(), 1);
    }
}
