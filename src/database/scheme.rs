//! What a store keeps of each texture, as its settings say: views, and the statistics that its spaces look at.

use std::ops::Deref;

use super::own_spaces;
use crate::hlac::View;
use crate::space::{Definition, Form, Recipe};
use crate::store::Reads;

/// The views that a store keeps and this version knows, and the definitions of its spaces. It reads as a list of views.
#[derive(Clone, Debug)]
pub(super) struct Scheme {
    views: Vec<View>,
    definitions: Vec<Definition>,
}

impl Scheme {
    /// What the settings of a state say.
    pub(super) fn of(state: &impl Reads) -> Self {
        let settings = state.settings();
        let views = settings.views.iter().filter_map(|code| View::from_code(code.0)).collect::<Vec<_>>();
        let own = own_spaces::definitions(settings);
        let built_in = Definition::BUILT_IN.into_iter().filter_map(Definition::built_in);
        let restricted =
            |definition: Definition| definition.restricted_to(&views).or_else(|| instead(definition, &views));
        let definitions = built_in.chain(own).filter_map(restricted).collect();
        Self { views, definitions }
    }

    /// The definitions of the store's spaces, each restricted to the views that the store keeps: the built-in ones, then
    /// the user's own by name.
    ///
    /// `default` and `invariant` mean their recipe on those of its views that there are; where there is none of them, on
    /// the views there are. Other spaces whose views are not kept are not there.
    pub(super) fn definitions(&self) -> &[Definition] {
        &self.definitions
    }

    /// The recipes that statistics are kept of: the plain moments, and whatever the spaces look at.
    pub(super) fn recipes(&self) -> Vec<Recipe> {
        let mut recipes: Vec<Recipe> = self.definitions.iter().map(|definition| definition.recipe.clone()).collect();
        recipes.sort_by_key(Recipe::key);
        recipes.dedup();
        recipes
    }

    /// The names of the spaces.
    pub(super) fn names(&self) -> Vec<String> {
        self.definitions.iter().map(|definition| definition.name.clone()).collect()
    }
}

impl Deref for Scheme {
    type Target = [View];

    fn deref(&self) -> &[View] {
        &self.views
    }
}

/// The likeness spaces of a store that keeps none of their views: the same on the views it keeps.
fn instead(definition: Definition, views: &[View]) -> Option<Definition> {
    let pooled = definition.recipe.form() == Form::Pooled;
    let recipe = Recipe::new(definition.recipe.form(), views).ok().filter(|_| pooled)?;
    Some(Definition { recipe, ..definition })
}
