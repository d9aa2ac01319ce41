//! How long calls tell where they are, and how they are stopped.

/// What a long call reports to, and asks whether to go on.
///
/// Every method has a default that does nothing, so `&()` is the silent progress that never cancels. Calls come from
/// several threads.
pub trait Progress: Sync {
    /// A stage begins: what it does (`"describing"`), and how many steps it has, where that is known.
    fn begin(&self, stage: &str, steps: Option<u64>) {
        let _ = (stage, steps);
    }

    /// So many more steps of the stage are done.
    fn advance(&self, steps: u64) {
        let _ = steps;
    }

    /// True once the caller wants the call to end. It ends at the next safe place, with [`crate::Error::Cancelled`] or,
    /// where work was already made durable, with a report of what was done.
    fn cancelled(&self) -> bool {
        false
    }
}

impl Progress for () {}
