//! Points with or without a tree over them: the door of this room.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use rayon::prelude::*;

use super::kdtree::Effort;
use super::top_k::TopK;
use super::{IdFilter, IndexError, KdTree, KnnQuery, Neighbour, Points, linear};
use crate::space::Metric;

/// How a question is answered. The answer is the same; only the time differs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Method {
    /// The quicker of the two, by the rule of [`Index::choose`].
    #[default]
    Auto,
    /// Every row is looked at.
    Linear,
    /// The tree proposes; falls back to the scan where there is no tree or it cannot help.
    KdTree,
}

impl Method {
    /// `auto`, `linear` or `kdtree`.
    pub fn name(self) -> &'static str {
        match self {
            Method::Auto => "auto",
            Method::Linear => "linear",
            Method::KdTree => "kdtree",
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A name that no method has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no index {0:?}: use auto, linear or kdtree")]
pub struct UnknownMethod(String);

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        match name {
            "auto" => Ok(Method::Auto),
            "linear" => Ok(Method::Linear),
            "kdtree" => Ok(Method::KdTree),
            _ => Err(UnknownMethod(name.to_owned())),
        }
    }
}

/// Fewer live rows than this need no tree: the scan answers as quickly (15 us).
const TREE_ROWS: usize = 4096;

/// Asking for more than this fraction of the rows, the scan is as quick.
const TREE_FRACTION: usize = 100;

/// Building a tree costs as much as this number of scans of its rows.
const SCANS_PER_BUILD: u128 = 250;

/// Rows of a tail that are scanned in a few microseconds, whatever the size of the tree.
const SMALL_TAIL: usize = 2048;

/// Points, and a tree over the first of them where one was built. A clone is a snapshot that shares all memory.
#[derive(Clone)]
pub struct Index {
    points: Points,
    tree: Option<Arc<KdTree>>,
}

impl Index {
    /// An index of no rows.
    pub fn new(metric: Metric, dims: usize) -> Result<Self, IndexError> {
        Ok(Self::from_points(Points::new(metric, dims)?))
    }

    /// An index of these points, without a tree as yet.
    pub fn from_points(points: Points) -> Self {
        Self { points, tree: None }
    }

    /// The rows.
    pub fn points(&self) -> &Points {
        &self.points
    }

    /// Adds a row to the tail; see [`Points::push`].
    pub fn push(&mut self, id: u64, point: &[f32]) -> Result<(), IndexError> {
        self.points.push(id, point)
    }

    /// Takes a row out; see [`Points::remove`].
    pub fn remove(&mut self, id: u64) -> bool {
        self.points.remove(id)
    }

    /// Rows that the tree covers, tombstones since it was built included; 0 without a tree.
    pub fn covered(&self) -> usize {
        self.tree.as_ref().map_or(0, |tree| tree.rows())
    }

    /// Rows that came after the tree was built and are scanned.
    pub fn tail(&self) -> usize {
        self.points.rows() - self.covered()
    }

    /// Whether [`Index::rebuild`] is due; see [`should_rebuild`]. Never for points that no tree takes.
    pub fn should_rebuild(&self) -> bool {
        KdTree::supports(&self.points) && should_rebuild(self.covered(), self.tail(), self.points.removed())
    }

    /// Builds a tree over all live rows (in parallel), after dropping the tombstones where they are many.
    pub fn rebuild(&mut self) {
        if self.needs_compaction() {
            self.points = self.points.compacted();
            self.tree = None;
        }
        self.tree = KdTree::build(&self.points).map(Arc::new);
    }

    /// Whether tombstones are so many that the next build should drop them.
    pub(super) fn needs_compaction(&self) -> bool {
        too_many_removed(self.points.rows(), self.points.removed())
    }

    /// Takes a tree that was built elsewhere, over an earlier snapshot of these points. False (and nothing changed)
    /// where it belongs to other points or covers no more than the present one.
    pub fn install(&mut self, tree: Arc<KdTree>) -> bool {
        let fits = tree.fits(&self.points) && (self.tree.is_none() || tree.rows() > self.covered());
        if fits {
            self.tree = Some(tree);
        }
        fits
    }

    /// Whether building a tree first is quicker than answering `queries` queries with what there is, each of which would be
    /// answered by the tree.
    ///
    /// A query scans the rows that no tree covers. Building a tree costs as much as about 250 scans of all its rows
    /// (0.12 s against 0.5 ms at 100 000 rows), and what it then answers costs little.
    pub fn is_build_worthwhile(&self, queries: usize) -> bool {
        let scanned = queries as u128 * self.tail() as u128;
        self.should_rebuild() && scanned >= SCANS_PER_BUILD * self.points.len() as u128
    }

    /// Whether a tree over these rows would answer a query for `k` neighbours.
    pub fn suits_tree(&self, k: usize) -> bool {
        self.points.len() >= TREE_ROWS && k <= self.points.len() / TREE_FRACTION
    }

    /// Takes over what [`Index::rebuild`] made of `before`, an earlier state of this index: the tree, and the points if
    /// tombstones were dropped. Rows that came or went since then come and go in them as well.
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
                // What these points hold was accepted once; if it is refused now, they stay as they are.
                return;
            }
        }
        *self = built;
    }

    /// What [`Method::Auto`] comes to for this question; the other two are returned as they are.
    ///
    /// The tree answers where there is one over at least half of the rows, at least 4096 rows are live, `k` is at most
    /// 1/100 of them, and the filter is none, a predicate, or a list of at least 1/8 of the rows (a shorter list is looked
    /// up id by id). Everything else is the scan's.
    pub fn choose(&self, query: &KnnQuery<'_>, method: Method) -> Method {
        if method != Method::Auto {
            return method;
        }
        let rows = self.points.len();
        let broad = match query.filter {
            IdFilter::Ids(ids) => ids.len() >= rows / linear::GATHER_FRACTION,
            IdFilter::All | IdFilter::Predicate(_) => true,
        };
        if self.tree.is_some() && self.suits_tree(query.k) && self.tail() <= rows / 2 && broad {
            Method::KdTree
        } else {
            Method::Linear
        }
    }

    /// The neighbours that the question asks for, nearest first, ties by id; empty where there are none.
    pub fn search(&self, query: &KnnQuery<'_>, method: Method) -> Result<Vec<Neighbour>, IndexError> {
        query.check(self.points.dims())?;
        match (self.choose(query, method), &self.tree) {
            (Method::KdTree, Some(tree)) => Ok(tree.search(&self.points, query, Effort::MEASURED)),
            _ => {
                let mut best = TopK::new(query, self.points.len());
                linear::scan(&self.points, query, 0, &mut best);
                Ok(best.into_sorted())
            }
        }
    }

    /// Many questions, shared between the threads of the current rayon pool; answers in the order of the questions.
    ///
    /// The first refused question makes the whole call fail.
    pub fn search_all(&self, queries: &[KnnQuery<'_>], method: Method) -> Result<Vec<Vec<Neighbour>>, IndexError> {
        queries.par_iter().map(|query| self.search(query, method)).collect()
    }
}

/// Whether a tree should be built anew: `covered` rows are in it, `tail` rows came after, `removed` of all are tombstones.
///
/// The tail may grow to 2048 rows and to 1/32 of the tree, tombstones to 1/4 of all rows; fewer than 4096 rows get no
/// tree. A store that grows row by row so spends about 32 builds of its final size on its trees, 8 s for a million rows.
pub fn should_rebuild(covered: usize, tail: usize, removed: usize) -> bool {
    let rows = covered + tail;
    let long_tail = tail > SMALL_TAIL.max(covered / 32) && rows - removed.min(rows) >= TREE_ROWS;
    long_tail || too_many_removed(rows, removed)
}

/// Whether tombstones should be dropped: they are more than 2048 and more than 1/4 of all rows.
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
        assert_eq!(index.choose(&nearest, Method::Auto), Method::Linear);
        index.rebuild();
        assert_eq!(index.choose(&nearest, Method::Auto), Method::KdTree);
        assert_eq!(index.choose(&nearest, Method::Linear), Method::Linear);
        assert_eq!(index.choose(&KnnQuery::nearest(&point, 101), Method::Auto), Method::Linear);
        assert_eq!(index.choose(&nearest.filter(IdFilter::Ids(&[1, 2, 3])), Method::Auto), Method::Linear);
        let even = |id: u64| id.is_multiple_of(2);
        assert_eq!(index.choose(&nearest.filter(IdFilter::Predicate(&even)), Method::Auto), Method::KdTree);
    }

    #[test]
    fn refusals() {
        let mut index = line(3);
        let ask = |query: KnnQuery<'_>| line(3).search(&query, Method::Auto).unwrap_err();
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
        assert!(Index::new(Metric::L2, 4).unwrap().search(&KnnQuery::nearest(&[0.0; 4], 5), Method::Auto).is_ok());
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
        let before = index.search(&query, Method::Linear).unwrap();
        let old_tree = Arc::new(KdTree::build(index.points()).unwrap());
        index.rebuild();
        assert_eq!((index.points().rows(), index.points().removed(), index.tail()), (3001, 0, 0));
        assert!(!index.install(old_tree), "a tree over rows that are gone");
        for method in [Method::Linear, Method::KdTree] {
            assert_eq!(index.search(&query, method).unwrap(), before);
        }
    }

    /// Threads ask while one adds and trees are built behind: every answer is that of some whole state.
    #[test]
    fn questions_go_on_while_rows_come_and_go() {
        let shared = Arc::new(SharedIndex::new((), line(9000)));
        std::thread::scope(|threads| {
            for _ in 0..2 {
                threads.spawn(|| {
                    for _ in 0..200 {
                        let snapshot = &shared.snapshot().index;
                        // Rows come and go in pairs at 0.25 and 0.75: one without the other is a state between.
                        let hits = snapshot.search(&KnnQuery::all_within(&[0.5], 0.25), Method::Auto).unwrap();
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

    /// Rows that come and go while tombstones are dropped and a tree is built are in the result as well.
    #[test]
    fn a_build_takes_in_what_changed_meanwhile() {
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
            let hits = expected.search(&query, Method::Linear).unwrap();
            assert_eq!(index.search(&query, Method::Linear).unwrap(), hits);
            assert_eq!(index.search(&query, Method::KdTree).unwrap(), hits);
        }
    }

    #[test]
    fn a_build_is_worthwhile_for_many_queries_over_many_uncovered_rows() {
        let mut index = line(10_000);
        assert!(!index.is_build_worthwhile(249) && index.is_build_worthwhile(250));
        assert!(index.suits_tree(100) && !index.suits_tree(101));
        index.rebuild();
        assert!(!index.is_build_worthwhile(1_000_000));
        (10_001..=13_000).for_each(|id| index.push(id, &[id as f32]).unwrap());
        assert!(!index.is_build_worthwhile(1000) && index.is_build_worthwhile(1100));
        assert!(!line(4000).is_build_worthwhile(1_000_000), "few rows are scanned");
    }
}
