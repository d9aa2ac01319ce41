//! One index for many threads: any number search, one at a time changes it, and no search waits for a build.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use super::Index;
use crate::isolated::isolated;

/// An index at one moment, with data of its owner that belongs to it. It never changes.
pub struct IndexState<T> {
    /// Data of the owner that belongs to this index, such as the revision it was made of.
    pub owner: T,
    /// The index.
    pub index: Index,
}

/// The current state of an index and of its owner's data. A search uses a snapshot, so it sees the state before or after
/// an update, never one in between.
///
/// At most one tree is built at a time. A build works on a snapshot and does not block searches or updates.
pub struct SharedIndex<T> {
    current: RwLock<Arc<IndexState<T>>>,
    /// Held while the state is changed. Taking a snapshot does not need it.
    writer: Mutex<()>,
    /// Held while a tree is built.
    builder: Mutex<()>,
    /// Whether a build was started in the background and has not ended.
    in_background: AtomicBool,
    builds: AtomicU64,
}

impl<T: Clone + Send + Sync + 'static> SharedIndex<T> {
    /// Shares an index.
    pub fn new(owner: T, index: Index) -> Self {
        Self {
            current: RwLock::new(Arc::new(IndexState { owner, index })),
            writer: Mutex::new(()),
            builder: Mutex::new(()),
            in_background: AtomicBool::new(false),
            builds: AtomicU64::new(0),
        }
    }

    /// The current state.
    pub fn snapshot(&self) -> Arc<IndexState<T>> {
        // A thread that panicked cannot have left half a state: states are replaced whole.
        Arc::clone(&self.current.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// Changes the state: `change` works on a copy that shares memory, which becomes the current state when it returns.
    ///
    /// Updates come one after another; snapshots are taken meanwhile. If `change` fails or panics, nothing has changed.
    ///
    /// # Errors
    /// Those of `change`.
    pub fn update<E>(&self, change: impl FnOnce(&mut T, &mut Index) -> Result<(), E>) -> Result<(), E> {
        let _one_at_a_time = lock(&self.writer);
        let state = self.snapshot();
        let (mut owner, mut index) = (state.owner.clone(), state.index.clone());
        change(&mut owner, &mut index)?;
        *self.current.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(IndexState { owner, index });
        Ok(())
    }

    /// Starts to build a tree on a thread of its own if one is due and none is being built. True if it did.
    ///
    /// Searches use the old tree and scan the rows that it does not cover until the new one is there.
    pub fn build_in_background(self: &Arc<Self>) -> bool {
        if !self.snapshot().index.should_rebuild() || self.in_background.swap(true, Ordering::AcqRel) {
            return false;
        }
        let shared = Arc::clone(self);
        let build = move || {
            let _ended = Ended(&shared.in_background);
            shared.build_if(Index::should_rebuild);
        };
        let started = std::thread::Builder::new().name("hlacdb-build".into()).spawn(build);
        if started.is_err() {
            // The system grants no more threads: a later query tries again.
            self.in_background.store(false, Ordering::Release);
        }
        started.is_ok()
    }

    /// Builds a tree if `due` is true of the current index, and returns when it is installed. Waits first for a build that
    /// is already running.
    pub fn build_if(&self, due: impl Fn(&Index) -> bool) {
        let _one_at_a_time = lock(&self.builder);
        let before = self.snapshot();
        if !due(&before.index) {
            return;
        }
        let mut built = before.index.clone();
        isolated(|| built.rebuild());
        self.builds.fetch_add(1, Ordering::Relaxed);
        let Ok(()) = self.update(|_, index| {
            index.adopt(built, &before.index);
            Ok::<(), std::convert::Infallible>(())
        });
    }

    /// Whether a background build is running.
    pub fn is_building(&self) -> bool {
        self.in_background.load(Ordering::Acquire)
    }

    /// The number of builds so far.
    pub fn builds(&self) -> u64 {
        self.builds.load(Ordering::Relaxed)
    }
}

fn lock(mutex: &Mutex<()>) -> MutexGuard<'_, ()> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Marks a background build as ended when dropped, also if it panicked.
struct Ended<'a>(&'a AtomicBool);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}
