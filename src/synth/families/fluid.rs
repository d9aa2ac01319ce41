//! Fluids and what they form: clouds, smoke, water, interfering waves, dunes.

use super::family::{Brush, Family, octaves, real, scale, smoothstep, tilt, wave, whole};
use crate::synth::field::Field;
use crate::synth::fractal::{Fractal, OctaveFold};
use crate::synth::noise::floor;

pub(super) static CLOUDS: Family = Family {
    name: "clouds",
    about: "Clouds: soft white billows with holes of empty sky.",
    tiles: true,
    parameters: &[
        scale([20.0, 36.0]),
        octaves([4, 5]),
        real("cover", [0.0, 1.0], [0.35, 0.6], "share of the sky that is covered"),
        real("soft", [0.01, 2.0], [0.3, 0.6], "width of a cloud's border, in units of noise"),
    ],
    paint: |mut brush| {
        let [scale, octaves, cover, soft] = brush.values();
        let noise = brush.noise(octaves);
        let field = brush.field(noise, scale);
        let edge = field.quantile(1.0 - cover);
        field.map(|noise| {
            let within = ((noise - edge) / soft).clamp(0.0, 1.0);
            0.05 + 0.95 * within * (2.0 - within)
        })
    },
};

pub(super) static SMOKE: Family = Family {
    name: "smoke",
    about: "Smoke: wisps of noise whose domain is displaced by noise, twice.",
    tiles: false,
    parameters: &[
        scale([18.0, 30.0]),
        octaves([3, 4]),
        real("curl", [0.0, 4.0], [0.8, 1.6], "displacement of the wisps, in units of the scale"),
    ],
    paint: |mut brush| {
        let [scale, octaves, curl] = brush.values();
        let near = displacement(&mut brush, scale, curl);
        let far = displacement(&mut brush, 0.5 * scale, 0.35 * curl);
        let noise = brush.noise(octaves);
        let frame = brush.frame(0.0);
        let mut voxel = 0;
        let wisps = brush.positions(&frame, |p| {
            let at = |axis: usize| p[axis] / scale + near[axis].values()[voxel] + far[axis].values()[voxel];
            let value = noise.at([at(0), at(1), at(2)]);
            voxel += 1;
            value
        });
        wisps.stretched().map(|wisp| smoothstep(0.15, 0.9, wisp))
    },
};

/// Displacements along x, y and z of about `strength` at most.
fn displacement(brush: &mut Brush, scale: f32, strength: f32) -> [Field; 3] {
    [(); 3].map(|()| {
        let noise = brush.noise(1.0);
        brush.field(noise, scale).map(|noise| strength * noise)
    })
}

pub(super) static WATER: Family = Family {
    name: "water",
    about: "Water: the bright net of caustics, thin crests of ridged noise.",
    tiles: true,
    parameters: &[scale([14.0, 24.0]), real("sharp", [1.0, 20.0], [4.0, 8.0], "sharpness of the bright lines")],
    paint: |mut brush| {
        let [scale, sharp] = brush.values();
        let mut layer = |scale: f32| {
            let noise = brush.noise(1.0).folded(OctaveFold::Absolute);
            brush.field(noise, scale).map(|noise| libm::expf(-sharp * noise))
        };
        let (coarse, fine) = (layer(scale), layer(0.62 * scale));
        coarse.zip(&fine, |coarse, fine| coarse + fine).stretched()
    },
};

pub(super) static WAVES: Family = Family {
    name: "waves",
    about: "Interference: the sum of plane waves of one length in a few directions.",
    tiles: false,
    parameters: &[
        real("length", [3.0, 256.0], [7.0, 14.0], "length of a wave, in voxels"),
        whole("count", [1, 16], [3, 5], "number of waves"),
    ],
    paint: |mut brush| {
        let [length, count] = brush.values();
        let frame = brush.frame(0.0);
        let mut sum = Field::constant(brush.shape, 0.0);
        for _ in 0..count as u32 {
            let [a, b, c] = brush.random.direction();
            let waves = brush.positions(&frame, |[x, y, z]| wave((a * x + b * y + c * z) / length));
            sum = sum.zip(&waves, |sum, wave| sum + wave);
        }
        sum.map(|sum| 0.5 + 0.5 * sum / count)
    },
};

pub(super) static DUNES: Family = Family {
    name: "dunes",
    about: "Dunes: ripples with a long slope and a steep one, winding and branching.",
    tiles: false,
    parameters: &[
        real("spacing", [2.0, 256.0], [7.0, 13.0], "distance between crests, in voxels"),
        real("winding", [0.0, 4.0], [0.5, 1.1], "displacement of the crests, in spacings"),
        real("steep", [0.02, 0.98], [0.12, 0.28], "share of a ripple that is the steep slope"),
        tilt([0.0, 180.0]),
    ],
    paint: |mut brush| {
        let [spacing, winding, steep, tilt] = brush.values();
        let winds = Fractal::paper(brush.random.seed(), 2);
        let winds = brush.field(winds, 4.0 * spacing);
        let frame = brush.frame(tilt);
        let across = brush.positions(&frame, |[x, ..]| x / spacing);
        across.zip(&winds, |at, wind| {
            let (_, within) = floor(at + winding * wind);
            let height = if within < steep { within / steep } else { (1.0 - within) / (1.0 - steep) };
            0.15 + 0.75 * height * height * (3.0 - 2.0 * height) + 0.1 * wind
        })
    },
};
