//! [`SpaceError`]: what can be wrong with moments, definitions and stored bytes.

use crate::hlac::View;

/// Why moments, a definition, statistics or a space are refused. Display states the fact; [`SpaceError::hint`] says
/// what can be done.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpaceError {
    /// A moment is not finite or not in [0, 1].
    #[error("moment {mask} of {view} is {value}: moments are finite numbers from 0 to 1")]
    NotAMoment {
        /// The view.
        view: View,
        /// The mask's letters.
        mask: String,
        /// The number given.
        value: f32,
    },
    /// A descriptor has two rows of moments for one view.
    #[error("the moments of {view} are given twice")]
    DuplicateView {
        /// The view.
        view: View,
    },
    /// A feature set has no views.
    #[error("a space needs at least one view")]
    NoViews,
    /// The name of a space is empty, too long or has other characters than those allowed.
    #[error("the name of a space has 1 to 64 letters, digits, '-' or '_' (got {found:?})")]
    Name {
        /// The name given.
        found: String,
    },
    /// A likeness space has too few or too many dimensions.
    #[error("a space has 1 to {limit} dimensions (got {found})")]
    Dims {
        /// The number given.
        found: usize,
        /// The largest number allowed.
        limit: usize,
    },
    /// A nuisance weight is negative or not finite.
    #[error("a nuisance weight must be finite and >= 0 (got {found})")]
    Weight {
        /// The weight given.
        found: f64,
    },
    /// Features or statistics belong to another feature set than the one needed.
    #[error("feature set {expected} is needed (got {found})")]
    FeatureSet {
        /// The key of the feature set needed.
        expected: String,
        /// The key of the feature set given, or what was given in its place.
        found: String,
    },
    /// More textures were removed from statistics than had been added.
    #[error("the statistics of {feature_set} do not contain the texture to be removed")]
    Overdrawn {
        /// The key of the statistics' feature set.
        feature_set: String,
    },
    /// Stored bytes are damaged.
    #[error("the stored {what} cannot be read: {found}")]
    Damaged {
        /// What the bytes should hold, e.g. `space`.
        what: &'static str,
        /// What is wrong with them.
        found: &'static str,
    },
    /// Stored bytes have a version that this version of hlacdb does not read.
    #[error("the stored {what} has version {found}, but version {supported} is supported")]
    Version {
        /// What the bytes should hold, e.g. `space`.
        what: &'static str,
        /// The version of the bytes.
        found: u16,
        /// The version that is read.
        supported: u16,
    },
}

impl SpaceError {
    /// What the caller can do, to follow the error's sentence after a colon; `None` if there is no general advice.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::NotAMoment { .. } => Some("describe the texture again"),
            Self::Overdrawn { .. } | Self::Damaged { .. } => Some("rebuild statistics and spaces from the textures"),
            Self::Version { .. } => Some("use a newer hlacdb, or rebuild statistics and spaces from the textures"),
            Self::DuplicateView { .. }
            | Self::NoViews
            | Self::Name { .. }
            | Self::Dims { .. }
            | Self::Weight { .. }
            | Self::FeatureSet { .. } => None,
        }
    }
}
