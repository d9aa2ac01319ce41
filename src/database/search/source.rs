//! Where a query is answered: from points in memory, with or without a tree, or from the file.

use std::sync::Arc;

use super::from_disk;
use crate::database::handle::Database;
use crate::database::points::live::SpaceState;
use crate::database::points::spaces;
use crate::error::Error;
use crate::index::IndexMethod;
use crate::space::Space;
use crate::store::{Reads, Snapshot};

/// Where a query is answered.
pub(crate) enum PointSource {
    /// From points in memory.
    Memory(Arc<SpaceState>),
    /// From the file; see [`from_disk`].
    Disk(Arc<Space>),
}

impl PointSource {
    /// The revision of the store that the points are of; `None` where they are read from the file's newest state.
    pub(crate) fn revision(&self) -> Option<u64> {
        match self {
            Self::Memory(state) => Some(state.owner.revision),
            Self::Disk(_) => None,
        }
    }

    /// The space that made the points.
    pub(crate) fn space(&self) -> &Arc<Space> {
        match self {
            Self::Memory(state) => &state.owner.space,
            Self::Disk(space) => space,
        }
    }
}

impl Database {
    /// Where a single query of a space for `k` neighbours is answered. The first query of a space reads the file, if
    /// that is possible and no tree is asked for; later ones use points in memory.
    pub(crate) fn point_source(
        &self,
        snapshot: &Snapshot,
        name: &str,
        method: IndexMethod,
        k: usize,
    ) -> Result<PointSource, Error> {
        let may_be_first = method != IndexMethod::KdTree && self.spaces.get(name).is_none();
        if may_be_first && self.spaces.is_first_query(name) {
            let space = Arc::new(spaces::load(snapshot, name)?);
            if from_disk::is_possible(snapshot, name, &space)? {
                return Ok(PointSource::Disk(space));
            }
        }
        self.points_in_memory(snapshot, name, method, &[k]).map(PointSource::Memory)
    }

    /// The points of a space at the revision of `snapshot` or a later one, ready for queries for these numbers of
    /// neighbours: see [`LiveSpace::prepare`](crate::database::points::live::LiveSpace::prepare).
    pub(crate) fn points_in_memory(
        &self,
        snapshot: &Snapshot,
        name: &str,
        method: IndexMethod,
        ks: &[usize],
    ) -> Result<Arc<SpaceState>, Error> {
        let live = self.live_space(snapshot, name)?;
        live.prepare(method, ks);
        Ok(live.state())
    }

    /// The newest points of a space, with a tree, and the snapshot that they are of.
    pub(crate) fn points_with_tree(&self, name: &str) -> Result<(Snapshot, Arc<SpaceState>), Error> {
        loop {
            let snapshot = self.store().read()?;
            let state = self.points_in_memory(&snapshot, name, IndexMethod::KdTree, &[])?;
            if state.owner.revision == snapshot.revision() {
                return Ok((snapshot, state));
            }
        }
    }
}
