//! What a store keeps of each texture, as its settings say: views, and the statistics that its spaces look at.

use crate::hlac::View;
use crate::space::{Definition, FeatureForm, FeatureSet};
use crate::store::{Reads, Settings};

/// The space that answers where none is named.
pub const DEFAULT_SPACE: &str = "default";

/// The views that a store keeps and this version knows, and the definitions of its spaces. It reads as a list of views.
#[derive(Clone, Debug)]
pub(crate) struct Scheme {
    views: Vec<View>,
    definitions: Vec<Definition>,
}

impl Scheme {
    /// What the settings of a state say.
    pub(crate) fn of(state: &impl Reads) -> Self {
        let settings = state.settings();
        let views = settings.views.iter().filter_map(|code| View::from_code(code.0)).collect::<Vec<_>>();
        let own = definitions(settings);
        let built_in = Definition::BUILT_IN.into_iter().filter_map(Definition::built_in);
        let restricted =
            |definition: Definition| definition.restricted_to(&views).or_else(|| instead(definition, &views));
        let definitions = built_in.chain(own).filter_map(restricted).collect();
        Self { views, definitions }
    }

    /// The views that the store keeps and this version knows.
    pub(crate) fn views(&self) -> &[View] {
        &self.views
    }

    /// The definitions of the store's spaces, each restricted to the views that the store keeps: the built-in ones, then
    /// the user's own by name.
    ///
    /// `default` and `invariant` mean their recipe on those of its views that there are; where there is none of them, on
    /// the views there are. Other spaces whose views are not kept are not there.
    pub(crate) fn definitions(&self) -> &[Definition] {
        &self.definitions
    }

    /// The recipes that statistics are kept of: the plain moments, and whatever the spaces look at.
    pub(crate) fn recipes(&self) -> Vec<FeatureSet> {
        let mut recipes: Vec<FeatureSet> =
            self.definitions.iter().map(|definition| definition.feature_set.clone()).collect();
        recipes.sort_by_key(FeatureSet::key);
        recipes.dedup();
        recipes
    }

    /// The names of the spaces.
    pub(crate) fn names(&self) -> Vec<String> {
        self.definitions.iter().map(|definition| definition.name.clone()).collect()
    }
}

/// The likeness spaces of a store that keeps none of their views: the same on the views it keeps.
fn instead(definition: Definition, views: &[View]) -> Option<Definition> {
    let pooled = definition.feature_set.form() == FeatureForm::Pooled;
    let feature_set = FeatureSet::new(definition.feature_set.form(), views).ok().filter(|_| pooled)?;
    Some(Definition { feature_set, ..definition })
}

/// What the name of a setting begins with that holds a definition, as JSON.
pub(crate) const SETTING: &str = "space.";

/// The definitions that the settings hold, by name.
///
/// One that this version cannot read (a newer one may know more kinds) is left out with a warning; it stays in the store.
pub(crate) fn definitions(settings: &Settings) -> Vec<Definition> {
    let named = settings.further.iter().filter_map(|(key, text)| Some((key.strip_prefix(SETTING)?, text)));
    let mut definitions = Vec::new();
    for (name, text) in named {
        match serde_json::from_str::<Definition>(text) {
            Ok(definition) if definition.name == name && definition.check().is_ok() => definitions.push(definition),
            Ok(_) => tracing::warn!("the setting {SETTING}{name} is no definition of that space: it is left out"),
            Err(error) => tracing::warn!(%error, "the space {name} cannot be read by this version: it is left out"),
        }
    }
    definitions
}

/// Writes a definition into the settings.
pub(crate) fn set_down(settings: &mut Settings, definition: &Definition) -> serde_json::Result<()> {
    settings.further.insert(format!("{SETTING}{}", definition.name), serde_json::to_string(definition)?);
    Ok(())
}
