//! [`TopK`]: the nearest neighbours found so far.

use std::collections::BinaryHeap;

use super::{KnnQuery, Neighbour};

/// The nearest neighbours found so far: at most `k`, none farther than the radius.
pub(super) struct TopK {
    k: usize,
    radius: f64,
    heap: BinaryHeap<Neighbour>,
}

impl TopK {
    /// No neighbours yet, of a search over at most `rows`.
    pub(super) fn new(query: &KnnQuery<'_>, rows: usize) -> Self {
        let k = query.k.min(rows);
        // Queries with a radius have a huge k but few hits: memory for more is allocated as they come.
        let heap = BinaryHeap::with_capacity(k.min(1024) + 1);
        Self { k, radius: query.within.unwrap_or(f64::INFINITY), heap }
    }

    /// The largest distance that can still enter. A neighbour at this very distance enters if its id is lower.
    #[inline]
    pub(super) fn limit(&self) -> f64 {
        match self.heap.peek() {
            Some(worst) if self.heap.len() >= self.k => worst.distance.min(self.radius),
            _ => self.radius,
        }
    }

    /// Removes all neighbours but keeps the limit: the caller offers every row again.
    pub(super) fn restart(&mut self) {
        self.radius = self.limit();
        self.heap.clear();
    }

    /// The number of neighbours wanted.
    pub(super) fn wanted(&self) -> usize {
        self.k
    }

    /// The number of neighbours found.
    pub(super) fn len(&self) -> usize {
        self.heap.len()
    }

    /// Inserts a neighbour if it is among the nearest `k` within the radius.
    #[inline]
    pub(super) fn offer(&mut self, neighbour: Neighbour) {
        if neighbour.distance > self.radius || self.k == 0 {
            return;
        }
        if self.heap.len() < self.k {
            self.heap.push(neighbour);
        } else if let Some(mut worst) = self.heap.peek_mut()
            && neighbour < *worst
        {
            *worst = neighbour;
        }
    }

    /// The neighbours, nearest first.
    pub(super) fn into_sorted(self) -> Vec<Neighbour> {
        self.heap.into_sorted_vec()
    }
}
