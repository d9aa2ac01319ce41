//! Recipes: which textures a data set has.

use std::collections::{BTreeMap, HashSet};
use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};

use super::families::{FAMILIES, Family};
use super::{Nuisance, RecipeError, Specimen, builtin, builtin_names};
use crate::volume::{MIN_SIDE, Shape};

/// The longest side of a texture.
const LONGEST: u64 = 512;
/// The most voxels of a texture.
const MOST_VOXELS: u64 = 1 << 27;
/// The most textures of a recipe.
const MOST_TEXTURES: u64 = 1_000_000;

/// Numbers from `low` to `high`; in a recipe a number (fixed) or `[low, high]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// The lowest.
    pub low: f64,
    /// The highest.
    pub high: f64,
}

/// What a range must lie within.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The lowest number allowed.
    pub low: f64,
    /// The highest number allowed.
    pub high: f64,
    /// Whether the numbers must be whole.
    pub whole: bool,
}

impl Limits {
    fn hold(&self, range: Range) -> bool {
        let whole = |v: f64| !self.whole || v == v.trunc();
        // Comparisons with NaN are false, so NaN is refused.
        self.low <= range.low
            && range.low <= range.high
            && range.high <= self.high
            && whole(range.low)
            && whole(range.high)
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.low == self.high { write!(f, "{}", self.low) } else { write!(f, "[{}, {}]", self.low, self.high) }
    }
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}{}", self.low, self.high, if self.whole { ", in whole numbers" } else { "" })
    }
}

impl<'de> Deserialize<'de> for Range {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let [low, high] = deserializer.deserialize_any(NumbersVisitor::<2>("a number or [low, high]"))?;
        Ok(Self { low, high })
    }
}

/// One number, or `N` of them; one number stands for `N` equal ones.
struct NumbersVisitor<const N: usize>(&'static str);

impl<'de, const N: usize> Visitor<'de> for NumbersVisitor<N> {
    type Value = [f64; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }

    fn visit_f64<E>(self, number: f64) -> Result<Self::Value, E> {
        Ok([number; N])
    }

    fn visit_i64<E>(self, number: i64) -> Result<Self::Value, E> {
        Ok([number as f64; N])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Self::Value, A::Error> {
        let mut numbers = [0.0; N];
        for (i, number) in numbers.iter_mut().enumerate() {
            *number = items.next_element()?.ok_or_else(|| serde::de::Error::invalid_length(i, &self))?;
        }
        match items.next_element::<serde::de::IgnoredAny>()? {
            None => Ok(numbers),
            Some(_) => Err(serde::de::Error::invalid_length(N + 1, &self)),
        }
    }
}

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
        // 2^53 and beyond are no exact numbers any more, and far beyond what is allowed.
        found if found >= 0.0 && found == found.trunc() => Ok(found as u64),
        found => Err(serde::de::Error::custom(format!(
            "a count of {found} was found, but it must be a whole number, 1 or more"
        ))),
    }
}

/// A recipe as the TOML text has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
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
    gamma: Option<Range>,
    contrast: Option<Range>,
    brightness: Option<Range>,
    noise: Option<Range>,
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
    parameters: BTreeMap<String, Range>,
}

/// So many textures of one family.
#[derive(Clone, Debug)]
pub struct Group {
    /// The group's name: the family's, unless the recipe gives another.
    pub name: String,
    /// How its textures are painted.
    pub family: &'static Family,
    /// How many there are.
    pub count: u64,
    /// Axis lengths (Z, Y, X) of each.
    pub shape: Shape,
    /// Whether they tile without a seam.
    pub tile: bool,
    /// Their tags: `family` (the family's name, unless the recipe sets it), and the recipe's own.
    pub tags: BTreeMap<String, String>,
    /// What each of the family's parameters is drawn from, in the family's order.
    pub ranges: Vec<Range>,
}

/// A data set, as a recipe asks for it. Everything in it has been checked: its textures can be made.
#[derive(Clone, Debug)]
pub struct Recipe {
    name: String,
    about: String,
    seed: u64,
    nuisance: Nuisance,
    groups: Vec<Group>,
}

impl Recipe {
    /// The recipe that a TOML text describes; `datasets/README.md` explains the form.
    ///
    /// # Errors
    /// [`RecipeError`], whose sentence names the place.
    pub fn parse(text: &str) -> Result<Self, RecipeError> {
        let Text { name, about, seed, size, nuisance, group } = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start).min(text.len());
            let line = text.as_bytes()[..start].iter().filter(|&&byte| byte == b'\n').count() + 1;
            RecipeError::Form { line, message: error.message().trim().replace('\n', "; ") }
        })?;
        check_name(&name)?;
        let shape = checked_shape(&size, "the recipe")?;
        let groups = group.into_iter().map(|group| checked_group(group, shape)).collect::<Result<Vec<_>, _>>()?;
        let mut names = HashSet::new();
        if let Some(twice) = groups.iter().find(|group| !names.insert(group.name.as_str())) {
            return Err(RecipeError::Twice { name: twice.name.clone() });
        }
        let found = groups.iter().map(|group| u128::from(group.count)).sum();
        if found == 0 || found > u128::from(MOST_TEXTURES) {
            return Err(RecipeError::Count { found, limit: MOST_TEXTURES });
        }
        let nuisance = nuisance.map_or(Ok(Nuisance::NONE), checked_nuisance)?;
        Ok(Self { name, about, seed, nuisance, groups })
    }

    /// The built-in recipe of this name; its text is [`builtin`]'s.
    ///
    /// # Errors
    /// [`RecipeError::Builtin`] where there is none.
    pub fn builtin(name: &str) -> Result<Self, RecipeError> {
        let unknown = || RecipeError::Builtin { name: name.into(), known: listed(builtin_names()) };
        Self::parse(builtin(name).ok_or_else(unknown)?)
    }

    /// The same textures with another nuisance; the textures under it do not change.
    pub fn with_nuisance(self, nuisance: Nuisance) -> Self {
        Self { nuisance, ..self }
    }

    /// The recipe's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What the recipe is for, in its own words; may be empty.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// The seed of every draw.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// What varies in every texture; [`Nuisance::NONE`] unless the recipe or the caller says otherwise.
    pub fn nuisance(&self) -> &Nuisance {
        &self.nuisance
    }

    /// The groups, in the order of the text.
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// How many textures there are.
    pub fn count(&self) -> u64 {
        self.groups.iter().map(|group| group.count).sum()
    }

    /// All textures, group by group; no voxel is made yet.
    pub fn specimens(&self) -> Vec<Specimen> {
        let of_group = |group| (0..).map_while(move |index| self.specimen(group, index));
        self.groups.iter().flat_map(of_group).collect()
    }

    /// The specimen `index` of a group of this recipe; `None` past its count.
    fn specimen(&self, group: &Group, index: u64) -> Option<Specimen> {
        (index < group.count).then(|| Specimen::draw(self.seed, group, index, &self.nuisance))
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
    Err(RecipeError::Name { name: name.into() })
}

fn checked_shape(size: &Size, place: &str) -> Result<Shape, RecipeError> {
    let fits = |side: &f64| (MIN_SIDE as f64..=LONGEST as f64).contains(side) && *side == side.trunc();
    if size.0.iter().all(fits) && size.0.iter().product::<f64>() <= MOST_VOXELS as f64 {
        return Ok(size.0.map(|side| side as usize));
    }
    Err(RecipeError::Size { place: place.into(), shape: size.0, longest: LONGEST, voxels: MOST_VOXELS })
}

fn checked_range(range: Range, limits: Limits, place: &str, what: &str) -> Result<Range, RecipeError> {
    if limits.hold(range) {
        return Ok(range);
    }
    Err(RecipeError::Range { place: place.into(), what: what.into(), found: range, limits })
}

fn checked_group(text: GroupText, shape: Shape) -> Result<Group, RecipeError> {
    let name = text.name.unwrap_or_else(|| text.family.clone());
    let Some(family) = Family::named(&text.family) else {
        let known = listed(FAMILIES.iter().map(|family| family.name));
        return Err(RecipeError::Family { group: name, family: text.family, known });
    };
    check_name(&name)?;
    if text.tile && !family.tiles {
        let known = listed(FAMILIES.iter().filter(|family| family.tiles).map(|family| family.name));
        return Err(RecipeError::Tile { group: name, family: text.family, known });
    }
    if let Some(parameter) = text.parameters.keys().find(|key| family.parameters.iter().all(|p| p.name != **key)) {
        let known = listed(family.parameters.iter().map(|parameter| parameter.name));
        return Err(RecipeError::Parameter { group: name, family: text.family, parameter: parameter.clone(), known });
    }
    let place = format!("group {name:?}");
    let range = |parameter: &super::families::Parameter| {
        let range = text.parameters.get(parameter.name).copied().unwrap_or(parameter.usual);
        checked_range(range, parameter.limits, &place, parameter.name)
    };
    let ranges = family.parameters.iter().map(range).collect::<Result<Vec<_>, _>>()?;
    let shape = text.size.map_or(Ok(shape), |size| checked_shape(&size, &place))?;
    let mut tags = text.tags;
    tags.entry("family".into()).or_insert_with(|| family.name.into());
    Ok(Group { name, family, count: text.count, shape, tile: text.tile, tags, ranges })
}

fn checked_nuisance(text: NuisanceText) -> Result<Nuisance, RecipeError> {
    let checked = |range: Option<Range>, low, high, what| {
        let limits = Limits { low, high, whole: false };
        range.map(|range| checked_range(range, limits, "the nuisance of the recipe", what)).transpose()
    };
    Ok(Nuisance {
        gamma: checked(text.gamma, 0.1, 10.0, "gamma")?,
        contrast: checked(text.contrast, 0.0, 4.0, "contrast")?,
        brightness: checked(text.brightness, -1.0, 1.0, "brightness")?,
        noise: checked(text.noise, 0.0, 1.0, "noise")?,
        turn: text.turn,
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
    fn what_is_left_out_takes_the_usual() {
        let recipe = Recipe::parse(&with_group("family = 'marble'\ncount = 3\nparameters.scale = 9")).unwrap();
        let group = &recipe.groups()[0];
        assert_eq!((group.name.as_str(), group.count, group.shape), ("marble", 3, [8; 3]));
        assert_eq!(group.tags["family"], "marble");
        for (range, parameter) in group.ranges.iter().zip(group.family.parameters) {
            let expected = if parameter.name == "scale" { Range { low: 9.0, high: 9.0 } } else { parameter.usual };
            assert_eq!(*range, expected, "{}", parameter.name);
        }
        let names: Vec<String> = recipe.specimens().into_iter().map(|specimen| specimen.name).collect();
        assert_eq!(names, ["marble-000", "marble-001", "marble-002"]);
    }

    #[test]
    fn refusals_are_sentences_with_the_place() {
        for (text, expected) in [
            ("name = 'r'\nseed = 'x'".to_owned(), "line 2 of the recipe: invalid type"),
            (format!("{HEAD}colour = 1"), "line 4 of the recipe: unknown field `colour`"),
            (HEAD.to_owned(), "asks for 0 textures"),
            (with_group("family = 'marbel'\ncount = 1"), "family \"marbel\", which is not known; known: perlin,"),
            (with_group("family = 'marble'\ncount = -1"), "line 6 of the recipe"),
            (with_group("family = 'marble'\ncount = 9000000000000000000"), "asks for 9000000000000000000 textures"),
            (with_group("family = 'marble'\ncount = 1\nsize = 5000"), "group \"marble\" asks for textures of 5000 x"),
            (with_group("family = 'marble'\ncount = 1\nsize = [8, 8]"), "line 7 of the recipe: invalid length 2"),
            (with_group("family = 'marble'\ncount = 1\nsize = 2"), "of 2 x 2 x 2 voxels"),
            (with_group("family = 'marble'\ncount = 1\nsize = 8.5"), "of 8.5 x 8.5 x 8.5 voxels"),
            (with_group("family = 'marble'\ncount = 1\nparameters.lenght = 3"), "no such parameter; it has: scale,"),
            (
                with_group("family = 'marble'\ncount = 1\nparameters.scale = [9, 3]"),
                "sets scale to [9, 3], but it must",
            ),
            (with_group("family = 'marble'\ncount = 1\nparameters.scale = nan"), "sets scale to"),
            (with_group("family = 'fbm'\ncount = 1\nparameters.octaves = 2.5"), "in whole numbers"),
            (with_group("family = 'wood'\ncount = 1\ntile = true"), "to tile, but it cannot; these can: perlin,"),
            (with_group("name = '../x'\nfamily = 'wood'\ncount = 1"), "is no name"),
            (with_group("family = 'wood'\ncount = 1\n[[group]]\nfamily = 'wood'\ncount = 1"), "two groups are named"),
            (format!("{HEAD}nuisance.noise = 2\n[[group]]\nfamily = 'wood'\ncount = 1"), "sets noise to 2"),
        ] {
            let found = refused(&text);
            assert!(found.contains(expected), "{found:?} lacks {expected:?}");
            assert!(!found.contains('\n'), "{found:?} is not one line");
        }
    }
}
