//! Families of textures: the procedural textures of computer graphics.
//!
//! A family has named parameters, each with limits and a usual range, and a function that paints a texture from them.
//! Lengths are in voxels, angles in degrees, strengths and fractions from 0 to 1. A new family is one `static` in a module
//! of this folder and one entry of [`FAMILIES`].
//!
//! Many families have a `tilt`: the pattern is rotated by this angle about a random axis. At 0 it is aligned with the axes
//! of the volume; the range 0 to 180 gives every orientation.

mod artificial;
mod cellular;
mod family;
mod fluid;
mod gradient;
mod grains;
mod mineral;
mod organic;
mod random_field;
mod surface;

pub(super) use family::Brush;
pub use family::{Family, FamilyParameter};

impl Family {
    /// The family with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.iter().copied().find(|family| family.name == name)
    }
}

/// All families.
pub static FAMILIES: &[&Family] = &[
    &gradient::PERLIN,
    &gradient::FRACTAL,
    &gradient::FBM,
    &gradient::TURBULENCE,
    &gradient::RIDGED,
    &gradient::VALUE,
    &mineral::MARBLE,
    &mineral::GRANITE,
    &mineral::AGATE,
    &mineral::VEINS,
    &organic::WOOD,
    &cellular::STONE,
    &cellular::FOAM,
    &cellular::CRYSTAL,
    &cellular::SCALES,
    &cellular::CRACKS,
    &cellular::SPONGE,
    &fluid::CLOUDS,
    &fluid::SMOKE,
    &fluid::WATER,
    &fluid::WAVES,
    &fluid::DUNES,
    &artificial::CHECKER,
    &artificial::STRIPES,
    &artificial::BRICK,
    &artificial::WEAVE,
    &artificial::DOTS,
    &artificial::LAMELLAE,
    &surface::GYROID,
    &surface::PRIMITIVE,
    &surface::DIAMOND,
    &surface::IWP,
    &grains::SPHERES,
    &grains::BUBBLES,
    &grains::FIBRES,
    &grains::RUST,
    &random_field::GAUSSIAN,
    &random_field::BRUSHED,
    &random_field::SPECKLE,
    &random_field::SANDSTONE,
    &random_field::SPINODAL,
    &random_field::CAMOUFLAGE,
    &random_field::SEDIMENT,
    &random_field::LAVA,
];

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::synth::random::Random;

    #[test]
    fn families_and_parameters_are_well_formed() {
        let mut names = HashSet::new();
        for family in FAMILIES {
            assert!(names.insert(family.name), "duplicate family {}", family.name);
            assert!(family.about.ends_with('.') && !family.parameters.is_empty(), "{}", family.name);
            let mut names = HashSet::new();
            for FamilyParameter { name, limits, usual, .. } in family.parameters {
                assert!(names.insert(name), "{}: duplicate parameter {name}", family.name);
                assert!(limits.low <= usual.low && usual.low <= usual.high && usual.high <= limits.high, "{name}");
            }
        }
    }

    #[test]
    fn every_family_paints_at_the_ends_of_its_limits() {
        for family in FAMILIES {
            for end in 0..3 {
                let value = |p: &FamilyParameter| [p.limits.low, p.limits.high, p.usual.low][end] as f32;
                let values: Vec<f32> = family.parameters.iter().map(value).collect();
                let random = Random::of(1, family.name, 0, "voxels");
                let field = family.paint(Brush::new([9, 10, 11], family.tiles, &values, random));
                assert_eq!(field.shape(), [9, 10, 11]);
                assert!(field.values().iter().all(|v| v.is_finite()), "{} at end {end}", family.name);
            }
        }
    }
}
