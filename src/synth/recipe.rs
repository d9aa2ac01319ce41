//! Recipes: descriptions of synthetic data sets.

use std::collections::{BTreeMap, HashSet};

use serde::Deserialize;
use serde::de::Deserializer;

use super::families::{FAMILIES, Family};
use super::range::{NumbersVisitor, ParameterLimits, ParameterRange};
use super::{Nuisance, RecipeError, builtin, builtin_names};
use crate::volume::{MIN_SIDE, Shape};

/// The longest side of a texture, in voxels.
const MAX_SIDE: u64 = 512;
/// The most voxels of a texture.
const MAX_VOXELS: u64 = 1 << 27;
/// The most textures of a recipe.
const MAX_TEXTURES: u64 = 1_000_000;

/// `size = 64` or `size = [Z, Y, X]`.
struct Size([f64; 3]);

impl<'de> Deserialize<'de> for Size {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let sides = deserializer.deserialize_any(NumbersVisitor::<3>("a side or [Z, Y, X], in voxels"))?;
        Ok(Self(sides))
    }
}

/// A number of textures.
fn count<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let [found] = deserializer.deserialize_any(NumbersVisitor::<1>("a number of textures"))?;
    match found {
        // From 2^53 on not every whole number is exact, but the limit is far below.
        found if found >= 0.0 && found == found.trunc() => Ok(found as u64),
        found => Err(serde::de::Error::custom(format!("invalid count {found}: expected a whole number of 1 or more"))),
    }
}

/// A recipe as written in TOML.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RecipeText {
    name: String,
    #[serde(default)]
    about: String,
    seed: u64,
    size: Size,
    nuisance: Option<NuisanceText>,
    #[serde(default)]
    group: Vec<GroupText>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NuisanceText {
    gamma: Option<ParameterRange>,
    contrast: Option<ParameterRange>,
    brightness: Option<ParameterRange>,
    noise: Option<ParameterRange>,
    #[serde(default)]
    turn: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GroupText {
    name: Option<String>,
    family: String,
    #[serde(deserialize_with = "count")]
    count: u64,
    size: Option<Size>,
    #[serde(default)]
    tile: bool,
    #[serde(default)]
    tags: BTreeMap<String, String>,
    #[serde(default)]
    parameters: BTreeMap<String, ParameterRange>,
}

/// Textures of one family.
#[derive(Clone, Debug)]
pub struct RecipeGroup {
    /// The group's name: that of the family, unless the recipe gives another.
    pub name: String,
    /// The family of its textures.
    pub family: &'static Family,
    /// The number of textures.
    pub count: u64,
    /// Axis lengths (Z, Y, X) of each texture.
    pub shape: Shape,
    /// Whether the textures tile without a seam.
    pub tile: bool,
    /// The tags of the textures: those of the recipe, and `family` (the family's name, unless the recipe sets it).
    pub tags: BTreeMap<String, String>,
    /// The range of each of the family's parameters, in the family's order.
    pub ranges: Vec<ParameterRange>,
}

/// The description of a synthetic data set. It has been validated: its textures can be computed.
#[derive(Clone, Debug)]
pub struct Recipe {
    name: String,
    about: String,
    seed: u64,
    nuisance: Nuisance,
    groups: Vec<RecipeGroup>,
}

impl Recipe {
    /// Parses a TOML text. `datasets/README.md` describes the format.
    ///
    /// # Errors
    /// [`RecipeError`], whose message names the place.
    pub fn parse(text: &str) -> Result<Self, RecipeError> {
        let RecipeText { name, about, seed, size, nuisance, group } = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start).min(text.len());
            let line = text.as_bytes()[..start].iter().filter(|&&byte| byte == b'\n').count() + 1;
            RecipeError::Syntax { line, message: error.message().trim().replace('\n', "; ") }
        })?;
        check_name(&name)?;
        let shape = checked_shape(&size, "the recipe")?;
        let groups = group.into_iter().map(|group| checked_group(group, shape)).collect::<Result<Vec<_>, _>>()?;
        let mut names = HashSet::new();
        if let Some(twice) = groups.iter().find(|group| !names.insert(group.name.as_str())) {
            return Err(RecipeError::DuplicateName { name: twice.name.clone() });
        }
        let found = groups.iter().map(|group| u128::from(group.count)).sum();
        if found == 0 || found > u128::from(MAX_TEXTURES) {
            return Err(RecipeError::TextureCount { found, limit: MAX_TEXTURES });
        }
        let nuisance = nuisance.map_or(Ok(Nuisance::NONE), checked_nuisance)?;
        Ok(Self { name, about, seed, nuisance, groups })
    }

    /// The built-in recipe `name`; see [`builtin_names`].
    ///
    /// # Errors
    /// [`RecipeError::UnknownBuiltin`].
    pub fn builtin(name: &str) -> Result<Self, RecipeError> {
        let unknown = || RecipeError::UnknownBuiltin { name: name.into(), known: listed(builtin_names()) };
        Self::parse(builtin(name).ok_or_else(unknown)?)
    }

    /// The same textures under another nuisance.
    pub fn with_nuisance(self, nuisance: Nuisance) -> Self {
        Self { nuisance, ..self }
    }

    /// The recipe's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The recipe's own description; may be empty.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// The seed of all random numbers.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The nuisance applied to every texture; [`Nuisance::NONE`] by default.
    pub fn nuisance(&self) -> &Nuisance {
        &self.nuisance
    }

    /// The groups, in the order of the text.
    pub fn groups(&self) -> &[RecipeGroup] {
        &self.groups
    }

    /// The number of textures.
    pub fn count(&self) -> u64 {
        self.groups.iter().map(|group| group.count).sum()
    }
}

fn listed<'a>(words: impl Iterator<Item = &'a str>) -> String {
    words.collect::<Vec<_>>().join(", ")
}

fn check_name(name: &str) -> Result<(), RecipeError> {
    let fits = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-' || byte == b'_';
    if (1..=64).contains(&name.len()) && name.bytes().all(fits) {
        return Ok(());
    }
    Err(RecipeError::InvalidName { name: name.into() })
}

fn checked_shape(size: &Size, place: &str) -> Result<Shape, RecipeError> {
    let fits = |side: &f64| (MIN_SIDE as f64..=MAX_SIDE as f64).contains(side) && *side == side.trunc();
    if size.0.iter().all(fits) && size.0.iter().product::<f64>() <= MAX_VOXELS as f64 {
        return Ok(size.0.map(|side| side as usize));
    }
    Err(RecipeError::InvalidSize { place: place.into(), shape: size.0, longest: MAX_SIDE, voxels: MAX_VOXELS })
}

fn checked_range(
    range: ParameterRange,
    limits: ParameterLimits,
    place: &str,
    what: &str,
) -> Result<ParameterRange, RecipeError> {
    if limits.contain(range) {
        return Ok(range);
    }
    Err(RecipeError::InvalidRange { place: place.into(), what: what.into(), found: range, limits })
}

fn checked_group(text: GroupText, shape: Shape) -> Result<RecipeGroup, RecipeError> {
    let name = text.name.unwrap_or_else(|| text.family.clone());
    let Some(family) = Family::named(&text.family) else {
        let known = listed(FAMILIES.iter().map(|family| family.name));
        return Err(RecipeError::UnknownFamily { group: name, family: text.family, known });
    };
    check_name(&name)?;
    if text.tile && !family.tiles {
        let known = listed(FAMILIES.iter().filter(|family| family.tiles).map(|family| family.name));
        return Err(RecipeError::CannotTile { group: name, family: text.family, known });
    }
    if let Some(parameter) = text.parameters.keys().find(|key| family.parameters.iter().all(|p| p.name != **key)) {
        let known = listed(family.parameters.iter().map(|parameter| parameter.name));
        return Err(RecipeError::UnknownParameter {
            group: name,
            family: text.family,
            parameter: parameter.clone(),
            known,
        });
    }
    let place = format!("group {name:?}");
    let range = |parameter: &super::families::FamilyParameter| {
        let range = text.parameters.get(parameter.name).copied().unwrap_or(parameter.usual);
        checked_range(range, parameter.limits, &place, parameter.name)
    };
    let ranges = family.parameters.iter().map(range).collect::<Result<Vec<_>, _>>()?;
    let shape = text.size.map_or(Ok(shape), |size| checked_shape(&size, &place))?;
    let mut tags = text.tags;
    tags.entry("family".into()).or_insert_with(|| family.name.into());
    Ok(RecipeGroup { name, family, count: text.count, shape, tile: text.tile, tags, ranges })
}

fn checked_nuisance(text: NuisanceText) -> Result<Nuisance, RecipeError> {
    let checked = |range: Option<ParameterRange>, low, high, what| {
        let limits = ParameterLimits { low, high, whole: false };
        range.map(|range| checked_range(range, limits, "the nuisance of the recipe", what)).transpose()
    };
    Ok(Nuisance {
        gamma: checked(text.gamma, 0.1, 10.0, "gamma")?,
        contrast: checked(text.contrast, 0.0, 4.0, "contrast")?,
        brightness: checked(text.brightness, -1.0, 1.0, "brightness")?,
        noise: checked(text.noise, 0.0, 1.0, "noise")?,
        rotation: text.turn,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "name = 'r'\nseed = 1\nsize = 8\n";

    fn refused(text: &str) -> String {
        Recipe::parse(text).unwrap_err().to_string()
    }

    fn with_group(group: &str) -> String {
        format!("{HEAD}[[group]]\n{group}")
    }

    #[test]
    fn omitted_parameters_have_their_usual_range() {
        let recipe = Recipe::parse(&with_group("family = 'marble'\ncount = 3\nparameters.scale = 9")).unwrap();
        let group = &recipe.groups()[0];
        assert_eq!((group.name.as_str(), group.count, group.shape), ("marble", 3, [8; 3]));
        assert_eq!(group.tags["family"], "marble");
        for (range, parameter) in group.ranges.iter().zip(group.family.parameters) {
            let expected =
                if parameter.name == "scale" { ParameterRange { low: 9.0, high: 9.0 } } else { parameter.usual };
            assert_eq!(*range, expected, "{}", parameter.name);
        }
        let names: Vec<String> = recipe.specimens().into_iter().map(|specimen| specimen.name).collect();
        assert_eq!(names, ["marble-000", "marble-001", "marble-002"]);
    }

    #[test]
    fn errors_name_the_place() {
        for (text, expected) in [
            ("name = 'r'\nseed = 'x'".to_owned(), "line 2 of the recipe: invalid type"),
            (format!("{HEAD}colour = 1"), "line 4 of the recipe: unknown field `colour`"),
            (HEAD.to_owned(), "has 0 textures"),
            (with_group("family = 'marbel'\ncount = 1"), "unknown family \"marbel\"; known: perlin,"),
            (with_group("family = 'marble'\ncount = -1"), "line 6 of the recipe"),
            (with_group("family = 'marble'\ncount = 9000000000000000000"), "has 9000000000000000000 textures"),
            (with_group("family = 'marble'\ncount = 1\nsize = 5000"), "group \"marble\" asks for textures of 5000 x"),
            (with_group("family = 'marble'\ncount = 1\nsize = [8, 8]"), "line 7 of the recipe: invalid length 2"),
            (with_group("family = 'marble'\ncount = 1\nsize = 2"), "of 2 x 2 x 2 voxels"),
            (with_group("family = 'marble'\ncount = 1\nsize = 8.5"), "of 8.5 x 8.5 x 8.5 voxels"),
            (with_group("family = 'marble'\ncount = 1\nparameters.lenght = 3"), "no such parameter; it has: scale,"),
            (with_group("family = 'marble'\ncount = 1\nparameters.scale = [9, 3]"), "sets scale to [9, 3]; expected"),
            (with_group("family = 'marble'\ncount = 1\nparameters.scale = nan"), "sets scale to"),
            (with_group("family = 'fbm'\ncount = 1\nparameters.octaves = 2.5"), "whole numbers"),
            (with_group("family = 'wood'\ncount = 1\ntile = true"), "cannot tile; families that can: perlin,"),
            (with_group("name = '../x'\nfamily = 'wood'\ncount = 1"), "invalid name"),
            (with_group("family = 'wood'\ncount = 1\n[[group]]\nfamily = 'wood'\ncount = 1"), "two groups are named"),
            (format!("{HEAD}nuisance.noise = 2\n[[group]]\nfamily = 'wood'\ncount = 1"), "sets noise to 2"),
        ] {
            let found = refused(&text);
            assert!(found.contains(expected), "{found:?} lacks {expected:?}");
            assert!(!found.contains('\n'), "{found:?} is not one line");
        }
    }
}
