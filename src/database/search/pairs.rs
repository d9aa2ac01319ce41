//! Questions about all textures at once: pairs that are nearly the same, and everybody's nearest neighbours.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;
use serde::Serialize;

use crate::TextureId;
use crate::database::exchange::arrays::NpyRows;
use crate::database::handle::Database;
use crate::database::scheme::DEFAULT_SPACE;
use crate::error::{Error, QueryError};
use crate::index::{IndexMethod, KnnQuery};
use crate::progress::Progress;
use crate::store::Reads;

/// Two textures that lie near one another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NearPair {
    /// The lower id.
    pub first: TextureId,
    /// The higher id.
    pub second: TextureId,
    /// How far their points are apart.
    pub distance: f64,
    /// The name of the first.
    pub first_name: String,
    /// The name of the second.
    pub second_name: String,
}

/// Textures nearer than this in the space `default` are near-duplicates, unless another distance is said: a hundredth of
/// the way between two points that have nothing in common (unit points at right angles are 1.41 apart), about what a
/// little noise or a cut border does.
pub const DUPLICATE_DISTANCE: f64 = 0.015;

/// So many textures are asked for between two looks at the progress.
const TOGETHER: usize = 4096;

impl Database {
    /// All pairs of textures at most `within` apart (inclusive; [`DUPLICATE_DISTANCE`] where it is `None`) in a space, by
    /// falling likeness, ties by ids. Memory grows with the number of pairs.
    ///
    /// # Errors
    /// [`QueryError::Distance`], [`QueryError::NoSuchSpace`], [`Error::Store`].
    pub fn near_pairs(&self, space: Option<&str>, within: Option<f64>) -> Result<Vec<NearPair>, Error> {
        let radius = within.unwrap_or(DUPLICATE_DISTANCE);
        if radius.is_nan() || radius < 0.0 {
            return Err(QueryError::Distance { found: radius }.into());
        }
        let (snapshot, state) = self.points_with_tree(space.unwrap_or(DEFAULT_SPACE))?;
        let mut pairs = state.index.pairs_within(radius)?;
        pairs.sort_by(|a, b| {
            a.distance.total_cmp(&b.distance).then(a.first.cmp(&b.first)).then(a.second.cmp(&b.second))
        });
        let mut ids: Vec<u64> = pairs.iter().flat_map(|pair| [pair.first, pair.second]).collect();
        ids.sort_unstable();
        ids.dedup();
        let records = snapshot.records_of(&ids)?.into_iter().flatten();
        let names: BTreeMap<u64, String> = records.map(|record| (record.id, record.name)).collect();
        let name = |id: u64| names.get(&id).cloned().unwrap_or_default();
        Ok(pairs
            .into_iter()
            .map(|pair| NearPair {
                first: pair.first.into(),
                second: pair.second.into(),
                distance: pair.distance,
                first_name: name(pair.first),
                second_name: name(pair.second),
            })
            .collect())
    }

    /// Writes the `k` nearest neighbours of every texture in the default space: `graph.npy` (N, k), their ids (`i64`,
    /// nearest first, ties by id, itself left out, -1 where there are fewer), and `graph_distances.npy` (N, k), how far away
    /// they are (`f64`, NaN there). Rows are in id order, as in `textures.csv`.
    ///
    /// # Errors
    /// [`QueryError::ZeroK`], [`Error::Io`], [`Error::Store`], [`Error::Cancelled`].
    pub(crate) fn write_graph(
        &self,
        folder: &Path,
        k: usize,
        progress: &dyn Progress,
    ) -> Result<[&'static str; 2], Error> {
        const FILES: [&str; 2] = ["graph.npy", "graph_distances.npy"];
        if k == 0 {
            return Err(QueryError::ZeroK.into());
        }
        let (snapshot, state) = self.points_with_tree(DEFAULT_SPACE)?;
        let rows = snapshot.rows()?;
        let live: Vec<u64> = rows.live().map(|(_, id)| id).collect();
        let mut ids = NpyRows::create(&folder.join(FILES[0]), &[live.len(), k])?;
        let mut distances = NpyRows::create(&folder.join(FILES[1]), &[live.len(), k])?;
        progress.begin("neighbours", Some(live.len() as u64));
        for some in live.chunks(TOGETHER) {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let near = some.par_iter().map(|&id| match state.index.points().point(id) {
                Some(point) => state.index.search(&KnnQuery::nearest(point, k).exclude(id), IndexMethod::Auto),
                None => Ok(Vec::new()),
            });
            for near in near.collect::<Result<Vec<_>, _>>()? {
                let missing = k - near.len();
                let found: Vec<i64> = near.iter().map(|hit| hit.id as i64).collect();
                ids.push(&[found, vec![-1; missing]].concat())?;
                let found: Vec<f64> = near.iter().map(|hit| hit.distance).collect();
                distances.push(&[found, vec![f64::NAN; missing]].concat())?;
            }
            progress.advance(some.len() as u64);
        }
        ids.finish()?;
        distances.finish()?;
        Ok(FILES)
    }
}
