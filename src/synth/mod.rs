//! Synthetic solid textures and data sets of them.
//!
//! - A *family* is a procedure that paints a kind of texture (marble, foam, gyroid) from named *parameters*.
//! - A *recipe* is a TOML file that describes a data set: families, how many textures of each, and their parameters, each
//!   fixed or drawn from a range.
//! - A *specimen* is one texture of a recipe. It is cheap until its voxels are computed.
//! - A *nuisance* is a change of a volume that should not affect what it looks like: brightness, contrast, gamma, noise,
//!   right-angle rotation.
//!
//! A recipe gives the same bytes on every CPU, in any order, on any thread. All arithmetic is therefore written out: `f32`
//! and `f64` with + - * / and square roots, which IEEE 754 defines to the bit, and the `libm` crate for everything else.
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

mod error;
pub mod families;
mod field;
mod fractal;
mod noise;
mod nuisance;
mod random;
mod range;
mod recipe;
mod rotation;
mod specimen;

pub use error::RecipeError;
pub use nuisance::{Distortion, Nuisance, ParseNuisanceError};
pub use range::{ParameterLimits, ParameterRange};
pub use recipe::{Recipe, RecipeGroup};
pub use rotation::Rotation;
pub use specimen::Specimen;

/// The built-in recipes: name and TOML text.
const BUILTIN: [(&str, &str); 4] = [
    ("paper600", include_str!("../../datasets/paper600.toml")),
    ("families", include_str!("../../datasets/families.toml")),
    ("wide", include_str!("../../datasets/wide.toml")),
    ("prior", include_str!("../../datasets/prior.toml")),
];

/// The TOML text of the built-in recipe `name`; `None` where there is none. See [`builtin_names`].
pub fn builtin(name: &str) -> Option<&'static str> {
    BUILTIN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The names of the built-in recipes.
pub fn builtin_names() -> impl Iterator<Item = &'static str> {
    BUILTIN.iter().map(|(name, _)| *name)
}
