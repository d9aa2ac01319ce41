//! Spaces in memory: their points and indexes, kept up with the store.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, RwLock};

use super::spaces;
use super::stored::{StoredPoints, mapped_points};
use crate::database::handle::{Database, held};
use crate::error::{Error, chain};
use crate::index::{Index, KdTree, Points};
use crate::space::Metric;
use crate::space::Space;
use crate::store::{DESCRIPTOR_ROWS, Reads, Record, Rows, Snapshot};

/// A space's points as of one revision of the store. It never changes: a query sees one state.
pub(crate) struct SpaceState {
    pub(crate) revision: u64,
    /// The space that made the points.
    pub(crate) space: Arc<Space>,
    /// The points of all textures that have one.
    pub(crate) index: Index,
    /// What could not be read when it was made.
    warnings: Arc<Vec<String>>,
    /// Questions asked of this state and those before it: a tree is built once it is worth it.
    pub(crate) asked: Arc<AtomicU64>,
    /// The records of textures that were hits, as of this revision: reading them costs more than finding them.
    hits: Arc<RwLock<HashMap<u64, Arc<Record>>>>,
}

/// So many records are remembered at most.
const REMEMBERED: usize = 16 * 1024;

/// The newest state of each space that was asked for. Shared with the threads that build trees.
#[derive(Default)]
pub(crate) struct SpaceStates {
    newest: RwLock<BTreeMap<String, Arc<SpaceState>>>,
    /// Spaces about which a question was answered from the file.
    asked: Mutex<BTreeSet<String>>,
}

impl SpaceStates {
    pub(crate) fn get(&self, name: &str) -> Option<Arc<SpaceState>> {
        held(self.newest.read()).get(name).cloned()
    }

    /// Notes that a question was asked of a space; true for the first one.
    pub(crate) fn is_first(&self, name: &str) -> bool {
        held(self.asked.lock()).insert(name.to_owned())
    }

    pub(crate) fn put(&self, name: &str, state: &Arc<SpaceState>) {
        held(self.newest.write()).insert(name.to_owned(), Arc::clone(state));
    }

    /// Gives the newest state of a space a tree that was built over an earlier one of the same points.
    pub(crate) fn install(&self, name: &str, tree: Arc<KdTree>) {
        let mut states = held(self.newest.write());
        if let Some(state) = states.get_mut(name) {
            let mut index = state.index.clone();
            if index.install(tree) {
                *state = Arc::new(state.with_index(index));
            }
        }
    }
}

impl SpaceState {
    /// The revision of the store whose points these are.
    pub(crate) fn revision(&self) -> u64 {
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
    pub(crate) fn with_index(&self, index: Index) -> Self {
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

impl Database {
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
    let mut taken = LivePoints { rows, ids: Vec::new(), coordinates: Vec::new() };
    let kept = match kept_from(snapshot, name, space, first, &mut taken) {
        Err(error) if error.is_damage() => {
            warnings.push(format!("{}; the points are made anew from the moments", chain(&error)));
            taken = LivePoints { rows, ids: Vec::new(), coordinates: Vec::new() };
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
    taken: &mut LivePoints<'_>,
) -> Result<usize, Error> {
    match StoredPoints::of(snapshot, name, space)? {
        Some(kept) => {
            kept.each(first, |row, point| taken.take(row, point))?;
            Ok(kept.rows())
        }
        None => Ok(0),
    }
}

/// Ids and points of live rows.
struct LivePoints<'a> {
    rows: &'a Rows,
    ids: Vec<u64>,
    coordinates: Vec<f32>,
}

impl LivePoints<'_> {
    fn take(&mut self, row: usize, point: &[f32]) {
        if let Some(&id) = self.rows.ids().get(row).filter(|_| self.rows.is_live(row))
            && point.iter().all(|coordinate| coordinate.is_finite())
        {
            self.ids.push(id);
            self.coordinates.extend_from_slice(point);
        }
    }
}
