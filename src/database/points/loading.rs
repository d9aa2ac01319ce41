//! Points in memory: loaded from the store, and brought up to date with its revisions.

use std::sync::Arc;

use super::live::{LiveSpace, SpaceState, SpaceVersion};
use super::spaces;
use super::stored::{StoredPoints, mapped_points};
use crate::TextureId;
use crate::database::handle::Database;
use crate::database::locks::held;
use crate::error::{Error, chain};
use crate::index::{Index, Points};
use crate::isolated::isolated;
use crate::space::{Metric, Space};
use crate::store::{DESCRIPTOR_ROWS, Reads, Rows, Snapshot};

/// A texture with its point in a space.
#[derive(Clone, Debug, PartialEq)]
pub struct TexturePoint {
    /// The texture.
    pub id: TextureId,
    /// The coordinates of its point.
    pub point: Vec<f32>,
}

impl Database {
    /// A space with its points at the revision of `snapshot`, or a later one.
    ///
    /// If only few textures came or went since the last query, the points are brought up to date; otherwise they are loaded.
    pub(crate) fn live_space(&self, snapshot: &Snapshot, name: &str) -> Result<Arc<LiveSpace>, Error> {
        let is_current = |live: &Arc<LiveSpace>| live.state().owner.revision >= snapshot.revision();
        if let Some(live) = self.spaces.get(name).filter(is_current) {
            return Ok(live);
        }
        let _loading = held(self.loading.lock());
        let known = self.spaces.get(name);
        if let Some(live) = known.clone().filter(is_current) {
            return Ok(live);
        }
        let space = Arc::new(spaces::load(snapshot, name)?);
        let same_fit = |live: &Arc<LiveSpace>| {
            let fitted = &live.state().owner.space;
            fitted.epoch() == space.epoch() && *fitted == space
        };
        if let Some(live) = known.filter(same_fit) {
            let update = || live.points.update(|version, index| advance(version, index, snapshot, name));
            return isolated(update).map(|()| Arc::clone(&live));
        }
        let live = Arc::new(isolated(|| load(snapshot, name, space))?);
        self.spaces.put(name, &live);
        Ok(live)
    }

    /// The state of a space at the revision of `snapshot`, or a later one.
    pub(crate) fn state(&self, snapshot: &Snapshot, name: &str) -> Result<Arc<SpaceState>, Error> {
        Ok(self.live_space(snapshot, name)?.state())
    }

    /// The metric of a space, and the points of some textures in it in the order of `ids`. Textures without a point are left
    /// out.
    ///
    /// # Errors
    /// [`QueryError::NoSuchSpace`](crate::QueryError::NoSuchSpace), [`Error::Store`].
    pub fn points_of(
        &self,
        space: &str,
        ids: impl IntoIterator<Item = impl Into<TextureId>>,
    ) -> Result<(Metric, Vec<TexturePoint>), Error> {
        let state = self.state(&self.store().read()?, space)?;
        let points = ids.into_iter().filter_map(|id| {
            let id = id.into();
            let point = state.index.points().point(id.get())?.to_vec();
            Some(TexturePoint { id, point })
        });
        Ok((state.owner.space.metric(), points.collect()))
    }
}

/// Loads the points of all textures.
fn load(snapshot: &Snapshot, name: &str, space: Arc<Space>) -> Result<LiveSpace, Error> {
    let rows = snapshot.rows()?;
    let mut warnings = Vec::new();
    let (ids, coordinates) = points_from(snapshot, name, &space, &rows, 0, &mut warnings)?;
    let points = Points::from_rows(space.metric(), space.dims(), &ids, &coordinates)?;
    Ok(LiveSpace::new(SpaceVersion::new(snapshot, space, warnings), Index::from_points(points)))
}

/// Brings the points of an earlier revision up to date: removes and adds what was removed and added since.
fn advance(version: &mut SpaceVersion, index: &mut Index, snapshot: &Snapshot, name: &str) -> Result<(), Error> {
    let rows = snapshot.rows()?;
    let removed: Vec<u64> = index.points().iter().map(|(id, _)| id).filter(|&id| rows.row_of(id).is_none()).collect();
    for id in removed {
        index.remove(id);
    }
    let first_new = index.points().last_id().map_or(0, |last| rows.ids().partition_point(|&id| id <= last));
    let space = Arc::clone(&version.space);
    let mut warnings = version.warnings.to_vec();
    let (ids, coordinates) = points_from(snapshot, name, &space, &rows, first_new, &mut warnings)?;
    for (&id, point) in ids.iter().zip(coordinates.chunks_exact(space.dims().max(1))) {
        index.push(id, point)?;
    }
    *version = SpaceVersion::new(snapshot, space, warnings);
    Ok(())
}

/// The ids and points, row-major, of the live rows from `first` on that have a point: stored points as they are, others mapped
/// from moments.
///
/// If stored points are damaged, all are mapped from moments; textures whose moments are damaged are left out. Both give a
/// warning.
fn points_from(
    snapshot: &Snapshot,
    name: &str,
    space: &Space,
    rows: &Rows,
    first: usize,
    warnings: &mut Vec<String>,
) -> Result<(Vec<u64>, Vec<f32>), Error> {
    let mut live = LivePoints::new(rows);
    let stored = match stored_points_from(snapshot, name, space, first, &mut live) {
        Err(error) if error.is_damage() => {
            warnings.push(format!("{}; the points are recomputed from the moments", chain(&error)));
            live = LivePoints::new(rows);
            0
        }
        stored => stored?,
    };
    let mut next = stored.max(first);
    while next < rows.len() {
        let end = ((next / DESCRIPTOR_ROWS + 1) * DESCRIPTOR_ROWS).min(rows.len());
        match mapped_points(snapshot, space, next..end) {
            Ok(points) => points.iter().for_each(|(row, point)| live.add(*row, point)),
            Err(error) if error.is_damage() => {
                let lost = (next..end).filter(|&row| rows.is_live(row)).count();
                warnings.push(format!("{}; {lost} textures are left out", chain(&error)));
            }
            Err(error) => return Err(error),
        }
        next = end;
    }
    Ok((live.ids, live.coordinates))
}

/// Adds the stored points of the rows from `first` on. Returns the first row without a stored point.
fn stored_points_from(
    snapshot: &Snapshot,
    name: &str,
    space: &Space,
    first: usize,
    live: &mut LivePoints<'_>,
) -> Result<usize, Error> {
    match StoredPoints::of(snapshot, name, space)? {
        Some(stored) => {
            stored.each(first, |row, point| live.add(row, point))?;
            Ok(stored.rows())
        }
        None => Ok(0),
    }
}

/// The ids and points of live rows.
struct LivePoints<'a> {
    rows: &'a Rows,
    ids: Vec<u64>,
    coordinates: Vec<f32>,
}

impl<'a> LivePoints<'a> {
    fn new(rows: &'a Rows) -> Self {
        Self { rows, ids: Vec::new(), coordinates: Vec::new() }
    }

    /// Adds a row, if it is live and has a point.
    fn add(&mut self, row: usize, point: &[f32]) {
        if let Some(&id) = self.rows.ids().get(row).filter(|_| self.rows.is_live(row))
            && point.iter().all(|coordinate| coordinate.is_finite())
        {
            self.ids.push(id);
            self.coordinates.extend_from_slice(point);
        }
    }
}
