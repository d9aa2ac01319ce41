//! Questions about all points at once: near-duplicates and the graph of nearest neighbours.

use rayon::prelude::*;

use super::{Index, IndexError, Method, Neighbour, Question};

/// Two live rows and their distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// The lower id.
    pub first: u64,
    /// The higher id.
    pub second: u64,
    /// The distance, by [`super::Metric::distance`].
    pub distance: f64,
}

/// The nearest neighbours of every live row.
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    /// The live ids, ascending.
    pub ids: Vec<u64>,
    /// For each of them its neighbours, nearest first, itself left out.
    pub neighbours: Vec<Vec<Neighbour>>,
}

impl Index {
    /// All pairs of rows at most `radius` apart (inclusive), each once, ordered by the lower and then the higher id.
    ///
    /// Memory grows with the number of pairs: choose a small radius.
    pub fn pairs_within(&self, radius: f64) -> Result<Vec<Pair>, IndexError> {
        let rows: Vec<(u64, &[f32])> = self.points().iter().collect();
        let pairs: Vec<Vec<Pair>> = rows
            .par_iter()
            .map(|&(id, point)| {
                // Only later ids: each pair is found once.
                let later = |other: u64| other > id;
                let question = Question::all_within(point, radius).allowed(super::Allowed::When(&later));
                let mut hits = self.search(&question, self.range_method())?;
                hits.sort_unstable_by_key(|hit| hit.id);
                Ok(hits.iter().map(|hit| Pair { first: id, second: hit.id, distance: hit.distance }).collect())
            })
            .collect::<Result<_, IndexError>>()?;
        Ok(pairs.into_iter().flatten().collect())
    }

    /// The `k` nearest neighbours of every row.
    pub fn graph(&self, k: usize) -> Result<Graph, IndexError> {
        let rows: Vec<(u64, &[f32])> = self.points().iter().collect();
        let neighbours = rows
            .par_iter()
            .map(|&(id, point)| self.search(&Question::nearest(point, k).exclude(id), Method::Auto))
            .collect::<Result<_, _>>()?;
        Ok(Graph { ids: rows.iter().map(|&(id, _)| id).collect(), neighbours })
    }

    /// The method for a radius that is small by intent: the tree where there is one.
    fn range_method(&self) -> Method {
        if self.covered() > 0 { Method::KdTree } else { Method::Linear }
    }
}
