//! [`LiveSpace`]: a space in memory, with its points and the tree over them.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, RwLock};

use crate::database::locks::held;
use crate::error::Error;
use crate::index::{Index, IndexMethod, IndexState, SharedIndex};
use crate::space::Space;
use crate::store::{Reads, Record, Snapshot};

/// A space's points at one revision of the store, with or without a tree over them. It never changes: a query sees one
/// state.
pub(crate) type SpaceState = IndexState<SpaceVersion>;

/// What belongs to the points of a space at one revision of the store.
#[derive(Clone)]
pub(crate) struct SpaceVersion {
    /// The revision.
    pub(crate) revision: u64,
    /// The space that made the points.
    pub(crate) space: Arc<Space>,
    /// What could not be read when the points were loaded, one sentence each.
    pub(crate) warnings: Arc<Vec<String>>,
    /// The records of textures that were hits: reading them takes longer than finding them.
    records: Arc<RwLock<HashMap<u64, Arc<Record>>>>,
}

/// The most records that are cached.
const CACHED_RECORDS: usize = 16 * 1024;

/// A space in memory. Its points, and the tree over them, follow the revisions of the store.
pub(crate) struct LiveSpace {
    pub(super) points: Arc<SharedIndex<SpaceVersion>>,
    /// The number of queries since the points were loaded: a tree is built once it is worthwhile.
    queries: AtomicU64,
}

/// Fewer queries than this, one after another, are answered by scans: most processes make only a few.
const QUERIES_WORTH_A_TREE: u64 = 8;

impl LiveSpace {
    pub(super) fn new(version: SpaceVersion, index: Index) -> Self {
        Self { points: Arc::new(SharedIndex::new(version, index)), queries: AtomicU64::new(0) }
    }

    /// The current state.
    pub(crate) fn state(&self) -> Arc<SpaceState> {
        self.points.snapshot()
    }

    /// The number of trees that were built.
    #[cfg(test)]
    pub(crate) fn builds(&self) -> u64 {
        self.points.builds()
    }

    /// Waits for a build in the background to end.
    #[cfg(test)]
    pub(crate) fn wait_for_build(&self) {
        while self.points.is_building() {
            std::thread::yield_now();
        }
    }

    /// Gets the tree ready for queries for these numbers of neighbours, which will be answered by `method`.
    ///
    /// If the tree is asked for by name, or so many queries make it worthwhile, it is there when this returns. Otherwise,
    /// once a few queries were counted, it is built in the background, and queries are answered by the scan meanwhile.
    pub(crate) fn prepare(&self, method: IndexMethod, ks: &[usize]) {
        let state = self.state();
        let queries = ks.iter().filter(|&&k| state.index.suits_tree(k)).count();
        let counted = self.queries.fetch_add(queries as u64, Ordering::Relaxed) + queries as u64;
        match method {
            IndexMethod::Linear => {}
            IndexMethod::KdTree => self.points.build_if(|index| index.covered() == 0 || index.should_rebuild()),
            IndexMethod::Auto if state.index.is_build_worthwhile(queries) => {
                self.points.build_if(|index| index.is_build_worthwhile(queries));
            }
            IndexMethod::Auto if counted >= QUERIES_WORTH_A_TREE => {
                self.points.build_in_background();
            }
            IndexMethod::Auto => {}
        }
    }
}

/// The spaces in memory: those that were queried, each at the newest revision that a query has used.
#[derive(Default)]
pub(crate) struct LiveSpaces {
    spaces: RwLock<BTreeMap<String, Arc<LiveSpace>>>,
    /// The spaces of which a query was answered from the file.
    queried: Mutex<BTreeSet<String>>,
}

impl LiveSpaces {
    pub(crate) fn get(&self, name: &str) -> Option<Arc<LiveSpace>> {
        held(self.spaces.read()).get(name).cloned()
    }

    /// Notes that a space is queried; true the first time.
    pub(crate) fn is_first_query(&self, name: &str) -> bool {
        held(self.queried.lock()).insert(name.to_owned())
    }

    pub(super) fn put(&self, name: &str, space: &Arc<LiveSpace>) {
        held(self.spaces.write()).insert(name.to_owned(), Arc::clone(space));
    }
}

impl SpaceVersion {
    pub(super) fn new(snapshot: &Snapshot, space: Arc<Space>, warnings: Vec<String>) -> Self {
        Self { revision: snapshot.revision(), space, warnings: Arc::new(warnings), records: Arc::default() }
    }

    /// The records of these textures, in their order; `None` for those that do not exist. `snapshot` must be of this revision.
    pub(crate) fn records_of(&self, snapshot: &Snapshot, ids: &[u64]) -> Result<Vec<Option<Arc<Record>>>, Error> {
        let cached: Vec<Option<Arc<Record>>> = {
            let records = held(self.records.read());
            ids.iter().map(|id| records.get(id).cloned()).collect()
        };
        let missing: Vec<u64> =
            ids.iter().zip(&cached).filter(|(_, cached)| cached.is_none()).map(|(&id, _)| id).collect();
        if missing.is_empty() {
            return Ok(cached);
        }
        let mut read = snapshot.records_of(&missing)?.into_iter().map(|record| record.map(Arc::new));
        let records: Vec<Option<Arc<Record>>> =
            cached.into_iter().map(|cached| cached.or_else(|| read.next().flatten())).collect();
        let mut cache = held(self.records.write());
        if cache.len() + missing.len() <= CACHED_RECORDS {
            cache.extend(records.iter().flatten().map(|record| (record.id, Arc::clone(record))));
        }
        Ok(records)
    }
}
