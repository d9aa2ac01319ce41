//! [`Neighbour`]: a hit, and the order of hits.

use std::cmp::Ordering;

/// A hit: the id of a row and the distance of its point from that of the query.
///
/// Neighbours are ordered by distance, then by id. Every answer is sorted by this rule, and ties at rank `k` are broken
/// by it.
#[derive(Debug, Clone, Copy)]
pub struct Neighbour {
    /// The id of the row.
    pub id: u64,
    /// The distance, as [`crate::space::Metric::distance`] computes it.
    pub distance: f64,
}

impl Ord for Neighbour {
    fn cmp(&self, other: &Self) -> Ordering {
        self.distance.total_cmp(&other.distance).then(self.id.cmp(&other.id))
    }
}

impl PartialOrd for Neighbour {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Neighbour {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Neighbour {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_go_to_the_lower_id() {
        let mut hits = [(7, 0.5), (3, 0.5), (9, 0.25)].map(|(id, distance)| Neighbour { id, distance });
        hits.sort();
        assert_eq!(hits.map(|hit| hit.id), [9, 3, 7]);
    }
}
