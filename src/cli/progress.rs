//! Progress on a terminal.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use hlacdb::Progress;
use indicatif::{ProgressBar, ProgressStyle};

use super::context::{Context, Failure};

/// A progress bar with rate and remaining time on a terminal, and nothing elsewhere. Ctrl-C cancels the work at its next
/// safe point.
pub(super) struct TerminalProgress {
    visible: bool,
    bar: Mutex<Option<ProgressBar>>,
    interrupted: Arc<AtomicBool>,
}

impl TerminalProgress {
    /// Progress of work that commits batches.
    pub(super) fn new(context: &Context) -> Result<Self, Failure> {
        Self::with_message(
            context,
            "stopping after the current batch (press again to stop at once; what was reported as added is safe)",
        )
    }

    /// Progress that prints `message` on stderr at the first Ctrl-C. A second one ends the program.
    pub(super) fn with_message(context: &Context, message: &'static str) -> Result<Self, Failure> {
        let interrupted = context.interruptible(message)?;
        Ok(Self { visible: context.draws_progress(), bar: Mutex::new(None), interrupted })
    }

    fn with(&self, act: impl FnOnce(&mut Option<ProgressBar>)) {
        // A poisoned lock only means that another thread panicked while it drew.
        act(&mut self.bar.lock().unwrap_or_else(|poisoned| poisoned.into_inner()));
    }
}

impl Progress for TerminalProgress {
    fn begin(&self, stage: &str, steps: Option<u64>) {
        if !self.visible {
            return;
        }
        let (bar, template) = match steps {
            Some(steps) => {
                (ProgressBar::new(steps), "{msg:12} {wide_bar} {human_pos}/{human_len} {per_sec} {eta} to go")
            }
            None => (ProgressBar::new_spinner(), "{msg:12} {spinner} {human_pos} {per_sec} {elapsed}"),
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(stage.to_owned());
        self.with(|current| {
            if let Some(old) = current.replace(bar) {
                old.finish_and_clear();
            }
        });
    }

    fn advance(&self, steps: u64) {
        self.with(|bar| {
            if let Some(bar) = bar {
                bar.inc(steps);
            }
        });
    }

    fn cancelled(&self) -> bool {
        self.interrupted.load(Ordering::SeqCst)
    }
}

impl Drop for TerminalProgress {
    fn drop(&mut self) {
        self.with(|bar| {
            if let Some(bar) = bar.take() {
                bar.finish_and_clear();
            }
        });
    }
}
