//! Limits: how much work runs at once, and how long the body of a request may be.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode};
use axum_extra::headers::{ContentLength, HeaderMapExt};
use futures_util::StreamExt;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::problem::Problem;

/// How many requests may wait for a concurrency limit; further ones are refused with 503.
const MAX_WAITING: usize = 512;

/// A bound on how much work of one kind runs at once.
pub(crate) struct ConcurrencyLimit {
    permits: Arc<Semaphore>,
    waiting: AtomicUsize,
}

impl ConcurrencyLimit {
    /// A limit of `permits` (at least 1) at once.
    pub(crate) fn new(permits: usize) -> Self {
        Self { permits: Arc::new(Semaphore::new(permits.max(1))), waiting: AtomicUsize::new(0) }
    }

    /// Waits for a permit, which is returned when it is dropped.
    ///
    /// # Errors
    /// 503 if too many requests are waiting already.
    pub(crate) async fn acquire(&self) -> Result<OwnedSemaphorePermit, Problem> {
        let waiting = Waiting::begin(&self.waiting);
        if waiting.number >= MAX_WAITING {
            let detail = "too many requests are waiting: try again in a moment";
            return Err(Problem::new(StatusCode::SERVICE_UNAVAILABLE, detail));
        }
        let permit = Arc::clone(&self.permits).acquire_owned().await;
        drop(waiting);
        // The semaphore is never closed.
        permit.map_err(|_| Problem::internal())
    }
}

/// A waiting request. It is counted until it is dropped, which also happens if the caller disconnects.
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

/// Whether a request declares a body longer than `max_body` bytes.
pub(crate) fn declares_too_long_body(headers: &HeaderMap, max_body: u64) -> bool {
    headers.typed_get::<ContentLength>().is_some_and(|ContentLength(length)| length > max_body)
}

/// The problem of a body that is too long.
pub(crate) fn body_too_long(max_body: u64) -> Problem {
    let detail = format!(
        "the body of the request is longer than the limit of {max_body} bytes: send less at once, or start the server with \
         a larger --max-body"
    );
    Problem::new(StatusCode::PAYLOAD_TOO_LARGE, detail)
}

/// How many bytes of a refused body are read and discarded.
const MAX_DRAINED: usize = 64 << 20;

/// Reads a refused body to its end, so that a client that sends before it reads gets the problem and not a broken
/// connection.
pub(crate) async fn drain(request: Request) {
    let (mut body, mut read) = (request.into_body().into_data_stream(), 0);
    while let Some(Ok(chunk)) = body.next().await {
        read += chunk.len();
        if read > MAX_DRAINED {
            break;
        }
    }
}
