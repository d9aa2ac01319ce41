//! [`Job`]: progress and cancellation of a long operation.

use crate::progress::Progress;
use crate::store::error::StoreError;

/// A long operation that reports progress and can be cancelled.
#[derive(Clone, Copy)]
pub(crate) struct Job<'a> {
    progress: &'a dyn Progress,
    doing: &'static str,
}

impl<'a> Job<'a> {
    /// An operation; `doing` names it in [`StoreError::Cancelled`].
    pub(crate) fn new(doing: &'static str, progress: &'a dyn Progress) -> Self {
        Self { progress, doing }
    }

    /// Begins a stage of `steps` steps.
    pub(crate) fn begin(self, stage: &str, steps: u64) -> Result<(), StoreError> {
        self.progress.begin(stage, Some(steps));
        self.check()
    }

    /// Reports that `steps` more steps of the stage are done.
    pub(crate) fn advance(self, steps: u64) -> Result<(), StoreError> {
        self.progress.advance(steps);
        self.check()
    }

    /// An error if the caller has cancelled the operation.
    fn check(self) -> Result<(), StoreError> {
        match self.progress.cancelled() {
            true => Err(StoreError::Cancelled { doing: self.doing }),
            false => Ok(()),
        }
    }
}
