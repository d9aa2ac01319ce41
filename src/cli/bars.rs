//! Progress on a terminal.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use hlacdb::Progress;
use indicatif::{ProgressBar, ProgressStyle};

use super::Context;

/// A bar with rate and time to go on a terminal, nothing elsewhere; a Ctrl-C flag either way.
pub(crate) struct Bars {
    shown: bool,
    bar: Mutex<Option<ProgressBar>>,
    interrupted: Arc<AtomicBool>,
}

impl Bars {
    /// For work that ends early, and safely, once the flag is up.
    pub(crate) fn until(context: &Context, interrupted: Arc<AtomicBool>) -> Self {
        Self { shown: context.draws_progress(), bar: Mutex::new(None), interrupted }
    }

    fn with(&self, act: impl FnOnce(&mut Option<ProgressBar>)) {
        // A poisoned lock only means that another thread panicked while drawing.
        act(&mut self.bar.lock().unwrap_or_else(|poisoned| poisoned.into_inner()));
    }
}

impl Progress for Bars {
    fn begin(&self, stage: &str, steps: Option<u64>) {
        if !self.shown {
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
        self.with(|shown| {
            if let Some(old) = shown.replace(bar) {
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

impl Drop for Bars {
    fn drop(&mut self) {
        self.with(|bar| {
            if let Some(bar) = bar.take() {
                bar.finish_and_clear();
            }
        });
    }
}
