//! [`IndexError`]: what an index refuses.

/// Why an index refuses points or a query. Nothing has changed when one is returned. Display states the fact;
/// [`IndexError::hint`] says what can be done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IndexError {
    /// The point has another number of coordinates than those of the index.
    #[error("the point has {found} coordinates, but the index has {expected}")]
    Dimensions {
        /// Coordinates of the points of the index.
        expected: usize,
        /// Coordinates of the point given.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("coordinate {position} of the point is not finite ({value})")]
    NotFinite {
        /// The position of the first such coordinate, from 0.
        position: usize,
        /// Its value.
        value: f32,
    },
    /// The ids of rows do not ascend. Ties are broken by row order, which is the order of ids.
    #[error("ids must ascend from row to row: id {id} follows id {last}")]
    IdOrder {
        /// The id of the row to be added.
        id: u64,
        /// The largest id before it.
        last: u64,
    },
    /// The coordinates are not one point for each id.
    #[error("{ids} points of {dims} coordinates were expected (got {coordinates} coordinates)")]
    Length {
        /// The number of ids given.
        ids: usize,
        /// Coordinates of a point.
        dims: usize,
        /// The number of coordinates given.
        coordinates: usize,
    },
    /// The index has as many rows as 32 bits can number.
    #[error("an index holds at most 4294967295 rows")]
    Full,
    /// Points without coordinates have no distances.
    #[error("points need at least one coordinate")]
    NoCoordinates,
    /// The number of neighbours is 0.
    #[error("the number of neighbours must be >= 1 (got 0)")]
    ZeroNeighbours,
    /// The radius is negative or NaN.
    #[error("distance must be >= 0 (got {radius})")]
    Radius {
        /// The radius given.
        radius: f64,
    },
    /// The ids that a query allows do not ascend.
    #[error("the allowed ids must ascend, but the one at position {position} does not")]
    FilterOrder {
        /// The position of the first id that is not greater than the one before it.
        position: usize,
    },
}

impl IndexError {
    /// What the caller can do, to follow the error's sentence after a colon; `None` if there is no general advice.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Dimensions { .. } => Some("map the query to a point of this space first"),
            Self::Full => Some("split the store"),
            Self::FilterOrder { .. } => Some("sort the ids and remove duplicates"),
            Self::NotFinite { .. }
            | Self::IdOrder { .. }
            | Self::Length { .. }
            | Self::NoCoordinates
            | Self::ZeroNeighbours
            | Self::Radius { .. } => None,
        }
    }
}
