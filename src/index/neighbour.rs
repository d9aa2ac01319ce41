//! [`Neighbour`]: the one way in which hits are ordered.

use std::cmp::Ordering;

/// One hit: a texture's id and how far its point lies from the one asked for.
///
/// Neighbours are ordered by distance, then by id: the rule by which every answer is sorted and by which ties at rank
/// `k` are resolved.
#[derive(Debug, Clone, Copy)]
pub struct Neighbour {
    /// The id that the row was added with.
    pub id: u64,
    /// The distance, by [`super::Metric::distance`].
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
