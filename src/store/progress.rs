//! Progress of long jobs, and the way to stop them.

use std::ops::ControlFlow;

use crate::store::error::StoreError;

/// How far a long job is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// What is being done, e.g. `checking descriptors`.
    pub phase: &'static str,
    /// Steps of this phase that are done.
    pub done: u64,
    /// Steps of this phase.
    pub total: u64,
}

/// Called now and then by a long job; `Break` stops it with [`StoreError::Cancelled`].
pub type Report<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// A [`Report`] that says nothing and never stops.
pub fn silent(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Tells `report`; an error where the job is to stop.
pub(in crate::store) fn tell(
    report: Report<'_>,
    doing: &'static str,
    phase: &'static str,
    done: u64,
    total: u64,
) -> Result<(), StoreError> {
    match report(Progress { phase, done, total }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(StoreError::Cancelled { doing }),
    }
}
