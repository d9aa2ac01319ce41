//! What can be wrong with points and questions.

/// Why an index refuses points or a question. Nothing is changed and nothing half-answered when one is returned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IndexError {
    /// A point has another number of coordinates than the index.
    #[error(
        "the point has {found} coordinates, but the points of this index have {expected}: map it by the same space first"
    )]
    Dimensions {
        /// Coordinates that the index has.
        expected: usize,
        /// Coordinates that the point has.
        found: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("coordinate {position} of the point is {value}, but distances need finite numbers")]
    NotFinite {
        /// The first such coordinate, from 0.
        position: usize,
        /// What stands there.
        value: f32,
    },
    /// Ids must ascend from row to row, for row order is what ties are resolved by.
    #[error("id {id} does not come after id {last} of the row before it: ids ascend and are never given again")]
    IdOrder {
        /// The id that was to be added.
        id: u64,
        /// The greatest id there is.
        last: u64,
    },
    /// The coordinates are not a whole number of points, one for each id.
    #[error("{coordinates} coordinates are not {ids} points of {dims}")]
    Length {
        /// Ids given.
        ids: usize,
        /// Coordinates of a point.
        dims: usize,
        /// Coordinates given.
        coordinates: usize,
    },
    /// An index of more rows than 32 bits can number.
    #[error("an index holds at most 4294967295 rows: split the store")]
    Full,
    /// Points without coordinates have no distances.
    #[error("points need at least one coordinate")]
    NoCoordinates,
    /// `k` is 0.
    #[error("the number of neighbours asked for is 0: ask for at least 1")]
    ZeroNeighbours,
    /// The radius is negative or NaN.
    #[error("the radius is {radius}, but a distance is 0 or more")]
    Radius {
        /// The radius given.
        radius: f64,
    },
    /// The ids that a question allows are not sorted, or one stands there twice.
    #[error("the allowed ids do not ascend at position {position}: sort them and leave each once")]
    AllowedOrder {
        /// The first id that is not greater than the one before it.
        position: usize,
    },
}
