//! What is known about textures before a store has any.

use super::Recipe;
use super::fit::Model;

/// What is known about textures in general: mean and scatters of the features of a large set, which count as so many
/// textures of the store.
#[derive(Clone, Debug)]
pub struct Prior {
    weight: f64,
}

impl Prior {
    /// Nothing is known: a fit looks at the store's own statistics only.
    pub fn none() -> Self {
        Self { weight: 0.0 }
    }

    /// How many textures it counts as.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// The part for a recipe, where there is one.
    pub(super) fn model(&self, _recipe: &Recipe) -> Option<Model> {
        None
    }
}
