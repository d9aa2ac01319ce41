//! The answer to the first query of a space, from the file: little of it is read, and nothing is kept in memory.
//!
//! The codes of all rows are read (32 bytes per texture), and the points of the few rows that may be hits. The answers are those
//! of points in memory, to the bit.

use crate::database::points::stored::{StoredPoints, unpacked};
use crate::error::Error;
use crate::index::{DiskScan, IdFilter, KnnQuery, Neighbour};
use crate::space::Space;
use crate::store::{Reads, Snapshot};

/// Whether queries can be answered from the file: it must hold the points of all rows.
pub(crate) fn is_possible(snapshot: &Snapshot, name: &str, space: &Space) -> Result<bool, Error> {
    let stored = StoredPoints::of(snapshot, name, space)?;
    Ok(stored.is_some_and(|stored| stored.rows() as u64 == snapshot.counts().rows))
}

/// The stored point of a texture; `None` if there is none.
pub(crate) fn point(snapshot: &Snapshot, name: &str, space: &Space, id: u64) -> Result<Option<Vec<f32>>, Error> {
    let (Some(stored), Some(row)) = (StoredPoints::of(snapshot, name, space)?, snapshot.row(id)?) else {
        return Ok(None);
    };
    let mut points = stored.points();
    let point = points.row(row as usize)?;
    Ok(point.iter().all(|coordinate| coordinate.is_finite()).then(|| point.to_vec()))
}

/// The neighbours, nearest first, ties by id.
pub(crate) fn search(
    snapshot: &Snapshot,
    name: &str,
    space: &Space,
    query: &KnnQuery<'_>,
) -> Result<Vec<Neighbour>, Error> {
    let rows = snapshot.rows()?;
    let mut scan = DiskScan::new(space.metric(), space.dims(), rows.len(), *query)?;
    let Some(stored) = StoredPoints::of(snapshot, name, space)? else { return Ok(Vec::new()) };
    let mut points = stored.points();
    let mut fetch = |row: usize, into: &mut Vec<f32>| -> Result<(), Error> {
        into.extend_from_slice(points.row(row)?);
        Ok(())
    };
    for (block, ids) in rows.ids().chunks(stored.code_rows()).enumerate() {
        if !may_allow(query.filter, ids) {
            continue;
        }
        let packed = stored.codes(block as u32)?;
        scan.push_codes(block * stored.code_rows(), ids, stored.stride(), &unpacked(&packed), |row| rows.is_live(row));
        if scan.is_full() {
            scan.refine(&mut fetch)?;
        }
    }
    scan.finish(fetch)
}

/// Whether any of these ids, which ascend, may be allowed: what a selective filter leaves out is not even read.
fn may_allow(allowed: IdFilter<'_>, ids: &[u64]) -> bool {
    match (allowed, ids.first(), ids.last()) {
        (IdFilter::Ids(allowed), Some(first), Some(last)) => {
            let from = allowed.partition_point(|id| id < first);
            allowed.get(from).is_some_and(|id| id <= last)
        }
        _ => true,
    }
}
