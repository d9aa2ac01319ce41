//! Points with or without a tree over them: the door of this room.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use rayon::prelude::*;

use super::question::{Allowed, Best};
use super::{IndexError, KdTree, Metric, Neighbour, Points, Question, linear};

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

/// Fewer live rows than this need no tree: the scan answers as quickly.
const TREE_ROWS: usize = 2048;

/// Asking for more than this fraction of the rows, the scan is quicker.
const TREE_FRACTION: usize = 64;

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

    /// Whether [`Index::rebuild`] is due; see [`should_rebuild`].
    pub fn should_rebuild(&self) -> bool {
        should_rebuild(self.covered(), self.tail(), self.points.removed())
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

    /// What [`Method::Auto`] comes to for this question; the other two are returned as they are.
    ///
    /// The tree answers where there is one over most rows, at least 2048 rows are live, `k` is at most 1/64 of them (and
    /// a radius, which may let in anything, is not all that bounds the answer), and the filter is none or a predicate or a
    /// list of at least 1/8 of the rows. Everything else is the scan's.
    pub fn choose(&self, question: &Question<'_>, method: Method) -> Method {
        if method != Method::Auto {
            return method;
        }
        let rows = self.points.len();
        let few_asked = question.k <= rows / TREE_FRACTION;
        let broad = match question.allowed {
            Allowed::Ids(ids) => ids.len() >= rows / 8,
            Allowed::All | Allowed::When(_) => true,
        };
        if self.tree.is_some() && rows >= TREE_ROWS && self.tail() <= rows / 2 && few_asked && broad {
            Method::KdTree
        } else {
            Method::Linear
        }
    }

    /// The neighbours that the question asks for, nearest first, ties by id; empty where there are none.
    pub fn search(&self, question: &Question<'_>, method: Method) -> Result<Vec<Neighbour>, IndexError> {
        question.check(self.points.dims())?;
        match (self.choose(question, method), &self.tree) {
            (Method::KdTree, Some(tree)) => Ok(tree.search(&self.points, question)),
            _ => {
                let mut best = Best::new(question, self.points.len());
                linear::scan(&self.points, question, 0, &mut best);
                Ok(best.into_sorted())
            }
        }
    }

    /// Many questions, shared between the threads of the current rayon pool; answers in the order of the questions.
    ///
    /// The first refused question makes the whole call fail.
    pub fn search_all(&self, questions: &[Question<'_>], method: Method) -> Result<Vec<Vec<Neighbour>>, IndexError> {
        questions.par_iter().map(|question| self.search(question, method)).collect()
    }
}

/// Whether a tree should be built anew: `covered` rows are in it, `tail` rows came after, `removed` of all are tombstones.
///
/// The tail is let grow to 2048 rows (a scan of microseconds) and to 1/8 of the tree; tombstones to 1/4 of all rows. So
/// every row takes part in a bounded number of builds for each doubling of the store.
pub fn should_rebuild(covered: usize, tail: usize, removed: usize) -> bool {
    tail > TREE_ROWS.max(covered / 8) || too_many_removed(covered + tail, removed)
}

/// Whether tombstones should be dropped: they are more than 2048 and more than 1/4 of all rows.
fn too_many_removed(rows: usize, removed: usize) -> bool {
    removed > TREE_ROWS.max(rows / 4)
}
