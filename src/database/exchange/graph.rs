//! The neighbour graph of a store, as arrays.

use std::path::Path;

use rayon::prelude::*;

use super::arrays::NpyRows;
use crate::database::handle::Database;
use crate::database::scheme::DEFAULT_SPACE;
use crate::error::{Error, QueryError};
use crate::index::{IndexMethod, KnnQuery};
use crate::progress::Progress;
use crate::store::Reads;

/// The number of textures whose neighbours are found at a time.
const CHUNK: usize = 4096;

/// The files that are written: ids, and distances.
const FILES: [&str; 2] = ["graph.npy", "graph_distances.npy"];

impl Database {
    /// Writes the `k` nearest neighbours of every texture in the default space, as [`Database::export`] says. Returns the
    /// names of the files.
    pub(super) fn write_graph(
        &self,
        folder: &Path,
        k: usize,
        progress: &dyn Progress,
    ) -> Result<[&'static str; 2], Error> {
        if k == 0 {
            return Err(QueryError::ZeroK.into());
        }
        let (snapshot, state) = self.points_with_tree(DEFAULT_SPACE)?;
        let rows = snapshot.rows()?;
        let live: Vec<u64> = rows.live().map(|(_, id)| id).collect();
        let mut ids = NpyRows::create(&folder.join(FILES[0]), &[live.len(), k])?;
        let mut distances = NpyRows::create(&folder.join(FILES[1]), &[live.len(), k])?;
        progress.begin("neighbours", Some(live.len() as u64));
        for chunk in live.chunks(CHUNK) {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let neighbours = chunk.par_iter().map(|&id| match state.index.points().point(id) {
                Some(point) => state.index.search(&KnnQuery::nearest(point, k).exclude(id), IndexMethod::Auto),
                None => Ok(Vec::new()),
            });
            for hits in neighbours.collect::<Result<Vec<_>, _>>()? {
                let missing = k - hits.len();
                let found: Vec<i64> = hits.iter().map(|hit| hit.id as i64).collect();
                ids.push(&[found, vec![-1; missing]].concat())?;
                let found: Vec<f64> = hits.iter().map(|hit| hit.distance).collect();
                distances.push(&[found, vec![f64::NAN; missing]].concat())?;
            }
            progress.advance(chunk.len() as u64);
        }
        ids.finish()?;
        distances.finish()?;
        Ok(FILES)
    }
}
