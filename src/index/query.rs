//! What is asked, and the collector that keeps the best answers.

use std::collections::BinaryHeap;
use std::fmt;

use super::{IndexError, Neighbour};

/// Which rows may be hits. A filter comes before `k`: the answer is the `k` nearest of the allowed ones.
#[derive(Clone, Copy, Default)]
pub enum IdFilter<'a> {
    /// All of them.
    #[default]
    All,
    /// Those with one of these ids, ascending. Ids that the index does not have are passed over.
    Ids(&'a [u64]),
    /// Those for whose id this is true. It is called for few rows (those that would be hits), from any thread, and
    /// must always answer the same.
    Predicate(&'a (dyn Fn(u64) -> bool + Sync)),
}

impl IdFilter<'_> {
    /// Whether this id may be a hit.
    #[inline]
    pub fn allows(&self, id: u64) -> bool {
        match self {
            IdFilter::All => true,
            IdFilter::Ids(ids) => ids.binary_search(&id).is_ok(),
            IdFilter::Predicate(test) => test(id),
        }
    }
}

impl fmt::Debug for IdFilter<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            IdFilter::All => f.write_str("All"),
            IdFilter::Ids(ids) => write!(f, "Ids({})", ids.len()),
            IdFilter::Predicate(_) => f.write_str("Predicate"),
        }
    }
}

/// A question: which points are nearest to this one?
///
/// ```
/// use hlacdb::index::{Index, KnnQuery, Method};
/// use hlacdb::space::Metric;
/// let mut index = Index::new(Metric::L2, 2)?;
/// for (id, point) in [(1, [0.0, 0.0]), (2, [1.0, 0.0]), (3, [5.0, 0.0])] {
///     index.push(id, &point)?;
/// }
/// let hits = index.search(&KnnQuery::nearest(&[0.0, 0.0], 10).within(2.0).exclude(1), Method::Auto)?;
/// assert_eq!((hits.len(), hits[0].id, hits[0].distance), (1, 2, 1.0));
/// # Ok::<(), hlacdb::index::IndexError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct KnnQuery<'a> {
    /// The point: as many finite coordinates as the index has.
    pub point: &'a [f32],
    /// How many neighbours at most, from 1; there is no ceiling, `usize::MAX` asks for all.
    pub k: usize,
    /// Only neighbours at most this far away (inclusive).
    pub within: Option<f64>,
    /// Only these, filtered before `k`.
    pub filter: IdFilter<'a>,
    /// Not this one: the texture that the question is about.
    pub exclude: Option<u64>,
}

impl<'a> KnnQuery<'a> {
    /// The `k` nearest points.
    pub fn nearest(point: &'a [f32], k: usize) -> Self {
        Self { point, k, within: None, filter: IdFilter::All, exclude: None }
    }

    /// All points at most `radius` away.
    pub fn all_within(point: &'a [f32], radius: f64) -> Self {
        Self::nearest(point, usize::MAX).within(radius)
    }

    /// The same question, hits at most `radius` away (inclusive).
    pub fn within(self, radius: f64) -> Self {
        Self { within: Some(radius), ..self }
    }

    /// The same question about fewer rows.
    pub fn filter(self, filter: IdFilter<'a>) -> Self {
        Self { filter, ..self }
    }

    /// The same question without this row.
    pub fn exclude(self, id: u64) -> Self {
        Self { exclude: Some(id), ..self }
    }

    /// Refuses what has no answer, before any work is done.
    pub(super) fn check(&self, dims: usize) -> Result<(), IndexError> {
        check_point(self.point, dims)?;
        if self.k == 0 {
            return Err(IndexError::ZeroNeighbours);
        }
        if let Some(radius) = self.within
            && (radius.is_nan() || radius < 0.0)
        {
            return Err(IndexError::Radius { radius });
        }
        if let IdFilter::Ids(ids) = self.filter
            && let Some(position) = ids.windows(2).position(|pair| pair[0] >= pair[1])
        {
            return Err(IndexError::AllowedOrder { position: position + 1 });
        }
        Ok(())
    }

    /// Whether the filter, the excluded id aside, lets this row through.
    #[inline]
    pub(super) fn admits(&self, id: u64) -> bool {
        self.exclude != Some(id) && self.filter.allows(id)
    }
}

/// Refuses a point of the wrong length or with a coordinate that is not finite.
pub(super) fn check_point(point: &[f32], dims: usize) -> Result<(), IndexError> {
    if point.len() != dims {
        return Err(IndexError::Dimensions { expected: dims, found: point.len() });
    }
    match point.iter().position(|v| !v.is_finite()) {
        Some(position) => Err(IndexError::NotFinite { position, value: point[position] }),
        None => Ok(()),
    }
}

/// The best neighbours so far: at most `k`, none farther than the radius.
pub(super) struct TopK {
    k: usize,
    radius: f64,
    heap: BinaryHeap<Neighbour>,
}

impl TopK {
    /// Nothing found yet, out of at most `rows`.
    pub(super) fn new(query: &KnnQuery<'_>, rows: usize) -> Self {
        let k = query.k.min(rows);
        // A radius usually leaves few: memory for a huge k is taken only as hits come.
        let heap = BinaryHeap::with_capacity(k.min(1024) + 1);
        Self { k, radius: query.within.unwrap_or(f64::INFINITY), heap }
    }

    /// No neighbour farther than this can still come in; one at this very distance may, by a lower id.
    #[inline]
    pub(super) fn limit(&self) -> f64 {
        match self.heap.peek() {
            Some(worst) if self.heap.len() >= self.k => worst.distance.min(self.radius),
            _ => self.radius,
        }
    }

    /// Forgets what was found but not how far away it was: nothing beyond the limit reached can come in, and every
    /// row that belongs to the answer is to be offered again.
    pub(super) fn restart(&mut self) {
        self.radius = self.limit();
        self.heap.clear();
    }

    /// How many are looked for.
    pub(super) fn wanted(&self) -> usize {
        self.k
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.heap.len()
    }

    /// Takes a neighbour in, if it is one of the best.
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
