//! Spaces in memory: their points and indexes, kept up with the store.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, RwLock};
use std::time::Instant;

use super::kept::{KeptPoints, mapped_points};
use super::{Database, cold, held, spaces};
use crate::error::{Error, chain};
use crate::index::{Index, KdTree, Method, Metric, Points};
use crate::space::Space;
use crate::store::{DESCRIPTOR_ROWS, Reads, Record, Rows, Snapshot};

/// A space's points as of one revision of the store. It never changes: a query sees one state.
pub(crate) struct SpaceState {
    revision: u64,
    /// The space that made the points.
    pub(crate) space: Arc<Space>,
    /// The points of all textures that have one.
    pub(crate) index: Index,
    /// What could not be read when it was made.
    warnings: Arc<Vec<String>>,
    /// Questions asked of this state and those before it: a tree is built once it is worth it.
    asked: Arc<AtomicU64>,
    /// The records of textures that were hits, as of this revision: reading them costs more than finding them.
    hits: Arc<RwLock<HashMap<u64, Arc<Record>>>>,
}

/// So many records are remembered at most.
const REMEMBERED: usize = 16 * 1024;

/// The newest state of each space that was asked for. Shared with the threads that build trees.
#[derive(Default)]
pub(super) struct SpaceStates {
    newest: RwLock<BTreeMap<String, Arc<SpaceState>>>,
    /// Spaces about which a question was answered from the file.
    asked: Mutex<BTreeSet<String>>,
}

impl SpaceStates {
    fn get(&self, name: &str) -> Option<Arc<SpaceState>> {
        held(self.newest.read()).get(name).cloned()
    }

    /// Notes that a question was asked of a space; true for the first one.
    fn is_first(&self, name: &str) -> bool {
        held(self.asked.lock()).insert(name.to_owned())
    }

    fn put(&self, name: &str, state: &Arc<SpaceState>) {
        held(self.newest.write()).insert(name.to_owned(), Arc::clone(state));
    }

    /// Gives the newest state of a space a tree that was built over an earlier one of the same points.
    fn install(&self, name: &str, tree: Arc<KdTree>) {
        let mut states = held(self.newest.write());
        if let Some(state) = states.get_mut(name) {
            let mut index = state.index.clone();
            if index.install(tree) {
                *state = Arc::new(state.with_index(index));
            }
        }
    }
}

/// Where a question is answered.
pub(crate) enum Ground {
    /// From points in memory.
    Loaded(Arc<SpaceState>),
    /// From the file; see [`super::cold`].
    File(Arc<Space>),
}

impl Ground {
    /// The revision of the store whose points these are; of the file, whichever is asked.
    pub(crate) fn revision(&self) -> Option<u64> {
        match self {
            Self::Loaded(state) => Some(state.revision),
            Self::File(_) => None,
        }
    }
}

impl SpaceState {
    /// The revision of the store whose points these are.
    pub(super) fn revision(&self) -> u64 {
        self.revision
    }

    /// What could not be read when it was made, one sentence each.
    pub(crate) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The records of these textures, in their order; `None` for those that are not there. `snapshot` is of the revision of
    /// this state.
    pub(crate) fn records_of(&self, snapshot: &Snapshot, ids: &[u64]) -> Result<Vec<Option<Arc<Record>>>, Error> {
        let known: Vec<Option<Arc<Record>>> = {
            let hits = held(self.hits.read());
            ids.iter().map(|id| hits.get(id).cloned()).collect()
        };
        let missing: Vec<u64> =
            ids.iter().zip(&known).filter(|(_, known)| known.is_none()).map(|(&id, _)| id).collect();
        if missing.is_empty() {
            return Ok(known);
        }
        let mut read = snapshot.records_of(&missing)?.into_iter().map(|record| record.map(Arc::new));
        let records: Vec<Option<Arc<Record>>> =
            known.into_iter().map(|known| known.or_else(|| read.next().flatten())).collect();
        let mut hits = held(self.hits.write());
        if hits.len() + missing.len() <= REMEMBERED {
            hits.extend(records.iter().flatten().map(|record| (record.id, Arc::clone(record))));
        }
        Ok(records)
    }

    /// The same state with another index of the same points.
    fn with_index(&self, index: Index) -> Self {
        let (space, asked, hits) = (Arc::clone(&self.space), Arc::clone(&self.asked), Arc::clone(&self.hits));
        Self { revision: self.revision, space, index, warnings: Arc::clone(&self.warnings), asked, hits }
    }

    /// The metric of the space.
    pub(crate) fn metric(&self) -> Metric {
        self.space.metric()
    }
}

/// A texture's id and its point.
pub type IdPoint = (u64, Vec<f32>);

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
    ) -> Result<Ground, Error> {
        let single = questions == 1 && method != Method::KdTree && self.spaces.get(name).is_none();
        if single && self.spaces.is_first(name) {
            let space = Arc::new(spaces::load(snapshot, name)?);
            if cold::is_possible(snapshot, name, &space)? {
                return Ok(Ground::File(space));
            }
        }
        let state = self.state(snapshot, name)?;
        Ok(Ground::Loaded(self.with_tree(state, name, method, questions)))
    }

    /// The state of a space at the revision of `snapshot`, or a later one.
    ///
    /// Where only few textures came or went since the last question, the points are brought up to date; else they are
    /// loaded.
    pub(crate) fn state(&self, snapshot: &Snapshot, name: &str) -> Result<Arc<SpaceState>, Error> {
        let current = |state: &Arc<SpaceState>| state.revision >= snapshot.revision();
        if let Some(state) = self.spaces.get(name).filter(current) {
            return Ok(state);
        }
        let _building = held(self.building.lock());
        let known = self.spaces.get(name);
        if let Some(state) = known.clone().filter(current) {
            return Ok(state);
        }
        let space = Arc::new(spaces::load(snapshot, name)?);
        let same = known.filter(|state| state.space.epoch() == space.epoch() && state.space == space);
        let state = Arc::new(match same {
            Some(state) => advanced(&state, snapshot, name)?,
            None => loaded(snapshot, name, space)?,
        });
        self.spaces.put(name, &state);
        Ok(state)
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
    pub(super) fn treed(&self, name: &str) -> Result<(Snapshot, Arc<SpaceState>), Error> {
        loop {
            let snapshot = self.store().read()?;
            let state = self.state(&snapshot, name)?;
            if state.revision == snapshot.revision() {
                return Ok((snapshot, self.with_tree(state, name, Method::KdTree, 0)));
            }
        }
    }

    /// The metric of a space and the points of some textures in it, in the order of `ids`; a texture without a point is
    /// left out.
    ///
    /// # Errors
    /// [`Error::NoSuchSpace`], [`Error::Store`].
    pub fn points_of(&self, space: &str, ids: impl IntoIterator<Item = u64>) -> Result<(Metric, Vec<IdPoint>), Error> {
        let state = self.state(&self.store().read()?, space)?;
        let points = ids.into_iter().filter_map(|id| Some((id, state.index.points().point(id)?.to_vec())));
        Ok((state.metric(), points.collect()))
    }
}

/// The points of every texture, from nothing.
fn loaded(snapshot: &Snapshot, name: &str, space: Arc<Space>) -> Result<SpaceState, Error> {
    let rows = snapshot.rows()?;
    let mut warnings = Vec::new();
    let (ids, coordinates) = points_from(snapshot, name, &space, &rows, 0, &mut warnings)?;
    let points = Points::from_rows(space.metric(), space.dims(), &ids, &coordinates)?;
    let index = Index::from_points(points);
    let warnings = Arc::new(warnings);
    Ok(SpaceState {
        revision: snapshot.revision(),
        space,
        index,
        warnings,
        asked: Arc::default(),
        hits: Arc::default(),
    })
}

/// The points of an earlier state, with what was removed and added since.
fn advanced(state: &SpaceState, snapshot: &Snapshot, name: &str) -> Result<SpaceState, Error> {
    let rows = snapshot.rows()?;
    let mut index = state.index.clone();
    let gone: Vec<u64> = index.points().iter().map(|(id, _)| id).filter(|&id| rows.row_of(id).is_none()).collect();
    for id in gone {
        index.remove(id);
    }
    let first_new = index.points().last_id().map_or(0, |last| rows.ids().partition_point(|&id| id <= last));
    let mut warnings = state.warnings.to_vec();
    let (ids, coordinates) = points_from(snapshot, name, &state.space, &rows, first_new, &mut warnings)?;
    for (&id, point) in ids.iter().zip(coordinates.chunks_exact(state.space.dims().max(1))) {
        index.push(id, point)?;
    }
    let (space, asked) = (Arc::clone(&state.space), Arc::clone(&state.asked));
    let warnings = Arc::new(warnings);
    Ok(SpaceState { revision: snapshot.revision(), space, index, warnings, asked, hits: Arc::default() })
}

/// Ids and points, row-major, of the live rows from `first` on that have a point: kept ones as they are, others mapped.
///
/// Kept points that cannot be read are mapped anew; textures whose moments cannot be read are left out. Both are told.
fn points_from(
    snapshot: &Snapshot,
    name: &str,
    space: &Space,
    rows: &Rows,
    first: usize,
    warnings: &mut Vec<String>,
) -> Result<(Vec<u64>, Vec<f32>), Error> {
    let mut taken = Taken { rows, ids: Vec::new(), coordinates: Vec::new() };
    let kept = match kept_from(snapshot, name, space, first, &mut taken) {
        Err(error) if error.is_damage() => {
            warnings.push(format!("{}; the points are made anew from the moments", chain(&error)));
            taken = Taken { rows, ids: Vec::new(), coordinates: Vec::new() };
            0
        }
        kept => kept?,
    };
    let mut next = kept.max(first);
    while next < rows.len() {
        let end = ((next / DESCRIPTOR_ROWS + 1) * DESCRIPTOR_ROWS).min(rows.len());
        match mapped_points(snapshot, space, next..end) {
            Ok(points) => points.iter().for_each(|(row, point)| taken.take(*row, point)),
            Err(error) if error.is_damage() => {
                let lost = (next..end).filter(|&row| rows.is_live(row)).count();
                warnings.push(format!("{}; {lost} textures are left out", chain(&error)));
            }
            Err(error) => return Err(error),
        }
        next = end;
    }
    Ok((taken.ids, taken.coordinates))
}

/// Takes the kept points; returns the first row whose point is not kept.
fn kept_from(
    snapshot: &Snapshot,
    name: &str,
    space: &Space,
    first: usize,
    taken: &mut Taken<'_>,
) -> Result<usize, Error> {
    match KeptPoints::of(snapshot, name, space)? {
        Some(kept) => {
            kept.each(first, |row, point| taken.take(row, point))?;
            Ok(kept.rows())
        }
        None => Ok(0),
    }
}

/// Ids and points of live rows.
struct Taken<'a> {
    rows: &'a Rows,
    ids: Vec<u64>,
    coordinates: Vec<f32>,
}

impl Taken<'_> {
    fn take(&mut self, row: usize, point: &[f32]) {
        if let Some(&id) = self.rows.ids().get(row).filter(|_| self.rows.is_live(row))
            && point.iter().all(|coordinate| coordinate.is_finite())
        {
            self.ids.push(id);
            self.coordinates.extend_from_slice(point);
        }
    }
}
