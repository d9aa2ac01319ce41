//! Worley's cellular noise: cobble stone, foam, crystals, scales, cracked ground, sponge.

use super::family::{Brush, Family, Frame, octaves, real, scale, smoothstep, tilt};
use crate::synth::field::Field;
use crate::synth::fractal::Fractal;
use crate::synth::noise::{Cells, hash, lerp, unit};

/// Cellular noise with a new seed.
fn cells(brush: &mut Brush, jitter: f32) -> Cells {
    Cells::new(brush.random.seed(), Cells::WIDE, jitter)
}

/// The field of `f` of the distances (in cells) to the two nearest feature points and the hash of the nearest one.
fn cellular(brush: &Brush, frame: &Frame, cells: &Cells, scale: f32, f: impl Fn(f32, f32, u32) -> f32) -> Field {
    brush.positions(frame, |p| {
        let nearest = cells.nearest(p.map(|v| v / scale));
        f(nearest.first.sqrt(), nearest.second.sqrt(), nearest.cell)
    })
}

/// A grey offset from -0.5 to 0.5, drawn from a hash.
fn shade(name: u32) -> f32 {
    unit(hash(name, 7, 0, 0)) - 0.5
}

pub(super) static STONE: Family = Family {
    name: "stone",
    about: "Cobble stone: rounded stones of several greys in dark mortar, rough on their faces.",
    tiles: false,
    parameters: &[
        scale([9.0, 15.0]),
        real("mortar", [0.01, 1.0], [0.12, 0.22], "width of the mortar, in cells"),
        real("rough", [0.0, 1.0], [0.08, 0.16], "strength of the roughness"),
    ],
    paint: |mut brush| {
        let [scale, mortar, rough] = brush.values();
        let cells = cells(&mut brush, 0.9);
        let noise = brush.noise(4.0);
        let noise = brush.field(noise, 6.0);
        let frame = brush.frame(90.0);
        let stones = cellular(&brush, &frame, &cells, scale, |first, second, name| {
            let inside = smoothstep(0.5 * mortar, 1.5 * mortar, second - first);
            0.12 + inside * (0.55 + 0.4 * shade(name) - 0.2 * first)
        });
        stones.zip(&noise, |stone, noise| stone + rough * noise)
    },
};

pub(super) static FOAM: Family = Family {
    name: "foam",
    about: "Foam: empty cells between thin bright walls.",
    tiles: false,
    parameters: &[
        scale([8.0, 16.0]),
        real("wall", [0.01, 1.0], [0.08, 0.18], "thickness of a wall, in cells"),
        real("jitter", [0.0, 1.0], [0.6, 1.0], "irregularity of the cells"),
    ],
    paint: |mut brush| {
        let [scale, wall, jitter] = brush.values();
        let cells = cells(&mut brush, jitter);
        let frame = brush.frame(90.0);
        cellular(&brush, &frame, &cells, scale, |first, second, _| {
            0.05 + 0.9 * (1.0 - smoothstep(0.5 * wall, 1.5 * wall, second - first))
        })
    },
};

pub(super) static CRYSTAL: Family = Family {
    name: "crystal",
    about: "Crystals: flat facets, each of one grey with a slight gradient in its own direction.",
    tiles: false,
    parameters: &[
        scale([10.0, 18.0]),
        real("slope", [0.0, 1.0], [0.1, 0.4], "how far the grey changes across a crystal"),
    ],
    paint: |mut brush| {
        let [scale, slope] = brush.values();
        let cells = cells(&mut brush, 1.0);
        let frame = brush.frame(90.0);
        brush.positions(&frame, |p| {
            let p = p.map(|v| v / scale);
            let name = cells.nearest(p).cell;
            let along = [1, 2, 3].map(|salt| 2.0 * unit(hash(name, salt, 1, 0)) - 1.0);
            let place = p[0] * along[0] + p[1] * along[1] + p[2] * along[2];
            // A triangle wave, because the position within the crystal is not known.
            let fold = (2.0 * crate::synth::noise::floor(0.5 * place).1 - 1.0).abs();
            0.5 + (1.0 - slope) * shade(name) + slope * (fold - 0.5)
        })
    },
};

pub(super) static SCALES: Family = Family {
    name: "scales",
    about: "Scales: overlapping bumps, bright at their middles, flattened like a reptile's skin.",
    tiles: false,
    parameters: &[
        scale([8.0, 14.0]),
        real("flat", [0.2, 1.0], [0.35, 0.6], "height of a scale as a share of its width"),
        tilt([0.0, 180.0]),
    ],
    paint: |mut brush| {
        let [scale, flat, tilt] = brush.values();
        let cells = cells(&mut brush, 0.5);
        let frame = brush.frame(tilt);
        brush.positions(&frame, |p| {
            let first = cells.nearest([p[0] / scale, p[1] / scale, p[2] / (scale * flat)]).first;
            1.0 - 1.1 * first.sqrt()
        })
    },
};

pub(super) static CRACKS: Family = Family {
    name: "cracks",
    about: "Cracked ground: pale plates separated by thin, ragged dark cracks.",
    tiles: false,
    parameters: &[
        scale([14.0, 24.0]),
        real("width", [0.01, 1.0], [0.05, 0.1], "width of a crack, in cells"),
        real("ragged", [0.0, 2.0], [0.15, 0.35], "displacement of the cracks, in cells"),
    ],
    paint: |mut brush| {
        let [scale, width, ragged] = brush.values();
        let cells = cells(&mut brush, 1.0);
        let stray = [0; 3].map(|_| brush.noise(3.0)).map(|noise| brush.field(noise, 0.5 * scale));
        let ground = brush.noise(4.0);
        let ground = brush.field(ground, scale);
        let frame = brush.frame(90.0);
        let mut voxel = 0;
        let plates = brush.positions(&frame, |p| {
            let at = |axis: usize| p[axis] / scale + ragged * stray[axis].values()[voxel];
            let nearest = cells.nearest([at(0), at(1), at(2)]);
            voxel += 1;
            smoothstep(0.3 * width, 1.2 * width, nearest.second.sqrt() - nearest.first.sqrt())
        });
        plates.zip(&ground, |plate, ground| lerp(plate, 0.08, 0.72 + 0.15 * ground))
    },
};

pub(super) static SPONGE: Family = Family {
    name: "sponge",
    about: "Sponge: a solid riddled with round pores of three sizes.",
    tiles: false,
    parameters: &[
        scale([14.0, 22.0]),
        real("pore", [0.1, 1.0], [0.42, 0.55], "radius of a pore, in cells"),
        octaves([3, 3]),
    ],
    paint: |mut brush| {
        let [scale, pore, octaves] = brush.values();
        let mut solid = Field::constant(brush.shape, 1.0);
        for octave in 0..octaves as i32 {
            let size = scale / (1 << octave) as f32;
            if size < 3.0 {
                break;
            }
            let (cells, frame) = (cells(&mut brush, 0.8), brush.frame(90.0));
            let soft = 0.7 / size;
            let pores =
                cellular(&brush, &frame, &cells, size, |first, _, _| smoothstep(pore - soft, pore + soft, first));
            solid = solid.zip(&pores, f32::min);
        }
        let grain = Fractal::simple(brush.random.seed()).field(brush.shape, [3.0; 3], false);
        solid.zip(&grain, |solid, grain| 0.1 + solid * (0.7 + 0.15 * grain))
    },
};
