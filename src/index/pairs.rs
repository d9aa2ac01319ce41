//! Queries for all points at once: pairs of near-duplicates and the nearest-neighbour graph.

use rayon::prelude::*;

use super::{IdFilter, Index, IndexError, IndexMethod, KnnQuery, Neighbour};

/// Two live rows and their distance.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Pair {
    /// The lower id.
    pub first: u64,
    /// The higher id.
    pub second: u64,
    /// The distance, by [`super::Metric::distance`].
    pub distance: f64,
}

/// The nearest neighbours of every live row.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Graph {
    /// The live ids, ascending.
    pub ids: Vec<u64>,
    /// The neighbours of each row, nearest first, without the row itself.
    pub neighbours: Vec<Vec<Neighbour>>,
}

impl Index {
    /// All pairs of rows at most `radius` apart (inclusive), each once, ordered by the lower and then the higher id.
    ///
    /// Memory is proportional to the number of pairs, so the radius should be small.
    ///
    /// # Errors
    /// [`IndexError::Radius`].
    pub fn pairs_within(&self, radius: f64) -> Result<Vec<Pair>, IndexError> {
        let rows: Vec<(u64, &[f32])> = self.points().iter().collect();
        let pairs: Vec<Vec<Pair>> = rows
            .par_iter()
            .map(|&(id, point)| {
                // Later ids only, so that each pair is found once.
                let later = |other: u64| other > id;
                let query = KnnQuery::all_within(point, radius).filter(IdFilter::Predicate(&later));
                let mut hits = self.search(&query, self.range_method())?;
                hits.sort_unstable_by_key(|hit| hit.id);
                Ok(hits.iter().map(|hit| Pair { first: id, second: hit.id, distance: hit.distance }).collect())
            })
            .collect::<Result<_, IndexError>>()?;
        Ok(pairs.into_iter().flatten().collect())
    }

    /// The `k` nearest neighbours of every row.
    ///
    /// # Errors
    /// [`IndexError::ZeroNeighbours`].
    pub fn graph(&self, k: usize) -> Result<Graph, IndexError> {
        let rows: Vec<(u64, &[f32])> = self.points().iter().collect();
        let neighbours = rows
            .par_iter()
            .map(|&(id, point)| self.search(&KnnQuery::nearest(point, k).exclude(id), IndexMethod::Auto))
            .collect::<Result<_, _>>()?;
        Ok(Graph { ids: rows.iter().map(|&(id, _)| id).collect(), neighbours })
    }

    /// The method for a small radius: the tree, if there is one.
    fn range_method(&self) -> IndexMethod {
        if self.covered() > 0 { IndexMethod::KdTree } else { IndexMethod::Linear }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Points;
    use super::*;
    use crate::space::Metric;

    #[test]
    fn pairs_and_graph_agree_with_the_scan() {
        let ids: Vec<u64> = (0..9000).map(|row| 3 + row * 2).collect();
        // Ten rows of each of 900 places on a line a unit apart, the first pair of each a little off.
        let points: Vec<f32> = (0..9000).map(|row| (row % 900) as f32 + if row < 900 { 0.25 } else { 0.0 }).collect();
        let mut index = Index::from_points(Points::from_rows(Metric::L2, 1, &ids, &points).unwrap());
        index.remove(ids[1]);
        let scanned = index.pairs_within(0.25).unwrap();
        index.rebuild();
        let pairs = index.pairs_within(0.25).unwrap();
        assert_eq!(pairs, scanned);
        assert_eq!(pairs.len(), 899 * 45 + 36);
        assert!(pairs.iter().all(|pair| pair.first < pair.second && pair.distance <= 0.25));
        assert_eq!(index.pairs_within(0.0).unwrap().len(), 900 * 36);

        let graph = index.graph(9).unwrap();
        assert_eq!(graph.ids.len(), 8999);
        assert!(graph.neighbours.iter().zip(&graph.ids).all(|(near, id)| near.iter().all(|hit| hit.id != *id)));
        assert_eq!(graph.neighbours[0].iter().map(|hit| hit.distance).collect::<Vec<_>>(), [0.25; 9]);
    }
}
