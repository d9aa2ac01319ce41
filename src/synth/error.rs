//! Errors of recipes.

use super::{ParameterLimits, ParameterRange};

/// Why a recipe is invalid. The message says where, what was found and what was expected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecipeError {
    /// The text is not TOML, or lacks the structure of a recipe.
    #[error("line {line} of the recipe: {message}")]
    Syntax {
        /// The line, counted from 1.
        line: usize,
        /// The parser's message.
        message: String,
    },
    /// A group names an unknown family.
    #[error("group {group:?} names the unknown family {family:?}; known: {known}")]
    UnknownFamily {
        /// The group.
        group: String,
        /// The family that was found.
        family: String,
        /// All families, separated by commas.
        known: String,
    },
    /// A group sets a parameter that its family lacks.
    #[error("group {group:?} sets {parameter:?}, but the family {family:?} has no such parameter; it has: {known}")]
    UnknownParameter {
        /// The group.
        group: String,
        /// Its family.
        family: String,
        /// The parameter that was found.
        parameter: String,
        /// The family's parameters, separated by commas.
        known: String,
    },
    /// A range is reversed, not finite, or outside its limits.
    #[error("{place} sets {what} to {found}; expected {limits}, lower end first")]
    InvalidRange {
        /// `group "..."` or `the recipe`.
        place: String,
        /// The parameter or amount.
        what: String,
        /// The range that was found.
        found: ParameterRange,
        /// The limits.
        limits: ParameterLimits,
    },
    /// A group asks for tiling, but its family cannot tile.
    #[error("group {group:?} asks for tiling, but the family {family:?} cannot tile; families that can: {known}")]
    CannotTile {
        /// The group.
        group: String,
        /// Its family.
        family: String,
        /// The families that tile, separated by commas.
        known: String,
    },
    /// A side is too short or too long, or there are too many voxels.
    #[error(
        "{place} asks for textures of {} x {} x {} voxels (Z, Y, X); expected sides of 3 to {longest} and at most {voxels} voxels",
        shape[0], shape[1], shape[2]
    )]
    InvalidSize {
        /// `group "..."` or `the recipe`.
        place: String,
        /// The shape that was found.
        shape: [f64; 3],
        /// The longest side.
        longest: u64,
        /// The most voxels of a texture.
        voxels: u64,
    },
    /// The recipe has no textures, or too many.
    #[error("the recipe has {found} textures; expected 1 to {limit}")]
    TextureCount {
        /// The number found.
        found: u128,
        /// The most.
        limit: u64,
    },
    /// The name of a recipe or group cannot be part of a file name.
    #[error("invalid name {name:?}: expected 1 to 64 of the characters a-z, 0-9, - and _")]
    InvalidName {
        /// The name that was found.
        name: String,
    },
    /// Two groups have the same name.
    #[error("two groups are named {name:?}; names must differ, because they seed the random numbers")]
    DuplicateName {
        /// The name.
        name: String,
    },
    /// There is no built-in recipe of this name.
    #[error("there is no built-in recipe {name:?}; there are: {known}")]
    UnknownBuiltin {
        /// The name.
        name: String,
        /// All names, separated by commas.
        known: String,
    },
}
