//! Families of textures: what graphics people know by name.
//!
//! Each family has named parameters with limits, a usual range, and a rule that paints them; lengths are in voxels,
//! angles in degrees, strengths and shares from 0 to 1. A new family is one entry of a module's `FAMILIES` list.
//!
//! Many families have a `tilt`: the pattern is turned by that angle about an axis drawn at random (0: along the axes
//! of the volume; a range of 0 to 180 gives any orientation).

mod cellular;
mod fluid;
mod gradient;
mod grains;
mod made;
mod mineral;
mod organic;
mod random_field;
mod surface;

use super::random::Random;
use super::{Field, Fractal, Limits, Range};
use crate::volume::Shape;

/// A number that a family's rule needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Its name in recipes.
    pub name: &'static str,
    /// What it does, with its unit.
    pub about: &'static str,
    /// What a recipe may ask for.
    pub limits: Limits,
    /// What it is drawn from where a recipe says nothing.
    pub usual: Range,
}

/// A way to paint a texture.
pub struct Family {
    /// Its name in recipes and tags.
    pub name: &'static str,
    /// What it looks like, in a sentence.
    pub about: &'static str,
    /// Whether it can tile without a seam.
    pub tiles: bool,
    /// Its parameters, in the order of [`Specimen::values`](super::Specimen::values).
    pub parameters: &'static [Parameter],
    paint: fn(Brush) -> Field,
}

impl Family {
    /// The family of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        FAMILIES.iter().copied().find(|family| family.name == name)
    }

    /// The painted field: 0 is black, 1 is white.
    pub(super) fn paint(&self, brush: Brush) -> Field {
        (self.paint)(brush)
    }
}

impl std::fmt::Debug for Family {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Family").field(&self.name).finish()
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
    &made::CHECKER,
    &made::STRIPES,
    &made::BRICK,
    &made::WEAVE,
    &made::DOTS,
    &made::LAMELLAE,
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

/// A parameter that takes any number within limits.
const fn real(name: &'static str, limits: [f64; 2], usual: [f64; 2], about: &'static str) -> Parameter {
    let limits = Limits { low: limits[0], high: limits[1], whole: false };
    Parameter { name, about, limits, usual: Range { low: usual[0], high: usual[1] } }
}

/// A parameter that takes whole numbers.
const fn whole(name: &'static str, limits: [u32; 2], usual: [u32; 2], about: &'static str) -> Parameter {
    let limits = Limits { low: limits[0] as f64, high: limits[1] as f64, whole: true };
    Parameter { name, about, limits, usual: Range { low: usual[0] as f64, high: usual[1] as f64 } }
}

/// The size of the coarsest features.
const fn scale(usual: [f64; 2]) -> Parameter {
    real("scale", [2.0, 256.0], usual, "size of the coarsest features, in voxels")
}

/// The number of noise octaves.
const fn octaves(usual: [u32; 2]) -> Parameter {
    whole("octaves", [1, 12], usual, "number of noise octaves; those finer than a voxel are left out")
}

/// How far the pattern is turned.
const fn tilt(usual: [f64; 2]) -> Parameter {
    real("tilt", [0.0, 180.0], usual, "angle of the pattern against the volume's axes, in degrees")
}

/// What a family paints with: the shape, the drawn parameters and a stream of seeded draws.
pub(super) struct Brush<'a> {
    shape: Shape,
    tile: bool,
    values: &'a [f32],
    random: Random,
}

impl<'a> Brush<'a> {
    /// A brush for one specimen.
    pub(super) fn new(shape: Shape, tile: bool, values: &'a [f32], random: Random) -> Self {
        Self { shape, tile, values, random }
    }

    /// The parameters, in the family's order, all of them.
    fn values<const N: usize>(&self) -> [f32; N] {
        debug_assert_eq!(self.values.len(), N, "a family takes all its parameters");
        std::array::from_fn(|i| self.values.get(i).copied().unwrap_or_default())
    }

    /// The paper's sum of octaves, seeded anew.
    fn noise(&mut self, octaves: f32) -> Fractal {
        Fractal::paper(self.random.seed(), octaves as u32)
    }

    /// The field of a sum of octaves with features of `scale` voxels.
    fn field(&self, fractal: Fractal, scale: f32) -> Field {
        fractal.field(self.shape, [scale; 3], self.tile)
    }

    /// Axes turned by `tilt` degrees about an axis drawn at random, with an origin drawn at random.
    fn frame(&mut self, tilt: f32) -> Frame {
        let [x, y, z] = self.random.direction();
        let (sin, cos) = libm::sincosf(tilt * (std::f32::consts::PI / 180.0));
        let c = 1.0 - cos;
        Frame {
            axes: [
                [cos + x * x * c, x * y * c - z * sin, x * z * c + y * sin],
                [y * x * c + z * sin, cos + y * y * c, y * z * c - x * sin],
                [z * x * c - y * sin, z * y * c + x * sin, cos + z * z * c],
            ],
            origin: [(); 3].map(|()| self.random.between32(-500.0, 500.0)),
        }
    }

    /// `f` of the position of each voxel, in voxels along the axes of `frame`.
    fn positions(&self, frame: &Frame, mut f: impl FnMut([f32; 3]) -> f32) -> Field {
        Field::from_positions(self.shape, |p| f(frame.place(p)))
    }
}

/// Turned and shifted axes.
struct Frame {
    axes: [[f32; 3]; 3],
    origin: [f32; 3],
}

impl Frame {
    fn place(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let along = |axis: usize| {
            let row = self.axes[axis];
            row[0] * x + row[1] * y + row[2] * z + self.origin[axis]
        };
        [along(0), along(1), along(2)]
    }
}

/// 0 below `low`, 1 above `high`, smooth between.
fn smoothstep(low: f32, high: f32, v: f32) -> f32 {
    let t = ((v - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The sine of a full turn times `turns`.
fn wave(turns: f32) -> f32 {
    // The whole turns go first: they would cost precision.
    libm::sinf(std::f32::consts::TAU * super::noise::floor(turns).1)
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn families_and_parameters_are_well_formed() {
        let mut names = HashSet::new();
        for family in FAMILIES {
            assert!(names.insert(family.name), "{} twice", family.name);
            assert!(family.about.ends_with('.') && !family.parameters.is_empty(), "{}", family.name);
            let mut names = HashSet::new();
            for Parameter { name, limits, usual, .. } in family.parameters {
                assert!(names.insert(name), "{}: {name} twice", family.name);
                assert!(limits.low <= usual.low && usual.low <= usual.high && usual.high <= limits.high, "{name}");
            }
        }
    }

    #[test]
    fn frames_keep_lengths_and_hands() {
        let mut brush = Brush::new([9; 3], false, &[], Random::of(3, "", 0, ""));
        for tilt in [0.0, 30.0, 90.0, 180.0] {
            let [a, b, c] = brush.frame(tilt).axes;
            let dot = |p: [f32; 3], q: [f32; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
            let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            let turned = (a[0] + b[1] + c[2] - 1.0) / 2.0;
            let cosine = libm::cosf(tilt.to_radians());
            for (found, expected) in [(dot(a, a), 1.0), (dot(a, b), 0.0), (dot(cross, c), 1.0), (turned, cosine)] {
                assert!((found - expected).abs() < 1e-5, "{found} {expected}");
            }
        }
    }

    #[test]
    fn every_family_paints_at_the_ends_of_its_limits() {
        for family in FAMILIES {
            for end in 0..3 {
                let value = |p: &Parameter| [p.limits.low, p.limits.high, p.usual.low][end] as f32;
                let values: Vec<f32> = family.parameters.iter().map(value).collect();
                let random = Random::of(1, family.name, 0, "voxels");
                let field = family.paint(Brush::new([9, 10, 11], family.tiles, &values, random));
                assert_eq!(field.shape(), [9, 10, 11]);
                assert!(field.values().iter().all(|v| v.is_finite()), "{} at end {end}", family.name);
            }
        }
    }
}
