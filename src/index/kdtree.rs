//! A k-d tree over keys, which finds the rows that the true distance then ranks.
//!
//! It knows the keys of rows (see `lower_bound.rs`), whose distances are lower bounds of those of their points. What answers
//! depends on how much of a point its key holds:
//!
//! * *All of it* (up to 8 coordinates): kiddo's `ImmutableKdTree` proposes the rows of the nearest keys, twice `k`, which
//!   are measured; the k-th true distance so far is a limit. If even the last proposal's bound exceeds the limit, no other
//!   row can matter and the answer is there. A sweep answers otherwise: where keys tie, or a radius is asked for.
//! * *A part of it*: a sweep, which goes through the rows in a k-d order of boxes, the nearest first (see `box_tree.rs`).
//!
//! Where a filter leaves too few, the scan takes over. The margins that make this exact in spite of rounding are derived
//! in `lower_bound.rs` and `scalar_quantisation.rs`. Rows added after the build (the tail) are scanned; rows removed after it are found and
//! passed over.
//!
//! Measured (leading coordinates of real points, k = 10, one busy core, medians of a thousand questions; the sweep alone
//! in brackets): of 4 coordinates 10 k rows take kiddo 4.5 us (22), 100 k 5.2 (26), 1 M 11 (53); of 8 coordinates 10 (23),
//! 21 (30), 107 (71); of 16 coordinates, with the norm of the rest in the key, 19 (26), 60 (43), 248 (171); of 32
//! coordinates 120 (69) at 100 k and 390 (260) at 1 M.

use std::num::NonZeroUsize;

use kiddo::{ImmutableKdTree, Manhattan, QueryResultItem, SquaredEuclidean};

use super::box_tree::{BoxTree, Entry};
use super::linear::{self, measure};
use super::lower_bound::{Probe, WIDTHS};
use super::query::TopK;
use super::scalar_quantisation;
use super::{KnnQuery, Neighbour, Points};
use crate::space::Metric;

/// The greatest number in a key that a tree takes: sums of squares stay far inside the range of `f32`.
const MAGNITUDE: f32 = (1u64 << 60) as f32;

/// A row and the distance of its key, squared for L2.
type Proposal = QueryResultItem<(), u32, f32>;

/// One kind of tree for each width of key.
enum Tree {
    Few(ImmutableKdTree<f32, { WIDTHS[0] }>),
    Many(ImmutableKdTree<f32, { WIDTHS[1] }>),
}

impl Tree {
    /// The rows of the `n` nearest keys, nearest first.
    fn nearest(&self, metric: Metric, probe: &Probe, n: usize) -> Vec<Proposal> {
        let n = NonZeroUsize::new(n).unwrap_or(NonZeroUsize::MIN);
        match self {
            Tree::Few(tree) => nearest(tree, metric, probe.key(), n),
            Tree::Many(tree) => nearest(tree, metric, probe.key(), n),
        }
    }
}

/// A tree over the rows that were live when it was built. See the module.
pub struct KdTree {
    /// Only over points that their keys hold whole.
    tree: Option<Tree>,
    packed: BoxTree,
    metric: Metric,
    rows: usize,
    lineage: u64,
}

impl KdTree {
    /// A tree over all live rows, built by the threads of the current rayon pool where rows are many.
    ///
    /// `None` where there is no live row, where a coordinate is so great (above 2^60) that its square would strain the
    /// range of `f32`, or where there are more than 16 384 coordinates: such points are scanned.
    pub fn build(points: &Points) -> Option<Self> {
        if points.is_empty() || !Self::takes(points) {
            return None;
        }
        let (tree, packed) = if points.key_width() == WIDTHS[0] {
            let (tree, packed) = grow(points)?;
            (tree.map(Tree::Few), packed)
        } else {
            let (tree, packed) = grow(points)?;
            (tree.map(Tree::Many), packed)
        };
        Some(Self { tree, packed, metric: points.metric(), rows: points.rows(), lineage: points.lineage() })
    }

    /// Whether no coordinate is too great for a tree, nor their number.
    pub(super) fn takes(points: &Points) -> bool {
        points.magnitude() <= MAGNITUDE && points.dims() <= scalar_quantisation::MOST_DIMS
    }

    /// Rows it covers: all later ones are the tail.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Whether it was built over an earlier state of these points.
    pub(super) fn fits(&self, points: &Points) -> bool {
        self.lineage == points.lineage() && self.rows <= points.rows()
    }

    /// The answer to a question that was checked, over points that the tree fits.
    pub(super) fn search(&self, points: &Points, query: &KnnQuery<'_>, effort: Effort) -> Vec<Neighbour> {
        let probe = points.probe(query.point);
        let mut best = TopK::new(query, points.len());
        let mut next = match &self.tree {
            _ if probe.key().iter().any(|value| value.abs() > MAGNITUDE) => Next::Scan,
            Some(tree) => self.propose(points, query, tree, &probe, effort, &mut best),
            None => Next::Sweep,
        };
        if matches!(next, Next::Sweep) {
            best.restart();
            next = self.sweep(points, query, &probe, effort, &mut best);
        }
        let mut from = self.rows;
        if matches!(next, Next::Scan) {
            best.restart();
            from = 0;
        }
        linear::scan(points, query, from, &mut best);
        best.into_sorted()
    }

    /// Measures the rows of the nearest keys, more of them until `k` pass the filter, and says what is left to do.
    fn propose(
        &self,
        points: &Points,
        query: &KnnQuery<'_>,
        tree: &Tree,
        probe: &Probe,
        effort: Effort,
        best: &mut TopK,
    ) -> Next {
        let most = (self.rows / effort.fraction).max(effort.floor);
        let mut wanted = best.wanted().saturating_mul(PROPOSALS_PER_HIT).max(FEWEST_PROPOSALS);
        loop {
            if wanted > most {
                return Next::Scan;
            }
            // One more than there are is never reached, and so means that all were proposed.
            wanted = wanted.min(self.rows + 1);
            let proposals = tree.nearest(self.metric, probe, wanted);
            for proposal in &proposals {
                if proposal.distance <= probe.threshold(best.limit()) {
                    measure(points, query, proposal.item as usize, best);
                }
            }
            let Some(last) = proposals.last() else { return Next::Tail };
            let threshold = probe.threshold(best.limit());
            if proposals.len() < wanted || last.distance > threshold {
                return Next::Tail;
            }
            if threshold.is_finite() {
                return Next::Sweep;
            }
            // A filter left too few: try more, in proportion to what it let through.
            let missing = best.wanted() / best.len().max(1) + 1;
            wanted = wanted.saturating_mul(missing.clamp(2, 16));
            best.restart();
        }
    }

    /// Measures all rows whose bounds are within the limit, which shrinks meanwhile, and says what is left to do: a filter
    /// may let so few through that it gives up.
    fn sweep(&self, points: &Points, query: &KnnQuery<'_>, probe: &Probe, effort: Effort, best: &mut TopK) -> Next {
        let most = (self.rows / effort.fraction).max(effort.floor);
        let mut visited = 0;
        let done = self.packed.sweep(query.point, probe, best.limit(), |row| {
            measure(points, query, row as usize, best);
            visited += 1;
            let limit = best.limit();
            (visited <= most || limit.is_finite()).then_some(limit)
        });
        if done { Next::Tail } else { Next::Scan }
    }
}

/// Proposals for each neighbour asked for; see the measurements in the module.
const PROPOSALS_PER_HIT: usize = 2;

/// Proposals at least: fewer are not quicker.
const FEWEST_PROPOSALS: usize = 20;

/// When the tree gives up: for more than `rows / fraction` rows (but not below `floor`) that a filter did not let through
/// the scan takes over.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    fraction: usize,
    floor: usize,
}

impl Effort {
    /// What is quickest.
    pub(super) const MEASURED: Self = Self { fraction: 24, floor: 64 };

    /// Never gives up: for tests, where rows are few and the tree must answer all the same.
    #[cfg(test)]
    pub(super) const ENDLESS: Self = Self { fraction: 1, floor: usize::MAX };
}

/// What is left to do.
enum Next {
    /// Only rows that the tree does not cover are left.
    Tail,
    /// All rows within the limit have to be measured.
    Sweep,
    /// All rows have to be looked at.
    Scan,
}

/// The tree of all live rows, where keys hold all of a point, and the keys packed.
fn grow<const K: usize>(points: &Points) -> Option<(Option<ImmutableKdTree<f32, K>>, BoxTree)> {
    let entries: Vec<Entry<K>> = (0..points.rows())
        .filter(|&row| points.is_live(row))
        .filter_map(|row| {
            let mut key = [0.0; K];
            points.key(row, &mut key);
            Some((u32::try_from(row).ok()?, key))
        })
        .collect();
    // Refused only for item types that are too narrow, which rows in 32 bits are not.
    let tree = if points.dims() <= K { Some(ImmutableKdTree::new_from_entries(&entries).ok()?) } else { None };
    Some((tree, BoxTree::new(points, entries)))
}

fn nearest<const K: usize>(
    tree: &ImmutableKdTree<f32, K>,
    metric: Metric,
    key: &[f32],
    n: NonZeroUsize,
) -> Vec<Proposal> {
    let Ok(key) = <&[f32; K]>::try_from(key) else { return vec![] };
    let query = tree.query(key);
    match metric {
        Metric::L2 => query.nearest_n::<SquaredEuclidean<f32>>(n).execute(),
        Metric::L1 => query.nearest_n::<Manhattan<f32>>(n).execute(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{IdFilter, Index, Method};
    use super::*;
    use proptest::prelude::*;

    fn bits(hits: &[Neighbour]) -> Vec<(u64, u64)> {
        hits.iter().map(|hit| (hit.id, hit.distance.to_bits())).collect()
    }

    /// Rows of few distinct values, so that keys tie, and of values a few units in the last place apart, so that
    /// rounding decides where it may.
    fn rows(dims: usize) -> impl Strategy<Value = Vec<Vec<f32>>> {
        (0u8..4).prop_flat_map(move |kind| {
            let value = match kind {
                0 => (-1i8..=1).prop_map(f32::from).boxed(),
                1 => (0u32..3).prop_map(|ulps| f32::from_bits(0.3f32.to_bits() + ulps)).boxed(),
                2 => prop_oneof![-1e6f32..1e6, -1e-4f32..1e-4].boxed(),
                _ => (-1.0f32..1.0).boxed(),
            };
            prop::collection::vec(prop::collection::vec(value, dims), 1..300)
        })
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(150))]

        /// The tree itself, which the doors would not use on so few rows.
        #[test]
        fn a_tree_that_never_gives_up_is_exact(
            (metric, rows) in (prop_oneof![Just(Metric::L2), Just(Metric::L1)], 1usize..40)
                .prop_flat_map(|(metric, dims)| (Just(metric), rows(dims))),
            from in 0usize..300, k in 1usize..40, share in 1u64..20, built in 0usize..300,
            gone in prop::collection::btree_set(1u64..300, 0..30),
        ) {
            let dims = rows[0].len();
            let mut points = Points::new(metric, dims).unwrap();
            let mut tree = None;
            for (row, point) in rows.iter().enumerate() {
                points.push(row as u64, point).unwrap();
                if row == built.min(rows.len() - 1) {
                    tree = KdTree::build(&points);
                }
            }
            for &id in &gone {
                points.remove(id);
            }
            let tree = tree.unwrap();
            let query = &rows[from % rows.len()];
            let radius = metric.distance(query, &rows[(from + k) % rows.len()]);
            let some = |id: u64| id.is_multiple_of(share);
            let index = Index::from_points(points.clone());
            for k in [k, usize::MAX] {
                for filter in [IdFilter::All, IdFilter::Predicate(&some)] {
                    for within in [None, Some(radius), Some(0.0)] {
                        let query = KnnQuery { point: query, k, within, filter, exclude: Some(7) };
                        let expected = index.search(&query, Method::Linear).unwrap();
                        let found = tree.search(&points, &query, Effort::ENDLESS);
                        prop_assert_eq!(bits(&found), bits(&expected), "{:?}", query);
                    }
                }
            }
        }
    }

    /// Enough rows for several groups of boxes, some of them far from all others, many of them twice.
    #[test]
    fn many_rows_are_swept_exactly() {
        const ROWS: u64 = 10_000;
        for (metric, dims) in [(Metric::L2, 12), (Metric::L1, 12), (Metric::L2, 3)] {
            let ids: Vec<u64> = (0..ROWS).collect();
            let coordinate = |row: u64, i: u64| {
                let hash = (row % 7000 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(i as u32 * 5) >> 48;
                (hash as f32 / 65536.0).powi(1 + i as i32) * if row % 500 == 3 { 40.0 } else { 1.0 }
            };
            let point = |row: u64| (0..dims).map(|i| coordinate(row, i)).collect::<Vec<f32>>();
            let rows: Vec<f32> = ids.iter().flat_map(|&row| point(row)).collect();
            let points = Points::from_rows(metric, dims as usize, &ids, &rows).unwrap();
            let tree = KdTree::build(&points).unwrap();
            let index = Index::from_points(points.clone());
            let odd = |id: u64| id % 3 == 1;
            for from in (0..ROWS).step_by(331).chain([3, 503]) {
                let mut point = point(from);
                point[1] += 0.01;
                let nearest = KnnQuery::nearest(&point, 12);
                for query in [nearest, nearest.within(0.2), nearest.filter(IdFilter::Predicate(&odd))] {
                    let expected = index.search(&query, Method::Linear).unwrap();
                    assert_eq!(bits(&tree.search(&points, &query, Effort::MEASURED)), bits(&expected));
                    assert_eq!(bits(&tree.search(&points, &query, Effort::ENDLESS)), bits(&expected));
                }
            }
        }
    }

    #[test]
    fn equal_points_are_taken() {
        let ids: Vec<u64> = (0..10_000).collect();
        let mut points = Points::from_rows(Metric::L2, 12, &ids, &vec![0.25; 120_000]).unwrap();
        points.remove(0);
        let tree = KdTree::build(&points).unwrap();
        let query = KnnQuery::nearest(&[0.25; 12], 3);
        let hits = tree.search(&points, &query, Effort::ENDLESS);
        assert_eq!(hits.iter().map(|hit| hit.id).collect::<Vec<_>>(), [1, 2, 3]);
    }

    #[test]
    fn points_out_of_range_get_no_tree() {
        let points = Points::from_rows(Metric::L2, 2, &[1, 2], &[0.0, 1.0, 1e30, 2.0]).unwrap();
        assert!(KdTree::build(&points).is_none());
        assert!(KdTree::build(&Points::new(Metric::L2, 2).unwrap()).is_none());
    }
}
