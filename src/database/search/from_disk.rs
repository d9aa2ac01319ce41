//! The answer to a first question, from a store that was just opened: few bytes are read, and nothing is kept.
//!
//! Codes are read from one end to the other (32 bytes a texture), points only of rows that may matter. The answers are those of the points in memory, to the bit. From the second question on the points are loaded.

use crate::database::points::stored::{StoredPoints, unpacked};
use crate::error::Error;
use crate::index::{DiskScan, IdFilter, KnnQuery, Neighbour};
use crate::space::Space;
use crate::store::{Reads, Snapshot};

/// Whether questions about a space can be answered from what the store keeps: the points of all rows.
pub(crate) fn is_possible(snapshot: &Snapshot, name: &str, space: &Space) -> Result<bool, Error> {
    let kept = StoredPoints::of(snapshot, name, space)?;
    Ok(kept.is_some_and(|kept| kept.rows() as u64 == snapshot.counts().rows))
}

/// The kept point of a texture; `None` where there is none.
pub(crate) fn point(snapshot: &Snapshot, name: &str, space: &Space, id: u64) -> Result<Option<Vec<f32>>, Error> {
    let (Some(kept), Some(row)) = (StoredPoints::of(snapshot, name, space)?, snapshot.row(id)?) else {
        return Ok(None);
    };
    let mut points = kept.points();
    let point = points.row(row as usize)?;
    Ok(point.iter().all(|coordinate| coordinate.is_finite()).then(|| point.to_vec()))
}

/// The neighbours that a question asks for, nearest first, ties by id.
pub(crate) fn search(
    snapshot: &Snapshot,
    name: &str,
    space: &Space,
    question: &KnnQuery<'_>,
) -> Result<Vec<Neighbour>, Error> {
    let rows = snapshot.rows()?;
    let mut scan = DiskScan::new(space.metric(), space.dims(), rows.len(), *question)?;
    let Some(kept) = StoredPoints::of(snapshot, name, space)? else { return Ok(Vec::new()) };
    let mut points = kept.points();
    let mut fetch = |row: usize, into: &mut Vec<f32>| -> Result<(), Error> {
        into.extend_from_slice(points.row(row)?);
        Ok(())
    };
    for (block, ids) in rows.ids().chunks(kept.code_rows()).enumerate() {
        if !may_allow(question.filter, ids) {
            continue;
        }
        let packed = kept.codes(block as u32)?;
        scan.push_codes(block * kept.code_rows(), ids, kept.stride(), &unpacked(&packed), |row| rows.is_live(row));
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
