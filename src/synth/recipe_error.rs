//! What can be wrong with a recipe.

use super::{Limits, Range};

/// Why a text is no recipe. The sentence says where, what was found, what was expected and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RecipeError {
    /// The text is not TOML, or not of the form of a recipe.
    #[error("line {line} of the recipe: {message}")]
    Form {
        /// The line, from 1.
        line: usize,
        /// What the parser says.
        message: String,
    },
    /// A group names a family that is not known.
    #[error("group {group:?} asks for the family {family:?}, which is not known; known: {known}")]
    Family {
        /// The group.
        group: String,
        /// The family that was found.
        family: String,
        /// All families, separated by commas.
        known: String,
    },
    /// A group sets a parameter that its family lacks.
    #[error("group {group:?} sets {parameter:?}, but the family {family:?} has no such parameter; it has: {known}")]
    Parameter {
        /// The group.
        group: String,
        /// Its family.
        family: String,
        /// The parameter that was found.
        parameter: String,
        /// The family's parameters, separated by commas.
        known: String,
    },
    /// A range is empty, not finite, or goes beyond the limits.
    #[error("{place} sets {what} to {found}, but it must lie within {limits}, lower end first")]
    Range {
        /// `group "..."` or `the recipe`.
        place: String,
        /// The parameter or amount.
        what: String,
        /// The range that was found.
        found: Range,
        /// The limits.
        limits: Limits,
    },
    /// A family that cannot tile is asked to.
    #[error("group {group:?} asks the family {family:?} to tile, but it cannot; these can: {known}")]
    Tile {
        /// The group.
        group: String,
        /// Its family.
        family: String,
        /// The families that tile, separated by commas.
        known: String,
    },
    /// A side is too short or too long, or there are too many voxels.
    #[error(
        "{place} asks for textures of {} x {} x {} voxels (Z, Y, X), but sides are 3 to {longest} and all voxels at most {voxels}",
        shape[0], shape[1], shape[2]
    )]
    Size {
        /// `group "..."` or `the recipe`.
        place: String,
        /// The shape that was found.
        shape: [f64; 3],
        /// The longest side.
        longest: u64,
        /// The most voxels.
        voxels: u64,
    },
    /// The recipe asks for no texture, or for too many.
    #[error("the recipe asks for {found} textures, but 1 to {limit} can be had")]
    Count {
        /// How many were asked for.
        found: u128,
        /// The most.
        limit: u64,
    },
    /// A recipe's or group's name cannot be part of a file name.
    #[error("{name:?} is no name: use 1 to 64 of the letters a-z, digits, - and _")]
    Name {
        /// The name that was found.
        name: String,
    },
    /// Two groups have the same name.
    #[error("two groups are named {name:?}: give each a name of its own, since names seed the draws")]
    Twice {
        /// The name.
        name: String,
    },
    /// There is no built-in recipe of this name.
    #[error("there is no built-in recipe {name:?}; there are: {known}")]
    Builtin {
        /// The name that was asked for.
        name: String,
        /// All names, separated by commas.
        known: String,
    },
}
