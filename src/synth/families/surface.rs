//! Triply periodic minimal surfaces, by their trigonometric approximations: gyroid, Schwarz P, diamond, I-WP.

use std::f32::consts::TAU;

use super::family::{Brush, Family, FamilyParameter, real, smoothstep, tilt};
use crate::synth::field::Field;

/// The parameters that all of these families share.
const PARAMETERS: &[FamilyParameter] = &[
    real("period", [4.0, 256.0], [14.0, 24.0], "length after which the surface repeats, in voxels"),
    real("level", [-1.0, 1.0], [-0.3, 0.3], "level of the function at the border between dark and light"),
    real("soft", [0.02, 4.0], [0.3, 0.8], "width of the border, in units of the function"),
    tilt([0.0, 180.0]),
];

/// Paints one side of the surface light and the other dark. `f` takes the sines and the cosines of the three phases.
fn sides(mut brush: Brush, f: impl Fn([f32; 3], [f32; 3]) -> f32) -> Field {
    let [period, level, soft, tilt] = brush.values();
    let frame = brush.frame(tilt);
    brush.positions(&frame, |p| {
        let phases = p.map(|v| libm::sincosf(TAU * crate::synth::noise::floor(v / period).1));
        let value = f(phases.map(|(sin, _)| sin), phases.map(|(_, cos)| cos));
        0.1 + 0.8 * smoothstep(level - soft, level + soft, value)
    })
}

pub(super) static GYROID: Family = Family {
    name: "gyroid",
    about: "Gyroid: two winding labyrinths, one dark and one light.",
    tiles: false,
    parameters: PARAMETERS,
    paint: |brush| sides(brush, |[sx, sy, sz], [cx, cy, cz]| sx * cy + sy * cz + sz * cx),
};

pub(super) static PRIMITIVE: Family = Family {
    name: "primitive",
    about: "Schwarz's P surface: chambers joined by necks along the axes.",
    tiles: false,
    parameters: PARAMETERS,
    paint: |brush| sides(brush, |_, [cx, cy, cz]| cx + cy + cz),
};

pub(super) static DIAMOND: Family = Family {
    name: "diamond",
    about: "Schwarz's D surface: two labyrinths joined like the atoms of diamond.",
    tiles: false,
    parameters: PARAMETERS,
    paint: |brush| sides(brush, |[sx, sy, sz], [cx, cy, cz]| sx * sy * sz + sx * cy * cz + cx * sy * cz + cx * cy * sz),
};

pub(super) static IWP: Family = Family {
    name: "iwp",
    about: "Schoen's I-WP surface: chambers at corners and middles, each joined to eight others.",
    tiles: false,
    parameters: PARAMETERS,
    paint: |brush| {
        let double = |c: f32| 2.0 * c * c - 1.0;
        sides(brush, |_, [x, y, z]| 2.0 * (x * y + y * z + z * x) - double(x) - double(y) - double(z))
    },
};
