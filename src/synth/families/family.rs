//! [`Family`], and what the families have in common: parameters, and the [`Brush`] that they paint with.

use crate::synth::field::Field;
use crate::synth::fractal::Fractal;
use crate::synth::random::Random;
use crate::synth::{ParameterLimits, ParameterRange};
use crate::volume::Shape;

/// A parameter of a family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FamilyParameter {
    /// The name in recipes.
    pub name: &'static str,
    /// The meaning, with the unit.
    pub about: &'static str,
    /// The values that a recipe may use.
    pub limits: ParameterLimits,
    /// The range where a recipe names none.
    pub usual: ParameterRange,
}

/// A procedure that paints a kind of texture.
pub struct Family {
    /// The name in recipes and tags.
    pub name: &'static str,
    /// A description in one sentence.
    pub about: &'static str,
    /// Whether its textures can tile without a seam.
    pub tiles: bool,
    /// The parameters, in the order of [`Specimen::values`](crate::synth::Specimen::values).
    pub parameters: &'static [FamilyParameter],
    pub(super) paint: fn(Brush) -> Field,
}

impl Family {
    /// Paints a texture: 0 is black, 1 is white.
    pub(in crate::synth) fn paint(&self, brush: Brush) -> Field {
        (self.paint)(brush)
    }
}

impl std::fmt::Debug for Family {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Family").field(&self.name).finish()
    }
}

/// A parameter that takes real numbers.
pub(super) const fn real(
    name: &'static str,
    limits: [f64; 2],
    usual: [f64; 2],
    about: &'static str,
) -> FamilyParameter {
    let limits = ParameterLimits { low: limits[0], high: limits[1], whole: false };
    FamilyParameter { name, about, limits, usual: ParameterRange { low: usual[0], high: usual[1] } }
}

/// A parameter that takes whole numbers.
pub(super) const fn whole(
    name: &'static str,
    limits: [u32; 2],
    usual: [u32; 2],
    about: &'static str,
) -> FamilyParameter {
    let limits = ParameterLimits { low: limits[0] as f64, high: limits[1] as f64, whole: true };
    FamilyParameter { name, about, limits, usual: ParameterRange { low: usual[0] as f64, high: usual[1] as f64 } }
}

/// The size of the coarsest features.
pub(super) const fn scale(usual: [f64; 2]) -> FamilyParameter {
    real("scale", [2.0, 256.0], usual, "size of the coarsest features, in voxels")
}

/// The number of noise octaves.
pub(super) const fn octaves(usual: [u32; 2]) -> FamilyParameter {
    whole("octaves", [1, 12], usual, "number of noise octaves; those finer than a voxel are left out")
}

/// The orientation of the pattern.
pub(super) const fn tilt(usual: [f64; 2]) -> FamilyParameter {
    real("tilt", [0.0, 180.0], usual, "angle of the pattern against the volume's axes, in degrees")
}

/// What a family paints with: the shape, the drawn parameters and a stream of random numbers.
pub(in crate::synth) struct Brush<'a> {
    pub(super) shape: Shape,
    pub(super) tile: bool,
    values: &'a [f32],
    pub(super) random: Random,
}

impl<'a> Brush<'a> {
    /// The brush for one specimen.
    pub(in crate::synth) fn new(shape: Shape, tile: bool, values: &'a [f32], random: Random) -> Self {
        Self { shape, tile, values, random }
    }

    /// All parameters, in the family's order.
    pub(super) fn values<const N: usize>(&self) -> [f32; N] {
        debug_assert_eq!(self.values.len(), N, "a family reads all its parameters");
        std::array::from_fn(|i| self.values.get(i).copied().unwrap_or_default())
    }

    /// The paper's sum of octaves with a new seed.
    pub(super) fn noise(&mut self, octaves: f32) -> Fractal {
        Fractal::paper(self.random.seed(), octaves as u32)
    }

    /// The field of a sum of octaves whose coarsest features have `scale` voxels.
    pub(super) fn field(&self, fractal: Fractal, scale: f32) -> Field {
        fractal.field(self.shape, [scale; 3], self.tile)
    }

    /// Coordinate axes rotated by `tilt` degrees about a random axis, with a random origin.
    pub(super) fn frame(&mut self, tilt: f32) -> Frame {
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

    /// The field of `f` at the position of each voxel, in voxels along the axes of `frame`.
    pub(super) fn positions(&self, frame: &Frame, mut f: impl FnMut([f32; 3]) -> f32) -> Field {
        Field::from_positions(self.shape, |p| f(frame.place(p)))
    }
}

/// Rotated and shifted coordinate axes.
pub(super) struct Frame {
    axes: [[f32; 3]; 3],
    pub(super) origin: [f32; 3],
}

impl Frame {
    /// The coordinates of a position of the volume.
    pub(super) fn place(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let along = |axis: usize| {
            let row = self.axes[axis];
            row[0] * x + row[1] * y + row[2] * z + self.origin[axis]
        };
        [along(0), along(1), along(2)]
    }
}

/// 0 below `low`, 1 above `high`, a smooth step between them.
pub(super) fn smoothstep(low: f32, high: f32, v: f32) -> f32 {
    let t = ((v - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The sine of `turns` full turns.
pub(super) fn wave(turns: f32) -> f32 {
    // Whole turns are removed first, because they would cost precision.
    libm::sinf(std::f32::consts::TAU * crate::synth::noise::floor(turns).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_rotations() {
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
}
