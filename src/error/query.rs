//! Errors of queries.

use std::fmt;

use crate::TextureId;
use crate::hlac::View;
use crate::index::IndexError;

/// Why a query, or another question about likeness, has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum QueryError {
    /// The number of hits asked for is 0.
    #[error("k must be >= 1 (got 0)")]
    ZeroK,
    /// The query has no example.
    #[error("the query has no example: no volume, no texture and no moments")]
    NoExample,
    /// The distance is negative or NaN.
    #[error("distance must be >= 0 (got {found})")]
    Distance {
        /// The distance given.
        found: f64,
    },
    /// The store has no space of this name.
    #[error("there is no space '{name}'; the spaces of the store: {}", spaces.join(", "))]
    NoSuchSpace {
        /// The name given.
        name: String,
        /// The names of the store's spaces.
        spaces: Vec<String>,
    },
    /// The example has moments of none of the views that the space uses.
    #[error("the space '{space}' needs moments of {}, but {example} has none of them", names(needs))]
    MissingViews {
        /// The space.
        space: String,
        /// The views that the space uses.
        needs: Vec<View>,
        /// The example.
        example: ExampleKind,
    },
    /// Fewer than two textures carry the tag that is to be evaluated.
    #[error("fewer than two textures carry the tag '{key}'")]
    TooFewLabels {
        /// The key of the tag.
        key: String,
    },
    /// All textures that carry the tag have the same value, so every hit would be correct.
    #[error(
        "all {textures} textures that carry the tag '{key}' have the value '{value}', so every hit would be correct"
    )]
    SingleLabel {
        /// The key of the tag.
        key: String,
        /// Its one value.
        value: String,
        /// The number of textures that carry it.
        textures: usize,
    },
    /// No two textures that carry the tag have the same value, so no hit could be correct.
    #[error(
        "no two of the {textures} textures that carry the tag '{key}' have the same value, so no hit could be correct"
    )]
    UniqueLabels {
        /// The key of the tag.
        key: String,
        /// The number of textures that carry it.
        textures: usize,
    },
    /// The index refuses the point or the query.
    #[error(transparent)]
    Index(#[from] IndexError),
}

/// What a query's example is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExampleKind {
    /// The stored texture of this id.
    Texture(TextureId),
    /// A volume.
    Volume,
    /// A descriptor that the caller gave.
    Descriptor,
}

impl fmt::Display for ExampleKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Texture(id) => write!(f, "texture {id}"),
            Self::Volume => f.write_str("the volume"),
            Self::Descriptor => f.write_str("the descriptor"),
        }
    }
}

/// The names of views, separated by commas.
pub(super) fn names(views: &[View]) -> String {
    views.iter().map(|view| view.name()).collect::<Vec<_>>().join(", ")
}
