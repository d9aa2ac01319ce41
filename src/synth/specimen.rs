//! [`Specimen`]: one texture of a recipe.

use std::collections::BTreeMap;

use super::families::{Brush, Family};
use super::random::Random;
use super::{Distortion, Group, Nuisance, Range};
use crate::volume::{Shape, Volume};

/// One texture of a recipe, every number drawn, no voxel made.
///
/// Its voxels depend on the recipe's seed, the group's name and family, the index and the drawn parameters alone:
/// specimens can be made in any order, on any thread.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// `GROUP-INDEX`, the index from 0 with at least three digits; unique in its recipe and fit for a file name.
    pub name: String,
    /// The group's tags; `family` is always among them.
    pub tags: BTreeMap<String, String>,
    /// How it is painted.
    pub family: &'static Family,
    /// Axis lengths (Z, Y, X), before any turn.
    pub shape: Shape,
    /// The value of each of the family's parameters, in the family's order.
    pub values: Vec<f32>,
    /// The nuisance of this specimen, `None` where the recipe has none.
    pub distortion: Option<Distortion>,
    tile: bool,
    seed: u64,
    group: String,
    index: u64,
}

impl Specimen {
    /// The specimen `index` of `group`, under the recipe's `seed`.
    pub(super) fn draw(seed: u64, group: &Group, index: u64, nuisance: &Nuisance) -> Self {
        let mut random = Random::of(seed, &group.name, index, "parameters");
        let mut value = |range: &Range, whole: bool| {
            if whole {
                // Whole ranges lie within limits that a u32 holds.
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

    /// The parameters by name, as they were drawn.
    pub fn parameters(&self) -> impl Iterator<Item = (&'static str, f32)> {
        self.family.parameters.iter().map(|parameter| parameter.name).zip(self.values.iter().copied())
    }

    /// The voxels, with the recipe's nuisance.
    pub fn volume(&self) -> Volume {
        let plain = self.plain_volume();
        self.distortion.as_ref().map_or_else(|| plain.clone(), |distortion| distortion.apply(&plain))
    }

    /// The voxels without any nuisance.
    pub fn plain_volume(&self) -> Volume {
        let random = Random::of(self.seed, &self.group, self.index, "voxels");
        self.family.paint(Brush::new(self.shape, self.tile, &self.values, random)).into_volume()
    }
}
