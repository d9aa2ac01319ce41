//! Noise itself: one octave, and the sums of octaves that other families build on.

use super::family::{Brush, Family, octaves, real, scale};
use crate::synth::field::Field;
use crate::synth::fractal::{Fractal, OctaveFold};
use crate::synth::noise::Lattice;

pub(super) static PERLIN: Family = Family {
    name: "perlin",
    about: "Perlin's gradient noise, one octave: the paper's type (a).",
    tiles: true,
    parameters: &[scale([4.0, 16.0])],
    paint: |mut brush| {
        let [scale] = brush.values();
        let noise = brush.noise(1.0);
        brush.field(noise, scale).stretched()
    },
};

pub(super) static FRACTAL: Family = Family {
    name: "fractal",
    about: "The paper's sum of octaves, each twice as fine and half as strong as the previous one.",
    tiles: true,
    parameters: &[scale([12.0, 32.0]), octaves([3, 5])],
    paint: |mut brush| {
        let [scale, octaves] = brush.values();
        let noise = brush.noise(octaves);
        brush.field(noise, scale).stretched()
    },
};

/// The parameters of a sum with free gain and lacunarity: scale, octaves, lacunarity, gain.
macro_rules! sum_parameters {
    ($scale:expr, $octaves:expr, $gain:expr) => {
        &[
            scale($scale),
            octaves($octaves),
            real("lacunarity", [1.5, 4.0], [1.8, 2.2], "ratio of the scales of successive octaves"),
            real("gain", [0.1, 1.0], $gain, "strength of each octave relative to the previous one"),
        ]
    };
}

/// A sum of octaves with the four parameters of [`sum_parameters`].
fn sum(mut brush: Brush, fold: OctaveFold) -> Field {
    let [scale, octaves, lacunarity, gain] = brush.values();
    let fractal = Fractal { lacunarity, gain, fold, ..brush.noise(octaves) };
    brush.field(fractal, scale).stretched()
}

pub(super) static FBM: Family = Family {
    name: "fbm",
    about: "Fractional Brownian motion: octaves with free gain and lacunarity, rougher than the paper's sum.",
    tiles: true,
    parameters: sum_parameters!([12.0, 32.0], [5, 6], [0.65, 0.85]),
    paint: |brush| sum(brush, OctaveFold::Plain),
};

pub(super) static TURBULENCE: Family = Family {
    name: "turbulence",
    about: "The sum of the octaves' absolute values: billows with dark creases.",
    tiles: true,
    parameters: sum_parameters!([12.0, 28.0], [3, 5], [0.4, 0.6]),
    paint: |brush| sum(brush, OctaveFold::Absolute),
};

pub(super) static RIDGED: Family = Family {
    name: "ridged",
    about: "Ridged noise: sharp bright ridges, rough near their crests.",
    tiles: true,
    parameters: sum_parameters!([12.0, 28.0], [3, 5], [0.4, 0.6]),
    paint: |brush| sum(brush, OctaveFold::Ridged),
};

pub(super) static VALUE: Family = Family {
    name: "value",
    about: "Value noise: random greys on a lattice, faded between; blockier than gradient noise.",
    tiles: false,
    parameters: &[scale([5.0, 14.0])],
    paint: |mut brush| {
        let [scale] = brush.values();
        let lattice = Lattice::wide(brush.random.seed());
        let frame = brush.frame(0.0);
        brush.positions(&frame, |p| lattice.value(p.map(|v| v / scale))).stretched()
    },
};
