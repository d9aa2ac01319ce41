//! Artificial patterns: checker, stripes, brick, weave, lattices of dots, lamellae.

use super::family::{Family, real, smoothstep, tilt, wave};
use crate::synth::noise::{Cells, floor, hash, lerp, unit};

/// The strength of the noise over a pattern.
const NOISE: super::family::FamilyParameter = real("noise", [0.0, 1.0], [0.05, 0.2], "strength of the noise");

/// Distance to the nearest whole number.
fn from_whole(v: f32) -> f32 {
    let (_, part) = floor(v);
    part.min(1.0 - part)
}

pub(super) static CHECKER: Family = Family {
    name: "checker",
    about: "Checker: cubes, alternately black and white, with noise.",
    tiles: false,
    parameters: &[real("side", [2.0, 256.0], [5.0, 11.0], "side of a cube, in voxels"), NOISE, tilt([0.0, 20.0])],
    paint: |mut brush| {
        let [side, noise, tilt] = brush.values();
        let grain = brush.noise(3.0);
        let grain = brush.field(grain, 8.0);
        let frame = brush.frame(tilt);
        let cubes = brush.positions(&frame, |p| {
            let [x, y, z] = p.map(|v| floor(v / side).0);
            if (x ^ y ^ z) & 1 == 0 { 0.2 } else { 0.8 }
        });
        cubes.zip(&grain, |cube, grain| cube + noise * grain)
    },
};

pub(super) static STRIPES: Family = Family {
    name: "stripes",
    about: "Stripes: straight sheets, alternately dark and light, with noise.",
    tiles: false,
    parameters: &[
        real("spacing", [2.0, 256.0], [6.0, 14.0], "distance between sheets, in voxels"),
        real("soft", [0.02, 1.0], [0.2, 0.6], "how soft the borders are"),
        NOISE,
        tilt([0.0, 180.0]),
    ],
    paint: |mut brush| {
        let [spacing, soft, noise, tilt] = brush.values();
        let grain = brush.noise(3.0);
        let grain = brush.field(grain, 8.0);
        let frame = brush.frame(tilt);
        let sheets = brush.positions(&frame, |[x, ..]| smoothstep(-soft, soft, wave(x / spacing)));
        sheets.zip(&grain, |sheet, grain| 0.2 + 0.6 * sheet + noise * grain)
    },
};

pub(super) static BRICK: Family = Family {
    name: "brick",
    about: "Brick: blocks of several greys laid in bond, with pale mortar.",
    tiles: false,
    parameters: &[
        real("length", [6.0, 256.0], [14.0, 24.0], "length of a brick, in voxels; half as wide, a third as high"),
        real("mortar", [0.2, 20.0], [0.8, 1.6], "half-width of the mortar, in voxels"),
        NOISE,
        tilt([0.0, 12.0]),
    ],
    paint: |mut brush| {
        let [length, mortar, noise, tilt] = brush.values();
        let (grain, seed) = (brush.noise(3.0), brush.random.seed());
        let grain = brush.field(grain, 5.0);
        let frame = brush.frame(tilt);
        let sides = [length, length / 2.0, length / 3.0];
        let bricks = brush.positions(&frame, |p| {
            let course = floor(p[2] / sides[2]).0;
            let shift = 0.5 * (course & 1) as f32;
            let at = [p[0] / sides[0] + shift, p[1] / sides[1] + shift, p[2] / sides[2]];
            let [x, y, z] = at.map(|v| floor(v).0 as u32);
            let gap = |axis: usize| from_whole(at[axis]) * sides[axis];
            let inside = smoothstep(mortar - 0.4, mortar + 0.4, gap(0).min(gap(1)).min(gap(2)));
            lerp(inside, 0.85, 0.3 + 0.25 * unit(hash(seed, x, y, z)))
        });
        bricks.zip(&grain, |brick, grain| brick + noise * grain)
    },
};

pub(super) static WEAVE: Family = Family {
    name: "weave",
    about: "Weave: layers of round threads passing over and under one another.",
    tiles: false,
    parameters: &[
        real("spacing", [4.0, 256.0], [7.0, 12.0], "distance between threads, in voxels"),
        real("thread", [0.1, 0.5], [0.3, 0.42], "radius of a thread, in spacings"),
        NOISE,
        tilt([0.0, 180.0]),
    ],
    paint: |mut brush| {
        let [spacing, thread, noise, tilt] = brush.values();
        let grain = brush.noise(2.0);
        let grain = brush.field(grain, 3.0);
        let frame = brush.frame(tilt);
        let threads = brush.positions(&frame, |p| {
            let [x, y, z] = p.map(|v| v / spacing);
            // Warp runs along x, weft along y; each goes up and down alternately, in opposite phase.
            let warp = strand(x, y, z, 0.0).min(strand(y, x, z, 1.0));
            1.0 - smoothstep(0.0, thread, warp)
        });
        threads.zip(&grain, |thread, grain| 0.1 + 0.85 * thread.sqrt() + noise * grain * thread)
    },
};

/// Distance to the nearest thread running along `along`, in spacings; layers repeat every two spacings of height.
fn strand(along: f32, across: f32, height: f32, phase: f32) -> f32 {
    let (thread, within) = floor(across);
    let ride = 0.35 * wave(0.5 * (along + phase + thread as f32) + 0.25);
    let up = 1.6 * from_whole((height - ride) / 1.6);
    let side = within - 0.5;
    (side * side + up * up).sqrt()
}

pub(super) static DOTS: Family = Family {
    name: "dots",
    about: "Dots: equal balls on a lattice, slightly displaced.",
    tiles: false,
    parameters: &[
        real("spacing", [3.0, 256.0], [7.0, 13.0], "distance between balls, in voxels"),
        real("radius", [0.05, 0.7], [0.25, 0.38], "radius of a ball, in spacings"),
        real("jitter", [0.0, 1.0], [0.0, 0.2], "displacement of the balls, in spacings"),
        tilt([0.0, 180.0]),
    ],
    paint: |mut brush| {
        let [spacing, radius, jitter, tilt] = brush.values();
        let cells = Cells::new(brush.random.seed(), Cells::WIDE, jitter);
        let frame = brush.frame(tilt);
        let soft = 0.6 / spacing;
        brush.positions(&frame, |p| {
            let distance = cells.nearest(p.map(|v| v / spacing)).first.sqrt();
            0.1 + 0.8 * (1.0 - smoothstep(radius - soft, radius + soft, distance))
        })
    },
};

pub(super) static LAMELLAE: Family = Family {
    name: "lamellae",
    about: "Lamellae: grains of thin parallel plates, each grain with its own direction, like pearlite.",
    tiles: false,
    parameters: &[
        real("grain", [4.0, 256.0], [20.0, 34.0], "size of a grain, in voxels"),
        real("spacing", [2.0, 64.0], [3.5, 6.0], "distance between plates, in voxels"),
    ],
    paint: |mut brush| {
        let [grain, spacing] = brush.values();
        let cells = Cells::new(brush.random.seed(), Cells::WIDE, 1.0);
        let bend = brush.noise(1.0);
        let bend = brush.field(bend, 16.0);
        let frame = brush.frame(90.0);
        let mut bends = bend.values().iter();
        brush.positions(&frame, |p| {
            let name = cells.nearest(p.map(|v| v / grain)).cell;
            let [a, b, c] = [1, 2, 3].map(|salt| 2.0 * unit(hash(name, salt, 2, 0)) - 1.0);
            let norm = (a * a + b * b + c * c).sqrt().max(0.1);
            let across = (a * p[0] + b * p[1] + c * p[2]) / norm;
            let plates = wave(across / spacing + 0.4 * bends.next().copied().unwrap_or_default());
            0.5 + 0.4 * plates
        })
    },
};
