//! Pairs of textures that are nearly the same.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::TextureId;
use crate::database::handle::Database;
use crate::database::scheme::DEFAULT_SPACE;
use crate::error::{Error, QueryError};
use crate::store::Reads;

/// Two textures whose points are near one another.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct NearPair {
    /// The lower id.
    pub first: TextureId,
    /// The higher id.
    pub second: TextureId,
    /// The distance of their points.
    pub distance: f64,
    /// The name of the first.
    pub first_name: String,
    /// The name of the second.
    pub second_name: String,
}

/// The default distance up to which [`Database::near_pairs`] takes two textures as near-duplicates. In the space `default`,
/// two points that have nothing in common are 1.41 apart; this is about a hundredth of that, which a little noise or a cut
/// border causes.
pub const DUPLICATE_DISTANCE: f64 = 0.015;

impl Database {
    /// All pairs of textures whose distance in a space (by default [`DEFAULT_SPACE`]) is at most `within` (by default
    /// [`DUPLICATE_DISTANCE`]), by ascending distance, ties by ids. Memory grows with the number of pairs.
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
}
