//! Where a query is answered: points in memory, with or without a tree, or the file.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use super::from_disk;
use crate::database::handle::Database;
use crate::database::points::spaces;
use crate::database::points::state::SpaceState;
use crate::error::Error;
use crate::index::{KdTree, Method};
use crate::space::Space;
use crate::store::{Reads, Snapshot};

/// Where a question is answered.
pub(crate) enum PointSource {
    /// From points in memory.
    Memory(Arc<SpaceState>),
    /// From the file; see [`super::cold`].
    Disk(Arc<Space>),
}

impl PointSource {
    /// The revision of the store whose points these are; of the file, whichever is asked.
    pub(crate) fn revision(&self) -> Option<u64> {
        match self {
            Self::Memory(state) => Some(state.revision),
            Self::Disk(_) => None,
        }
    }
}

/// Fewer questions than this are answered by the scan alone: a tree would cost more than it saves.
const QUESTIONS_WORTH_A_TREE: u64 = 8;

impl Database {
    /// Where `questions` questions about a space are answered: a single one, if it is the first and does not ask for a
    /// tree, from the file where that is possible; else from points in memory.
    pub(crate) fn ground(
        &self,
        snapshot: &Snapshot,
        name: &str,
        method: Method,
        questions: u64,
    ) -> Result<PointSource, Error> {
        let single = questions == 1 && method != Method::KdTree && self.spaces.get(name).is_none();
        if single && self.spaces.is_first(name) {
            let space = Arc::new(spaces::load(snapshot, name)?);
            if from_disk::is_possible(snapshot, name, &space)? {
                return Ok(PointSource::Disk(space));
            }
        }
        let state = self.state(snapshot, name)?;
        Ok(PointSource::Memory(self.with_tree(state, name, method, questions)))
    }

    /// The state with a tree, where `method` or the number of questions asks for one.
    ///
    /// By name (`kdtree`), the tree is built before the question is answered. By itself, it is built on a thread of its
    /// own once a few questions were asked, and questions are answered by the scan meanwhile.
    fn with_tree(&self, state: Arc<SpaceState>, name: &str, method: Method, questions: u64) -> Arc<SpaceState> {
        let asked = state.asked.fetch_add(questions, Ordering::Relaxed) + questions;
        if !state.index.should_rebuild() && (state.index.covered() > 0 || method != Method::KdTree) {
            return state;
        }
        match method {
            Method::Linear => {}
            Method::KdTree => {
                let (mut index, began) = (state.index.clone(), Instant::now());
                index.rebuild();
                let ms = began.elapsed().as_secs_f64() * 1e3;
                tracing::debug!(space = name, rows = index.points().len(), ms, "built a tree");
                let state = Arc::new(state.with_index(index));
                self.spaces.put(name, &state);
                return state;
            }
            Method::Auto if asked >= QUESTIONS_WORTH_A_TREE => {
                // Counting from far below, so that no second build begins while this one runs.
                state.asked.store(0, Ordering::Relaxed);
                let (states, name, points) = (Arc::clone(&self.spaces), name.to_owned(), state.index.points().clone());
                std::thread::spawn(move || {
                    if let Some(tree) = KdTree::build(&points) {
                        states.install(&name, Arc::new(tree));
                    }
                });
            }
            Method::Auto => {}
        }
        state
    }

    /// The newest state of a space, with a tree, and the snapshot that it is of: for questions about all textures.
    pub(crate) fn treed(&self, name: &str) -> Result<(Snapshot, Arc<SpaceState>), Error> {
        loop {
            let snapshot = self.store().read()?;
            let state = self.state(&snapshot, name)?;
            if state.revision == snapshot.revision() {
                return Ok((snapshot, self.with_tree(state, name, Method::KdTree, 0)));
            }
        }
    }
}
