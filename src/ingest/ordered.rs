//! Parallel work with results in order and bounded memory.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// What the consumer of [`map`] receives.
pub(crate) enum Next<T> {
    /// The next result, in the order of the items.
    Result(T),
    /// No result came within the interval.
    Tick,
}

/// Maps `items` on the threads of `pool` and passes the results, in the order of the items, to `consume` on the calling
/// thread.
///
/// At most `in_flight` items are begun and not yet consumed. `consume` is also called every `tick` while no result
/// comes. If it breaks, no further item is begun, the results of those that were begun are consumed, and the call returns.
pub(crate) fn map<I, T: Send>(
    pool: &rayon::ThreadPool,
    in_flight: usize,
    tick: Duration,
    items: impl IntoIterator<Item = I>,
    produce: impl Fn(I) -> T + Sync,
    mut consume: impl FnMut(Next<T>) -> ControlFlow<()>,
) where
    I: Send,
{
    let mut items = items.into_iter().fuse();
    let produce = &produce;
    pool.in_place_scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        let (mut begun, mut consumed, mut stopping) = (0, 0, false);
        let mut early = BTreeMap::new();
        loop {
            while !stopping && begun < consumed + in_flight.max(1) {
                let Some(item) = items.next() else { break };
                let ticket = Ticket { number: begun, result: None, sender: sender.clone() };
                scope.spawn(move |_| ticket.fill(|| produce(item)));
                begun += 1;
            }
            if begun == consumed {
                return;
            }
            match receiver.recv_timeout(tick) {
                Ok((number, Some(result))) => {
                    early.insert(number, result);
                }
                // A worker panicked: the scope propagates the panic when it ends.
                Ok((_, None)) | Err(RecvTimeoutError::Disconnected) => return,
                Err(RecvTimeoutError::Timeout) => stopping |= consume(Next::Tick).is_break(),
            }
            while let Some(result) = early.remove(&consumed) {
                consumed += 1;
                stopping |= consume(Next::Result(result)).is_break();
            }
        }
    });
}

/// Sends its result when it is dropped, so that nobody waits for a worker that has panicked.
struct Ticket<T> {
    number: usize,
    result: Option<T>,
    sender: mpsc::Sender<(usize, Option<T>)>,
}

impl<T> Ticket<T> {
    /// Computes the result. It is sent when this returns, or when `make` panics.
    fn fill(mut self, make: impl FnOnce() -> T) {
        self.result = Some(make());
    }
}

impl<T> Drop for Ticket<T> {
    fn drop(&mut self) {
        // The receiver is gone only if the consumer has returned already.
        let _ = self.sender.send((self.number, self.result.take()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn pool() -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap()
    }

    #[test]
    fn results_come_in_order_and_few_are_in_flight() {
        let running = AtomicUsize::new(0);
        let most = AtomicUsize::new(0);
        let mut seen = Vec::new();
        map(
            &pool(),
            3,
            Duration::from_secs(1),
            0..200_usize,
            |item| {
                most.fetch_max(running.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
                std::thread::sleep(Duration::from_micros((item * 37 % 11 * 50) as u64));
                item
            },
            |next| {
                if let Next::Result(item) = next {
                    running.fetch_sub(1, Ordering::SeqCst);
                    seen.push(item);
                }
                ControlFlow::Continue(())
            },
        );
        assert_eq!(seen, (0..200).collect::<Vec<_>>());
        assert!(most.into_inner() <= 3);
    }

    #[test]
    fn after_a_break_what_was_begun_is_consumed_and_nothing_more_is_begun() {
        let begun = AtomicUsize::new(0);
        let mut seen = 0;
        map(
            &pool(),
            4,
            Duration::from_secs(1),
            0..,
            |_: usize| begun.fetch_add(1, Ordering::SeqCst),
            |_| {
                seen += 1;
                if seen >= 10 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            },
        );
        assert_eq!(seen, begun.into_inner());
        assert!(seen < 20);
    }

    #[test]
    #[should_panic(expected = "worker")]
    fn a_panic_of_a_worker_is_propagated() {
        let produce = |item: usize| if item == 5 { panic!("worker") } else { item };
        map(&pool(), 2, Duration::from_secs(1), 0..100, produce, |_| ControlFlow::Continue(()));
    }
}
