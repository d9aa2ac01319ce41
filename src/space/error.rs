//! What can be wrong with moments, definitions and stored bytes.

use crate::hlac::View;

/// Why something is no feature, statistic or space.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpaceError {
    /// A moment is not finite or not in [0, 1].
    #[error(
        "moment {mask} of {view} is {value}, but moments are finite numbers from 0 to 1: describe the texture anew"
    )]
    NotAMoment {
        /// The view.
        view: View,
        /// The mask's letters.
        mask: String,
        /// What was found.
        value: f32,
    },
    /// A feature set without views.
    #[error("a space needs at least one view")]
    NoViews,
    /// A space's name that cannot be a name.
    #[error("{found:?} is no name for a space: take 1 to 64 letters, digits, '-' or '_'")]
    Name {
        /// What was found.
        found: String,
    },
    /// Too few or too many coordinates.
    #[error("a space has 1 to {limit} coordinates, not {found}")]
    Dims {
        /// What was asked for.
        found: usize,
        /// The most there can be.
        limit: usize,
    },
    /// A nuisance weight that is no weight.
    #[error("a nuisance weight is a finite number from 0 on, not {found}")]
    Weight {
        /// What was asked for.
        found: f64,
    },
    /// Features or statistics of another feature set than the one that is needed.
    #[error("these are features of {found}, but {expected} is needed")]
    FeatureSet {
        /// The feature set that is needed.
        expected: String,
        /// The feature set that was given.
        found: String,
    },
    /// More was taken away than was ever added.
    #[error(
        "a texture was taken from the statistics of {feature_set} that they do not hold: rebuild them with reindex"
    )]
    Overdrawn {
        /// The feature set of the statistics.
        feature_set: String,
    },
    /// Stored bytes that are not what they should be.
    #[error("the stored {what} cannot be read ({found}): rebuild it with reindex")]
    Damaged {
        /// What was to be read.
        what: &'static str,
        /// What is wrong.
        found: &'static str,
    },
    /// Stored bytes of another version.
    #[error(
        "the stored {what} is of version {found}, but this program reads version {supported}: use a newer hlacdb or rebuild it with reindex"
    )]
    Version {
        /// What was to be read.
        what: &'static str,
        /// The version found.
        found: u16,
        /// The version that is read.
        supported: u16,
    },
}
