//! One index for many threads: any number ask, one at a time changes it, nobody waits for a build.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use super::{Index, KdTree};

/// The current state of an index. Every question is asked of a snapshot, so it sees the state before or after an
/// update, never one between.
pub struct SharedIndex {
    current: RwLock<Index>,
    /// Held by the one who changes; never by one who asks.
    writer: Mutex<()>,
    building: AtomicBool,
}

impl SharedIndex {
    /// Shares this index.
    pub fn new(index: Index) -> Self {
        Self { current: RwLock::new(index), writer: Mutex::new(()), building: AtomicBool::new(false) }
    }

    /// The state as it is now; it never changes, whatever is done to the shared index later.
    pub fn snapshot(&self) -> Index {
        // A lock is poisoned only if a thread died while swapping whole states: what is there is whole.
        self.current.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Changes the index: `change` works on a copy that shares memory, which becomes the current state when it returns.
    ///
    /// Updates come one after another; snapshots are taken meanwhile. Should `change` panic, nothing has changed.
    pub fn update<T>(&self, change: impl FnOnce(&mut Index) -> T) -> T {
        let _one_at_a_time = self.lock_writer();
        let mut next = self.snapshot();
        let result = change(&mut next);
        *self.current.write().unwrap_or_else(PoisonError::into_inner) = next;
        result
    }

    /// Starts to build a tree on a thread of its own where one is due and none is being built. True if it did.
    ///
    /// Questions are answered with the old tree and the tail until the new one is there; updates go on as well.
    pub fn maintain(self: &Arc<Self>) -> bool {
        if !self.snapshot().should_rebuild() || self.building.swap(true, Ordering::AcqRel) {
            return false;
        }
        let shared = Arc::clone(self);
        std::thread::spawn(move || {
            let _done = Done(&shared.building);
            shared.rebuild();
        });
        true
    }

    /// Whether [`SharedIndex::maintain`] has a build under way.
    pub fn is_building(&self) -> bool {
        self.building.load(Ordering::Acquire)
    }

    /// Builds a tree over the current state and takes it in; returns when it is there.
    pub fn rebuild(&self) {
        let snapshot = self.snapshot();
        if snapshot.needs_compaction() {
            // Row numbers change: nothing may be added meanwhile. Questions go on.
            self.update(Index::rebuild);
        } else if let Some(tree) = KdTree::build(snapshot.points()) {
            let tree = Arc::new(tree);
            self.update(|index| index.install(tree));
        }
    }

    fn lock_writer(&self) -> MutexGuard<'_, ()> {
        self.writer.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Says that the build is over, however it ended.
struct Done<'a>(&'a AtomicBool);

impl Drop for Done<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}
