//! Solid textures made from recipes: noise, families of textures, data sets.
//!
//! Vocabulary: a *family* is a way to paint a texture (marble, foam, gyroid), with named *parameters*; a *recipe* is a
//! TOML file that asks for so many textures of some families, their parameters fixed or drawn from ranges; a
//! *specimen* is one texture of a recipe: cheap until its voxels are asked for; a *nuisance* changes a volume in a way
//! that should not matter (brightness, contrast, gamma, noise, turns).
//!
//! Invariant: a recipe with its seed gives the same bytes everywhere: on every CPU, in any order, on any thread. All
//! arithmetic is written out (`f32`/`f64` with + - * / and roots, which IEEE 754 fixes, and the `libm` crate for the
//! rest). Imports only [`crate::volume`].
//!
//! ```
//! use hlacdb::synth::Recipe;
//! let recipe = Recipe::parse(r#"
//!     name = "two"
//!     seed = 7
//!     size = 16
//!     [[group]]
//!     family = "marble"
//!     count = 2
//! "#)?;
//! for specimen in recipe.specimens() {
//!     println!("{} {:?}", specimen.name, specimen.volume().shape());
//! }
//! # Ok::<(), hlacdb::synth::RecipeError>(())
//! ```

pub mod families;
mod field;
mod fractal;
pub mod noise;
pub mod nuisance;
mod random;
mod recipe;
mod recipe_error;
mod specimen;
mod turn;

pub use field::Field;
pub use fractal::{Fold, Fractal};
pub use nuisance::{Distortion, Nuisance, UnknownNuisance};
pub use recipe::{Group, Limits, Range, Recipe};
pub use recipe_error::RecipeError;
pub use specimen::Specimen;
pub use turn::Turn;

/// The recipes that are built in: name and TOML text.
const BUILTIN: [(&str, &str); 4] = [
    ("paper600", include_str!("../../datasets/paper600.toml")),
    ("families", include_str!("../../datasets/families.toml")),
    ("wide", include_str!("../../datasets/wide.toml")),
    ("prior", include_str!("../../datasets/prior.toml")),
];

/// The TOML text of a built-in recipe: one of [`builtin_names`].
pub fn builtin(name: &str) -> Option<&'static str> {
    BUILTIN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The names of the built-in recipes.
pub fn builtin_names() -> impl Iterator<Item = &'static str> {
    BUILTIN.iter().map(|(name, _)| *name)
}
