//! Parallel work while a lock is held.

use std::sync::OnceLock;

use rayon::{ThreadPool, ThreadPoolBuilder};

/// Runs parallel work while the caller holds a lock.
///
/// A rayon worker that waits for parallel work runs other tasks of its pool in the meantime. If one of them needs a lock
/// that the worker holds, it waits for itself. So `work` runs in a pool whose tasks take no locks, and the caller blocks
/// without running anything else.
pub(crate) fn isolated<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    static POOL: OnceLock<Option<ThreadPool>> = OnceLock::new();
    let new = || ThreadPoolBuilder::new().thread_name(|number| format!("hlacdb-{number}")).build().ok();
    let Some(pool) = POOL.get_or_init(new) else {
        // The system grants no more threads.
        return work();
    };
    if pool.current_thread_index().is_some() {
        return work();
    }
    if rayon::current_thread_index().is_none() {
        return pool.install(work);
    }
    let done = std::thread::scope(|scope| scope.spawn(|| pool.install(work)).join());
    done.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

#[cfg(test)]
mod tests {
    use std::sync::{Mutex, mpsc};
    use std::time::Duration;

    use rayon::prelude::*;

    use super::*;

    #[test]
    fn a_task_that_needs_a_lock_does_not_run_on_the_thread_that_holds_it() {
        let (sender, receiver) = mpsc::channel();
        std::thread::spawn(move || {
            let pool = ThreadPoolBuilder::new().num_threads(2).build().unwrap();
            let lock = Mutex::new(0_u64);
            let task = |_: u64| {
                let mut sum = lock.lock().unwrap();
                *sum += isolated(|| (0..1000_u64).into_par_iter().map(|n| n % 7).sum::<u64>());
            };
            pool.install(|| (0..200_u64).into_par_iter().for_each(task));
            sender.send(lock.into_inner().unwrap())
        });
        let sum = (0..1000_u64).map(|n| n % 7).sum::<u64>();
        assert_eq!(receiver.recv_timeout(Duration::from_secs(60)).unwrap(), 200 * sum);
    }
}
