//! [`KnnQuery`]: the point, the number of neighbours, and the filter of a search.

use std::fmt;

use super::IndexError;

/// Which rows may be hits. The filter is applied before `k`: the answer is the `k` nearest of the allowed rows.
#[derive(Clone, Copy, Default)]
#[non_exhaustive]
pub enum IdFilter<'a> {
    /// All rows.
    #[default]
    All,
    /// The rows with one of these ids, which must ascend. Ids that the index does not contain are ignored.
    Ids(&'a [u64]),
    /// The rows for whose id the predicate is true. It is called for few rows (those near enough to be hits), from any
    /// thread, and must always give the same answer for the same id.
    Predicate(&'a (dyn Fn(u64) -> bool + Sync)),
}

impl IdFilter<'_> {
    /// Whether the filter allows this id.
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

/// A k-nearest-neighbours query: the points nearest to a point.
///
/// ```
/// use hlacdb::internals::index::{Index, IndexMethod, KnnQuery};
/// use hlacdb::space::Metric;
/// let mut index = Index::new(Metric::L2, 2)?;
/// for (id, point) in [(1, [0.0, 0.0]), (2, [1.0, 0.0]), (3, [5.0, 0.0])] {
///     index.push(id, &point)?;
/// }
/// let hits = index.search(&KnnQuery::nearest(&[0.0, 0.0], 10).within(2.0).exclude(1), IndexMethod::Auto)?;
/// assert_eq!((hits.len(), hits[0].id, hits[0].distance), (1, 2, 1.0));
/// # Ok::<(), hlacdb::IndexError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct KnnQuery<'a> {
    /// The point: finite coordinates, as many as the points of the index have.
    pub point: &'a [f32],
    /// The largest number of neighbours, >= 1. There is no upper limit: `usize::MAX` means all.
    pub k: usize,
    /// The largest distance of a neighbour (inclusive); no limit if `None`.
    pub within: Option<f64>,
    /// The rows that may be hits.
    pub filter: IdFilter<'a>,
    /// A row that may not be a hit: that of the query itself.
    pub exclude: Option<u64>,
}

impl<'a> KnnQuery<'a> {
    /// A query for the `k` nearest points.
    pub fn nearest(point: &'a [f32], k: usize) -> Self {
        Self { point, k, within: None, filter: IdFilter::All, exclude: None }
    }

    /// A query for all points at most `radius` away.
    pub fn all_within(point: &'a [f32], radius: f64) -> Self {
        Self::nearest(point, usize::MAX).within(radius)
    }

    /// Sets the largest distance of a neighbour (inclusive).
    pub fn within(self, radius: f64) -> Self {
        Self { within: Some(radius), ..self }
    }

    /// Sets the filter.
    pub fn filter(self, filter: IdFilter<'a>) -> Self {
        Self { filter, ..self }
    }

    /// Excludes one row.
    pub fn exclude(self, id: u64) -> Self {
        Self { exclude: Some(id), ..self }
    }

    /// Refuses an invalid query.
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
            return Err(IndexError::FilterOrder { position: position + 1 });
        }
        Ok(())
    }

    /// Whether the row with this id may be a hit.
    #[inline]
    pub(super) fn admits(&self, id: u64) -> bool {
        self.exclude != Some(id) && self.filter.allows(id)
    }
}

/// Refuses a point of another length or with a coordinate that is not finite.
pub(super) fn check_point(point: &[f32], dims: usize) -> Result<(), IndexError> {
    if point.len() != dims {
        return Err(IndexError::Dimensions { expected: dims, found: point.len() });
    }
    match point.iter().position(|v| !v.is_finite()) {
        Some(position) => Err(IndexError::NotFinite { position, value: point[position] }),
        None => Ok(()),
    }
}
