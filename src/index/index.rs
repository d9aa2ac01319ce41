//! [`Index`]: points with or without a tree over them.

use std::sync::Arc;

use rayon::prelude::*;

use super::kdtree::Effort;
use super::top_k::TopK;
use super::{IdFilter, IndexError, IndexMethod, KdTree, KnnQuery, Neighbour, Plan, Points, linear, plan};
use crate::space::Metric;

/// With fewer live rows the scan is as fast as a tree (15 us).
const TREE_ROWS: usize = 4096;

/// For more neighbours than this fraction of the rows the scan is as fast as a tree.
const TREE_FRACTION: usize = 100;

/// A tail of this many rows is scanned in a few microseconds, whatever the size of the tree.
const SMALL_TAIL: usize = 2048;

/// Points, and a tree over the first of them if one was built. A clone is a snapshot that shares memory.
#[derive(Clone)]
pub struct Index {
    points: Points,
    tree: Option<Arc<KdTree>>,
}

impl Index {
    /// An index without rows.
    ///
    /// # Errors
    /// [`IndexError::NoCoordinates`] if `dims` is 0.
    pub fn new(metric: Metric, dims: usize) -> Result<Self, IndexError> {
        Ok(Self::from_points(Points::new(metric, dims)?))
    }

    /// An index of these points, without a tree.
    pub fn from_points(points: Points) -> Self {
        Self { points, tree: None }
    }

    /// The points.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// Adds a row to the tail; see [`Points::push`].
    ///
    /// # Errors
    /// As [`Points::push`].
    pub fn push(&mut self, id: u64, point: &[f32]) -> Result<(), IndexError> {
        self.points.push(id, point)
    }

    /// Removes a row; see [`Points::remove`].
    pub fn remove(&mut self, id: u64) -> bool {
        self.points.remove(id)
    }

    /// The number of rows that the tree covers, including rows removed after it was built; 0 without a tree.
    pub fn covered(&self) -> usize {
        self.tree.as_ref().map_or(0, |tree| tree.rows())
    }

    /// The number of rows that the tree does not cover, which are scanned.
    pub fn tail(&self) -> usize {
        self.points.rows() - self.covered()
    }

    /// Whether [`Index::rebuild`] is due; see [`should_rebuild`]. Never for points that no tree supports.
    pub fn should_rebuild(&self) -> bool {
        KdTree::supports(&self.points) && should_rebuild(self.covered(), self.tail(), self.points.removed())
    }

    /// Builds a tree over all live rows, in parallel. If there are many tombstones, they are dropped first.
    pub fn rebuild(&mut self) {
        if self.needs_compaction() {
            self.points = self.points.compacted();
            self.tree = None;
        }
        self.tree = KdTree::build(&self.points).map(Arc::new);
    }

    /// Whether the next build should drop the tombstones.
    pub(super) fn needs_compaction(&self) -> bool {
        too_many_removed(self.points.rows(), self.points.removed())
    }

    /// Installs a tree that was built over an earlier snapshot of these points. False, and nothing has changed, if it
    /// belongs to other points or covers no more rows than the present tree.
    pub fn install(&mut self, tree: Arc<KdTree>) -> bool {
        let fits = tree.fits(&self.points) && (self.tree.is_none() || tree.rows() > self.covered());
        if fits {
            self.tree = Some(tree);
        }
        fits
    }

    /// Whether `queries` queries, each of which suits a tree, are answered faster if a tree is built first; see [`plan`].
    pub fn is_build_worthwhile(&self, queries: usize) -> bool {
        let plan = plan(queries, self.points.rows(), self.covered(), self.points.dims());
        self.should_rebuild() && plan == Plan::BuildTree
    }

    /// Whether a tree over these rows would answer a query for `k` neighbours faster than a scan.
    pub fn suits_tree(&self, k: usize) -> bool {
        self.points.len() >= TREE_ROWS && k <= self.points.len() / TREE_FRACTION
    }

    /// Adopts `built`, which [`Index::rebuild`] made of `before`, an earlier state of this index: its tree and, if
    /// tombstones were dropped, its points. Rows added or removed since `before` are added to and removed from them.
    pub(super) fn adopt(&mut self, mut built: Self, before: &Self) {
        if let Some(tree) = built.tree.as_ref().filter(|tree| tree.fits(&self.points)) {
            self.install(Arc::clone(tree));
            return;
        }
        if before.points.lineage() != self.points.lineage() {
            return;
        }
        if self.points.removed() > before.points.removed() {
            let gone = built.points.iter().map(|(id, _)| id).filter(|&id| self.points.find(id).is_none());
            for id in gone.collect::<Vec<_>>() {
                built.remove(id);
            }
        }
        for row in (before.points.rows()..self.points.rows()).filter(|&row| self.points.is_live(row)) {
            if built.push(self.points.id(row), self.points.row(row)).is_err() {
                // Rows that were accepted before are accepted again; if not, this index stays as it is.
                return;
            }
        }
        *self = built;
    }

    /// The method by which [`IndexMethod::Auto`] answers this query; other methods are returned unchanged.
    ///
    /// The tree answers if it covers at least half of the rows, at least 4096 rows are live, `k` is at most 1/100 of them,
    /// and the filter is not a list of less than 1/8 of the rows (which is looked up id by id). Otherwise the scan does.
    pub fn choose(&self, query: &KnnQuery<'_>, method: IndexMethod) -> IndexMethod {
        if method != IndexMethod::Auto {
            return method;
        }
        let rows = self.points.len();
        let broad = match query.filter {
            IdFilter::Ids(ids) => ids.len() >= rows / linear::GATHER_FRACTION,
            IdFilter::All | IdFilter::Predicate(_) => true,
        };
        if self.tree.is_some() && self.suits_tree(query.k) && self.tail() <= rows / 2 && broad {
            IndexMethod::KdTree
        } else {
            IndexMethod::Linear
        }
    }

    /// The neighbours that the query asks for, by rising distance, then by id. No hits are no error.
    ///
    /// # Errors
    /// [`IndexError::Dimensions`], [`IndexError::NotFinite`], [`IndexError::ZeroNeighbours`], [`IndexError::Radius`],
    /// [`IndexError::FilterOrder`].
    pub fn search(&self, query: &KnnQuery<'_>, method: IndexMethod) -> Result<Vec<Neighbour>, IndexError> {
        query.check(self.points.dims())?;
        match (self.choose(query, method), &self.tree) {
            (IndexMethod::KdTree, Some(tree)) => Ok(tree.search(&self.points, query, Effort::MEASURED)),
            _ => {
                let mut best = TopK::new(query, self.points.len());
                linear::scan(&self.points, query, 0, &mut best);
                Ok(best.into_sorted())
            }
        }
    }

    /// Answers many queries with the threads of the current rayon pool, in the order of the queries.
    ///
    /// # Errors
    /// As [`Index::search`]: one invalid query makes the call fail.
    pub fn search_all(&self, queries: &[KnnQuery<'_>], method: IndexMethod) -> Result<Vec<Vec<Neighbour>>, IndexError> {
        queries.par_iter().map(|query| self.search(query, method)).collect()
    }
}

/// Whether a tree should be rebuilt that covers `covered` rows and does not cover `tail` later ones, if `removed` of all
/// rows are tombstones.
///
/// A rebuild is due when the tail exceeds 2048 rows and 1/32 of the tree, with at least 4096 live rows, or when tombstones
/// exceed 2048 and 1/4 of all rows. A store that grows row by row thus spends about 32 builds of its final size on trees.
pub fn should_rebuild(covered: usize, tail: usize, removed: usize) -> bool {
    let rows = covered + tail;
    let long_tail = tail > SMALL_TAIL.max(covered / 32) && rows - removed.min(rows) >= TREE_ROWS;
    long_tail || too_many_removed(rows, removed)
}

/// Whether tombstones should be dropped: if they exceed 2048 and 1/4 of all rows.
fn too_many_removed(rows: usize, removed: usize) -> bool {
    removed > SMALL_TAIL.max(rows / 4)
}

#[cfg(test)]
mod tests {
    use super::super::{CHUNK_ROWS, SharedIndex};
    use super::*;

    fn line(rows: usize) -> Index {
        let ids: Vec<u64> = (1..=rows as u64).collect();
        let points: Vec<f32> = ids.iter().map(|&id| id as f32).collect();
        Index::from_points(Points::from_rows(Metric::L1, 1, &ids, &points).unwrap())
    }

    #[test]
    fn rebuilds_are_due_by_the_rule() {
        assert!(!should_rebuild(0, 4095, 0));
        assert!(should_rebuild(0, 4096, 0));
        assert!(!should_rebuild(100_000, 3125, 0));
        assert!(should_rebuild(100_000, 3126, 0));
        assert!(should_rebuild(100_000, 0, 25_001));
        assert!(!should_rebuild(4000, 0, 2048));
    }

    #[test]
    fn the_tree_is_chosen_for_few_neighbours_among_many_rows() {
        let mut index = line(10_000);
        let point = [5.0];
        let nearest = KnnQuery::nearest(&point, 10);
        assert_eq!(index.choose(&nearest, IndexMethod::Auto), IndexMethod::Linear);
        index.rebuild();
        assert_eq!(index.choose(&nearest, IndexMethod::Auto), IndexMethod::KdTree);
        assert_eq!(index.choose(&nearest, IndexMethod::Linear), IndexMethod::Linear);
        assert_eq!(index.choose(&KnnQuery::nearest(&point, 101), IndexMethod::Auto), IndexMethod::Linear);
        assert_eq!(index.choose(&nearest.filter(IdFilter::Ids(&[1, 2, 3])), IndexMethod::Auto), IndexMethod::Linear);
        let even = |id: u64| id.is_multiple_of(2);
        assert_eq!(index.choose(&nearest.filter(IdFilter::Predicate(&even)), IndexMethod::Auto), IndexMethod::KdTree);
    }

    #[test]
    fn refusals() {
        let mut index = line(3);
        let ask = |query: KnnQuery<'_>| line(3).search(&query, IndexMethod::Auto).unwrap_err();
        assert_eq!(ask(KnnQuery::nearest(&[1.0, 2.0], 1)), IndexError::Dimensions { expected: 1, found: 2 });
        assert!(matches!(ask(KnnQuery::nearest(&[f32::NAN], 1)), IndexError::NotFinite { position: 0, .. }));
        assert_eq!(ask(KnnQuery::nearest(&[1.0], 0)), IndexError::ZeroNeighbours);
        assert_eq!(ask(KnnQuery::all_within(&[1.0], -1.0)), IndexError::Radius { radius: -1.0 });
        let unsorted = KnnQuery::nearest(&[1.0], 1).filter(IdFilter::Ids(&[2, 2]));
        assert_eq!(ask(unsorted), IndexError::FilterOrder { position: 1 });
        assert_eq!(index.push(3, &[1.0]), Err(IndexError::IdOrder { id: 3, last: 3 }));
        assert!(matches!(index.push(4, &[f32::INFINITY]), Err(IndexError::NotFinite { .. })));
        assert_eq!(Index::new(Metric::L2, 0).err(), Some(IndexError::NoCoordinates));
        assert_eq!(
            Points::from_rows(Metric::L2, 2, &[1, 2], &[0.0; 3]).err(),
            Some(IndexError::Length { ids: 2, dims: 2, coordinates: 3 })
        );
        assert!(Index::new(Metric::L2, 4).unwrap().search(&KnnQuery::nearest(&[0.0; 4], 5), IndexMethod::Auto).is_ok());
        // Nothing of the refused rows stayed.
        assert_eq!(index.points().rows(), 3);
    }

    #[test]
    fn a_snapshot_does_not_change() {
        let mut index = line(CHUNK_ROWS + 5);
        let before = index.clone();
        index.push(5000, &[0.5]).unwrap();
        assert!(index.remove(1));
        assert!(!index.remove(1));
        assert_eq!((before.points().len(), index.points().len()), (CHUNK_ROWS + 5, CHUNK_ROWS + 5));
        assert_eq!((before.points().point(1), index.points().point(1)), (Some(&[1.0f32][..]), None));
        assert_eq!(index.points().point(5000), Some(&[0.5f32][..]));
        assert_eq!(before.points().find(5000), None);
    }

    #[test]
    fn compaction_keeps_the_answer() {
        let mut index = line(9000);
        (1..6000).for_each(|id| assert!(index.remove(id)));
        assert!(index.should_rebuild());
        let query = KnnQuery::nearest(&[5990.0], 20);
        let before = index.search(&query, IndexMethod::Linear).unwrap();
        let old_tree = Arc::new(KdTree::build(index.points()).unwrap());
        index.rebuild();
        assert_eq!((index.points().rows(), index.points().removed(), index.tail()), (3001, 0, 0));
        assert!(!index.install(old_tree), "a tree over rows that are gone");
        for method in [IndexMethod::Linear, IndexMethod::KdTree] {
            assert_eq!(index.search(&query, method).unwrap(), before);
        }
    }

    /// Threads search while another adds rows and trees are built: every answer is that of some whole state.
    #[test]
    fn searches_go_on_while_rows_are_added_and_removed() {
        let shared = Arc::new(SharedIndex::new((), line(9000)));
        std::thread::scope(|threads| {
            for _ in 0..2 {
                threads.spawn(|| {
                    for _ in 0..200 {
                        let snapshot = &shared.snapshot().index;
                        // Rows are added and removed in pairs, at 0.25 and 0.75: an odd number is a state in between.
                        let hits = snapshot.search(&KnnQuery::all_within(&[0.5], 0.25), IndexMethod::Auto).unwrap();
                        assert_eq!(hits.len() % 2, 0);
                    }
                });
            }
            for pair in 0..300u64 {
                let changed = shared.update(|(), index| {
                    let id = 10_000 + pair * 2;
                    index.push(id, &[0.25])?;
                    index.push(id + 1, &[0.75])?;
                    if pair >= 5 {
                        assert!(index.remove(id - 10) && index.remove(id - 9));
                    }
                    Ok::<(), IndexError>(())
                });
                changed.unwrap();
                shared.build_in_background();
            }
        });
        while shared.is_building() {
            std::thread::yield_now();
        }
        assert!(shared.snapshot().index.covered() >= 9000);
    }

    #[test]
    fn an_update_that_fails_changes_nothing() {
        let shared = SharedIndex::new(0, line(10));
        let failed = shared.update(|owner, index| {
            *owner = 1;
            index.push(11, &[1.0])?;
            index.push(11, &[1.0])
        });
        assert_eq!(failed, Err(IndexError::IdOrder { id: 11, last: 11 }));
        assert_eq!((shared.snapshot().owner, shared.snapshot().index.points().rows()), (0, 10));
    }

    /// Rows added and removed while tombstones are dropped and a tree is built are added to and removed from the result.
    #[test]
    fn a_build_adopts_what_changed_meanwhile() {
        let mut before = line(9000);
        (1..6000).for_each(|id| assert!(before.remove(id)));
        let mut built = before.clone();
        built.rebuild();
        let mut index = before.clone();
        assert!(index.remove(7000) && index.remove(9000));
        index.push(9001, &[0.5]).unwrap();
        index.push(9002, &[7000.0]).unwrap();
        assert!(index.remove(9001));
        let expected = index.clone();
        index.adopt(built, &before);
        assert_eq!((index.points().len(), index.covered()), (expected.points().len(), 3001));
        assert!(index.points().removed() <= 2, "{}", index.points().removed());
        for at in [0.5, 7000.0, 9000.0] {
            let point = [at];
            let query = KnnQuery::nearest(&point, 30);
            let hits = expected.search(&query, IndexMethod::Linear).unwrap();
            assert_eq!(index.search(&query, IndexMethod::Linear).unwrap(), hits);
            assert_eq!(index.search(&query, IndexMethod::KdTree).unwrap(), hits);
        }
    }

    #[test]
    fn a_build_is_worthwhile_for_many_queries_over_many_uncovered_rows() {
        let mut index = line(10_000);
        assert!(!index.is_build_worthwhile(400) && index.is_build_worthwhile(500));
        assert!(index.suits_tree(100) && !index.suits_tree(101));
        index.rebuild();
        assert!(!index.is_build_worthwhile(1_000_000));
        (10_001..=13_000).for_each(|id| index.push(id, &[id as f32]).unwrap());
        assert!(!index.is_build_worthwhile(1000) && index.is_build_worthwhile(1200));
        assert!(!line(4000).is_build_worthwhile(1_000_000), "few rows are scanned");
    }
}
