//! [`KdTree`]: finds candidate rows by their keys; their distances then decide.
//!
//! Distances between keys are lower bounds of distances between points (see `lower_bound.rs`). The search depends on
//! whether a key holds the whole point:
//!
//! * *Up to 8 coordinates* it does. kiddo's `ImmutableKdTree` returns the rows of the nearest keys, twice `k`, and their
//!   distances are computed; the k-th distance is the limit. If the bound of the last candidate exceeds the limit, no
//!   other row can be a hit and the search ends. Otherwise (keys tie, or the query has a radius) a sweep follows.
//! * *With more coordinates* it does not, and the rows are searched by a sweep of the box tree (see `box_tree.rs`).
//!
//! Where a filter allows too few rows, the linear scan takes over. `lower_bound.rs` and `scalar_quantisation.rs` derive
//! the margins that make the result exact in spite of rounding. Rows added after the build (the *tail*) are scanned; rows
//! removed after the build are found and skipped.
//!
//! # Measurements
//!
//! Leading coordinates of real points, k = 10, one core under load, medians of a thousand queries, in microseconds. With 16
//! and 32 coordinates the keys of kiddo's tree contained the norm of the rest.
//!
//! | coordinates | kiddo, 10 k rows | sweep | kiddo, 100 k | sweep | kiddo, 1 M | sweep |
//! |---|---|---|---|---|---|---|
//! | 4 | 4.5 | 22 | 5.2 | 26 | 11 | 53 |
//! | 8 | 10 | 23 | 21 | 30 | 107 | 71 |
//! | 16 | 19 | 26 | 60 | 43 | 248 | 171 |
//! | 32 | | | 120 | 69 | 390 | 260 |

use std::num::NonZeroUsize;

use kiddo::{ImmutableKdTree, Manhattan, QueryResultItem, SquaredEuclidean};

use super::box_tree::{BoxTree, Entry};
use super::linear::{self, measure};
use super::lower_bound::{QueryKey, WIDTHS};
use super::scalar_quantisation;
use super::top_k::TopK;
use super::{KnnQuery, Neighbour, Points};
use crate::space::Metric;

/// The largest number in a key that a tree accepts, so that sums of squares stay within the range of `f32`.
const MAGNITUDE: f32 = (1u64 << 60) as f32;

/// A row and the distance of its key, squared for L2.
type Candidate = QueryResultItem<(), u32, f32>;

/// A tree of kiddo for each width of key.
enum Tree {
    Few(ImmutableKdTree<f32, { WIDTHS[0] }>),
    Many(ImmutableKdTree<f32, { WIDTHS[1] }>),
}

impl Tree {
    /// The rows of the `n` nearest keys, by rising distance.
    fn nearest(&self, metric: Metric, query_key: &QueryKey, n: usize) -> Vec<Candidate> {
        let n = NonZeroUsize::new(n).unwrap_or(NonZeroUsize::MIN);
        match self {
            Tree::Few(tree) => nearest(tree, metric, query_key.key(), n),
            Tree::Many(tree) => nearest(tree, metric, query_key.key(), n),
        }
    }
}

/// A tree over the rows that were live when it was built. See the module's documentation.
pub struct KdTree {
    /// Only for points of at most 8 coordinates.
    tree: Option<Tree>,
    boxes: BoxTree,
    metric: Metric,
    rows: usize,
    lineage: u64,
}

impl KdTree {
    /// Builds a tree over all live rows; many rows are sorted by the threads of the current rayon pool.
    ///
    /// `None` where no row is live, and for points that are always scanned: those with a coordinate above 2^60, whose square
    /// could leave the range of `f32`, and those of more than 16 384 coordinates.
    pub fn build(points: &Points) -> Option<Self> {
        if points.is_empty() || !Self::supports(points) {
            return None;
        }
        let (tree, boxes) = if points.key_width() == WIDTHS[0] {
            let (tree, boxes) = build(points)?;
            (tree.map(Tree::Few), boxes)
        } else {
            let (tree, boxes) = build(points)?;
            (tree.map(Tree::Many), boxes)
        };
        Some(Self { tree, boxes, metric: points.metric(), rows: points.rows(), lineage: points.lineage() })
    }

    /// Whether a tree can be built: neither a coordinate nor their number is too large.
    pub(super) fn supports(points: &Points) -> bool {
        points.magnitude() <= MAGNITUDE && points.dims() <= scalar_quantisation::MAX_DIMS
    }

    /// The number of rows it covers. Later rows are the tail.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Whether it was built over these points or an earlier state of them.
    pub(super) fn fits(&self, points: &Points) -> bool {
        self.lineage == points.lineage() && self.rows <= points.rows()
    }

    /// Answers a query that has been checked, over points that the tree belongs to.
    pub(super) fn search(&self, points: &Points, query: &KnnQuery<'_>, effort: Effort) -> Vec<Neighbour> {
        let query_key = points.query_key(query.point);
        let mut best = TopK::new(query, points.len());
        let mut next = match &self.tree {
            _ if query_key.key().iter().any(|value| value.abs() > MAGNITUDE) => Next::Scan,
            Some(tree) => self.offer_nearest(points, query, tree, &query_key, effort, &mut best),
            None => Next::Sweep,
        };
        if matches!(next, Next::Sweep) {
            best.restart();
            next = self.sweep(points, query, &query_key, effort, &mut best);
        }
        let mut from = self.rows;
        if matches!(next, Next::Scan) {
            best.restart();
            from = 0;
        }
        linear::scan(points, query, from, &mut best);
        best.into_sorted()
    }

    /// Offers the rows of the nearest keys, more of them until `k` pass the filter, and returns what remains to be done.
    fn offer_nearest(
        &self,
        points: &Points,
        query: &KnnQuery<'_>,
        tree: &Tree,
        query_key: &QueryKey,
        effort: Effort,
        best: &mut TopK,
    ) -> Next {
        let most = (self.rows / effort.fraction).max(effort.floor);
        let mut wanted = best.wanted().saturating_mul(CANDIDATES_PER_HIT).max(MIN_CANDIDATES);
        loop {
            if wanted > most {
                return Next::Scan;
            }
            // One more than there are: fewer candidates than wanted then means that all rows were candidates.
            wanted = wanted.min(self.rows + 1);
            let candidates = tree.nearest(self.metric, query_key, wanted);
            for candidate in &candidates {
                if candidate.distance <= query_key.threshold(best.limit()) {
                    measure(points, query, candidate.item as usize, best);
                }
            }
            let Some(last) = candidates.last() else { return Next::Tail };
            let threshold = query_key.threshold(best.limit());
            if candidates.len() < wanted || last.distance > threshold {
                return Next::Tail;
            }
            if threshold.is_finite() {
                return Next::Sweep;
            }
            // The filter allowed too few: try more, in proportion to the fraction that it allowed.
            let missing = best.wanted() / best.len().max(1) + 1;
            wanted = wanted.saturating_mul(missing.clamp(2, 16));
            best.restart();
        }
    }

    /// Offers all rows whose bounds are within the limit, which falls meanwhile, and returns what remains to be done. Gives
    /// up if the filter allows too few of them.
    fn sweep(
        &self,
        points: &Points,
        query: &KnnQuery<'_>,
        query_key: &QueryKey,
        effort: Effort,
        best: &mut TopK,
    ) -> Next {
        let most = (self.rows / effort.fraction).max(effort.floor);
        let mut visited = 0;
        let done = self.boxes.sweep(query.point, query_key, best.limit(), |row| {
            measure(points, query, row as usize, best);
            visited += 1;
            let limit = best.limit();
            (visited <= most || limit.is_finite()).then_some(limit)
        });
        if done { Next::Tail } else { Next::Scan }
    }
}

/// Candidates for each neighbour wanted.
const CANDIDATES_PER_HIT: usize = 2;

/// The smallest number of candidates; fewer are not faster.
const MIN_CANDIDATES: usize = 20;

/// When the tree gives up and the scan takes over: after `rows / fraction` rows, but at least `floor`, without `k` allowed
/// ones among them.
#[derive(Clone, Copy)]
pub(super) struct Effort {
    fraction: usize,
    floor: usize,
}

impl Effort {
    /// The fastest by measurement.
    pub(super) const MEASURED: Self = Self { fraction: 24, floor: 64 };

    /// Never gives up: for tests with few rows.
    #[cfg(test)]
    pub(super) const ENDLESS: Self = Self { fraction: 1, floor: usize::MAX };
}

/// What remains to be done.
enum Next {
    /// Scan the rows that the tree does not cover.
    Tail,
    /// Sweep all rows within the limit.
    Sweep,
    /// Scan all rows.
    Scan,
}

/// The trees of all live rows: kiddo's, if keys hold the whole point, and the box tree.
fn build<const K: usize>(points: &Points) -> Option<(Option<ImmutableKdTree<f32, K>>, BoxTree)> {
    let entries: Vec<Entry<K>> = (0..points.rows())
        .filter(|&row| points.is_live(row))
        .filter_map(|row| {
            let mut key = [0.0; K];
            points.key(row, &mut key);
            Some((u32::try_from(row).ok()?, key))
        })
        .collect();
    // Fails only for item types that are too narrow for the number of rows; 32 bits are not.
    let tree = if points.dims() <= K { Some(ImmutableKdTree::new_from_entries(&entries).ok()?) } else { None };
    Some((tree, BoxTree::new(points, entries)))
}

fn nearest<const K: usize>(
    tree: &ImmutableKdTree<f32, K>,
    metric: Metric,
    key: &[f32],
    n: NonZeroUsize,
) -> Vec<Candidate> {
    let Ok(key) = <&[f32; K]>::try_from(key) else { return vec![] };
    let query = tree.query(key);
    match metric {
        Metric::L2 => query.nearest_n::<SquaredEuclidean<f32>>(n).execute(),
        Metric::L1 => query.nearest_n::<Manhattan<f32>>(n).execute(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::{IdFilter, Index, IndexMethod};
    use super::*;
    use proptest::prelude::*;

    fn bits(hits: &[Neighbour]) -> Vec<(u64, u64)> {
        hits.iter().map(|hit| (hit.id, hit.distance.to_bits())).collect()
    }

    /// Rows of few distinct values, so that keys tie, or of values a few units in the last place apart, so that rounding
    /// matters.
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

        /// The tree itself, which an index would not use for so few rows.
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
                        let expected = index.search(&query, IndexMethod::Linear).unwrap();
                        let found = tree.search(&points, &query, Effort::ENDLESS);
                        prop_assert_eq!(bits(&found), bits(&expected), "{:?}", query);
                    }
                }
            }
        }
    }

    /// Enough rows for several groups of boxes; some rows are far from all others, many occur twice.
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
                    let expected = index.search(&query, IndexMethod::Linear).unwrap();
                    assert_eq!(bits(&tree.search(&points, &query, Effort::MEASURED)), bits(&expected));
                    assert_eq!(bits(&tree.search(&points, &query, Effort::ENDLESS)), bits(&expected));
                }
            }
        }
    }

    #[test]
    fn equal_points_are_accepted() {
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
