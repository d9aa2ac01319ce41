//! Lanes: so much work of a kind at once, and so much waiting for its turn.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use axum::http::StatusCode;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::problem::Problem;

/// So many requests may wait for their turn in a lane; who comes later is told to come again.
const LONGEST_QUEUE: usize = 512;

/// Bounds how much work is done at once.
pub(crate) struct Lane {
    places: Arc<Semaphore>,
    waiting: AtomicUsize,
}

impl Lane {
    pub(crate) fn new(width: usize) -> Self {
        Self { places: Arc::new(Semaphore::new(width.max(1))), waiting: AtomicUsize::new(0) }
    }

    /// A place, held until it is dropped.
    pub(crate) async fn place(&self) -> Result<OwnedSemaphorePermit, Problem> {
        let waiting = Waiting::begin(&self.waiting);
        if waiting.number >= LONGEST_QUEUE {
            return Err(Problem::new(StatusCode::SERVICE_UNAVAILABLE, "too many requests are waiting: try again soon"));
        }
        let place = Arc::clone(&self.places).acquire_owned().await;
        drop(waiting);
        // The semaphore is never closed.
        place.map_err(|_| Problem::internal())
    }
}

/// One who waits, counted until dropped: a caller that goes away while waiting is dropped too.
struct Waiting<'a> {
    count: &'a AtomicUsize,
    number: usize,
}

impl<'a> Waiting<'a> {
    fn begin(count: &'a AtomicUsize) -> Self {
        Self { count, number: count.fetch_add(1, Ordering::Relaxed) }
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        self.count.fetch_sub(1, Ordering::Relaxed);
    }
}
