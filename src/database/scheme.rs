//! [`Scheme`]: what a store keeps of each texture according to its settings.

use crate::hlac::View;
use crate::space::{Definition, FeatureForm, FeatureSet};
use crate::store::{Reads, Settings};

/// The space that queries use by default.
pub const DEFAULT_SPACE: &str = "default";

/// The views of a store that this version knows, and the definitions of its spaces.
#[derive(Clone, Debug)]
pub(crate) struct Scheme {
    views: Vec<View>,
    definitions: Vec<Definition>,
}

impl Scheme {
    /// The scheme of a state, from its settings.
    pub(crate) fn of(state: &impl Reads) -> Self {
        let settings = state.settings();
        let views = settings.views.iter().filter_map(|code| View::from_code(code.0)).collect::<Vec<_>>();
        let built_in = Definition::BUILT_IN.into_iter().filter_map(Definition::built_in);
        let restricted =
            |definition: Definition| definition.restricted_to(&views).or_else(|| on_views(definition, &views));
        let definitions = built_in.chain(user_definitions(settings)).filter_map(restricted).collect();
        Self { views, definitions }
    }

    /// The views that the store keeps and this version knows.
    pub(crate) fn views(&self) -> &[View] {
        &self.views
    }

    /// The definitions of the store's spaces, each restricted to the views that the store keeps: first the built-in ones,
    /// then the user-defined ones by name.
    ///
    /// `default` and `invariant` use those of their views that the store keeps, or all views of the store if it keeps none
    /// of them. Other spaces exist only if the store keeps their views.
    pub(crate) fn definitions(&self) -> &[Definition] {
        &self.definitions
    }

    /// The definition of this name.
    pub(crate) fn definition(&self, name: &str) -> Option<&Definition> {
        self.definitions.iter().find(|definition| definition.name == name)
    }

    /// The feature sets of the spaces, each once: statistics are kept of these.
    pub(crate) fn feature_sets(&self) -> Vec<FeatureSet> {
        let mut feature_sets: Vec<FeatureSet> =
            self.definitions.iter().map(|definition| definition.feature_set.clone()).collect();
        feature_sets.sort_by_key(FeatureSet::key);
        feature_sets.dedup();
        feature_sets
    }

    /// The names of the spaces.
    pub(crate) fn names(&self) -> Vec<String> {
        self.definitions.iter().map(|definition| definition.name.clone()).collect()
    }
}

/// A space of pooled features on the views of a store that keeps none of its own views.
fn on_views(definition: Definition, views: &[View]) -> Option<Definition> {
    let is_pooled = definition.feature_set.form() == FeatureForm::Pooled;
    let feature_set = FeatureSet::new(definition.feature_set.form(), views).ok().filter(|_| is_pooled)?;
    Some(Definition { feature_set, ..definition })
}

/// The prefix of the settings that hold the definitions of user-defined spaces, as JSON.
pub(crate) const SETTING: &str = "space.";

/// The definitions of user-defined spaces in the settings, by name.
///
/// A definition that this version cannot read stays in the store, and is left out with a warning: a newer version may know
/// more kinds of spaces.
pub(crate) fn user_definitions(settings: &Settings) -> Vec<Definition> {
    let named = settings.further.iter().filter_map(|(key, text)| Some((key.strip_prefix(SETTING)?, text)));
    let mut definitions = Vec::new();
    for (name, text) in named {
        match serde_json::from_str::<Definition>(text) {
            Ok(definition) if definition.name == name && definition.check().is_ok() => definitions.push(definition),
            Ok(_) => tracing::warn!("the setting {SETTING}{name} does not define that space: it is left out"),
            Err(error) => tracing::warn!(%error, "this version cannot read the space {name}: it is left out"),
        }
    }
    definitions
}

/// Writes the definition of a user-defined space into the settings.
pub(crate) fn put_definition(settings: &mut Settings, definition: &Definition) -> serde_json::Result<()> {
    settings.further.insert(format!("{SETTING}{}", definition.name), serde_json::to_string(definition)?);
    Ok(())
}
