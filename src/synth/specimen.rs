//! [`Specimen`]: one texture of a recipe.

use std::collections::BTreeMap;

use super::families::{Brush, Family};
use super::random::Random;
use super::{Distortion, Nuisance, ParameterRange, Recipe, RecipeGroup};
use crate::volume::{Shape, Volume};

/// One texture of a recipe: all parameters are drawn, but no voxels are computed yet.
///
/// The voxels depend only on the recipe's seed, the group's name and family, the index and the drawn parameters, so that
/// specimens can be computed in any order, on any thread.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// `GROUP-INDEX`, the index from 0 with at least three digits. Unique in its recipe, and a valid file name.
    pub name: String,
    /// The group's tags. `family` is always among them.
    pub tags: BTreeMap<String, String>,
    /// The family that paints it.
    pub family: &'static Family,
    /// Axis lengths (Z, Y, X) before any rotation.
    pub shape: Shape,
    /// The value of each of the family's parameters, in the family's order.
    pub values: Vec<f32>,
    /// What the recipe's nuisance does to this specimen; `None` where the recipe has none.
    pub distortion: Option<Distortion>,
    tile: bool,
    seed: u64,
    group: String,
    index: u64,
}

impl Recipe {
    /// All textures, group by group. No voxels are computed yet.
    pub fn specimens(&self) -> Vec<Specimen> {
        let of_group = |group| (0..).map_while(move |index| self.specimen(group, index));
        self.groups().iter().flat_map(of_group).collect()
    }

    /// The specimen `index` of a group; `None` past the end.
    fn specimen(&self, group: &RecipeGroup, index: u64) -> Option<Specimen> {
        (index < group.count).then(|| Specimen::draw(self.seed(), group, index, self.nuisance()))
    }
}

impl Specimen {
    /// Draws the parameters of specimen `index` of `group`, with the recipe's `seed`.
    pub(super) fn draw(seed: u64, group: &RecipeGroup, index: u64, nuisance: &Nuisance) -> Self {
        let mut random = Random::of(seed, &group.name, index, "parameters");
        let mut value = |range: &ParameterRange, whole: bool| {
            if whole {
                // The limits of whole parameters fit into u32.
                range.low as f32 + random.below((range.high - range.low) as u32 + 1) as f32
            } else {
                random.between(range.low, range.high) as f32
            }
        };
        let parameters = group.ranges.iter().zip(group.family.parameters);
        let values = parameters.map(|(range, parameter)| value(range, parameter.limits.whole)).collect();
        let distortion = || nuisance.draw_from(&mut Random::of(seed, &group.name, index, "nuisance"));
        Self {
            name: format!("{}-{index:03}", group.name),
            tags: group.tags.clone(),
            family: group.family,
            shape: group.shape,
            values,
            distortion: (!nuisance.is_none()).then(distortion),
            tile: group.tile,
            seed,
            group: group.name.clone(),
            index,
        }
    }

    /// The names and drawn values of the parameters.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static str, f32)> {
        self.family.parameters.iter().map(|parameter| parameter.name).zip(self.values.iter().copied())
    }

    /// Computes the voxels and applies the recipe's nuisance.
    pub fn volume(&self) -> Volume {
        let plain = self.plain_volume();
        self.distortion.as_ref().map_or_else(|| plain.clone(), |distortion| distortion.apply(&plain))
    }

    /// Computes the voxels without the nuisance.
    pub fn plain_volume(&self) -> Volume {
        let random = Random::of(self.seed, &self.group, self.index, "voxels");
        self.family.paint(Brush::new(self.shape, self.tile, &self.values, random)).into_volume()
    }
}
