//! Minerals: marble, granite, agate, veined rock.

use super::family::{Family, octaves, real, scale, smoothstep, tilt, wave};
use crate::synth::fractal::OctaveFold;
use crate::synth::noise::{Cells, floor, hash, lerp, unit};

pub(super) static MARBLE: Family = Family {
    name: "marble",
    about: "Marble: parallel veins, folded by turbulence.",
    tiles: false,
    parameters: &[
        scale([16.0, 32.0]),
        octaves([3, 5]),
        real("spacing", [2.0, 256.0], [10.0, 20.0], "distance between veins, in voxels"),
        real("power", [0.0, 10.0], [0.8, 2.0], "displacement of the veins by turbulence, in spacings"),
        real("sharpness", [0.1, 4.0], [0.4, 0.8], "exponent of the profile: low values give thin dark veins"),
        tilt([0.0, 180.0]),
    ],
    paint: |mut brush| {
        let [scale, octaves, spacing, power, sharpness, tilt] = brush.values();
        let noise = brush.noise(octaves).folded(OctaveFold::Absolute);
        let folds = brush.field(noise, scale);
        let frame = brush.frame(tilt);
        let across = brush.positions(&frame, |[x, ..]| x / spacing);
        across.zip(&folds, |at, fold| libm::powf(wave(0.5 * at + 0.5 * power * fold).abs(), sharpness)).stretched()
    },
};

pub(super) static GRANITE: Family = Family {
    name: "granite",
    about: "Granite: interlocking grains of dark, grey and light minerals.",
    tiles: false,
    parameters: &[
        scale([4.0, 7.0]),
        real("dark", [0.0, 1.0], [0.15, 0.35], "fraction of the dark mineral"),
        real("light", [0.0, 1.0], [0.2, 0.35], "fraction of the light mineral"),
        real("grain", [0.0, 1.0], [0.15, 0.3], "strength of the fine grain within minerals"),
    ],
    paint: |mut brush| {
        let [scale, dark, light, grain] = brush.values();
        let cells = Cells::new(brush.random.seed(), Cells::WIDE, 1.0);
        let (ragged, fine) = (brush.noise(2.0), brush.noise(2.0));
        let (ragged, fine) = (brush.field(ragged, 0.7 * scale), brush.field(fine, 3.0));
        let frame = brush.frame(90.0);
        let mut ragged = ragged.values().iter();
        let minerals = brush.positions(&frame, |p| {
            // Ragged borders: noise displaces the position before its cell is looked up.
            let push = 0.35 * scale * ragged.next().copied().unwrap_or_default();
            let nearest = cells.nearest([(p[0] + push) / scale, (p[1] - push) / scale, (p[2] + push) / scale]);
            let kind = unit(nearest.cell);
            let shade = 0.2 * unit(hash(nearest.cell, 7, 0, 0)) - 0.1;
            shade
                + if kind < dark {
                    0.12
                } else if kind < dark + light {
                    0.9
                } else {
                    0.55
                }
        });
        minerals.zip(&fine, |mineral, fine| mineral + grain * fine)
    },
};

pub(super) static AGATE: Family = Family {
    name: "agate",
    about: "Agate: thin bands of random greys along the contours of smooth noise.",
    tiles: false,
    parameters: &[
        scale([28.0, 48.0]),
        real("bands", [1.0, 100.0], [9.0, 18.0], "number of bands per unit of noise"),
        real("soft", [0.02, 1.0], [0.2, 0.6], "fraction of a band over which it fades into the next"),
    ],
    paint: |mut brush| {
        let [scale, bands, soft] = brush.values();
        let (noise, seed) = (brush.noise(2.0), brush.random.seed());
        let grey = |band: i32| unit(hash(seed, band as u32, 0, 0));
        let contours = brush.field(noise, scale);
        contours.map(|noise| {
            let (band, within) = floor(bands * noise);
            lerp(smoothstep(1.0 - soft, 1.0, within), grey(band), grey(band + 1))
        })
    },
};

pub(super) static VEINS: Family = Family {
    name: "veins",
    about: "Veined rock: thin bright sheets through a dull background.",
    tiles: false,
    parameters: &[
        scale([18.0, 32.0]),
        real("width", [0.01, 1.0], [0.05, 0.12], "half-width of a vein, in units of noise"),
        real("ground", [0.0, 1.0], [0.15, 0.3], "contrast of the background"),
    ],
    paint: |mut brush| {
        let [scale, width, ground] = brush.values();
        let (paths, rock) = (brush.noise(3.0), brush.noise(4.0));
        let rock = brush.field(rock, 0.5 * scale);
        let paths = brush.field(paths, scale);
        paths.zip(&rock, |path, rock| {
            let vein = 1.0 - smoothstep(0.0, width, path.abs());
            lerp(vein, 0.35 + ground * rock, 0.95)
        })
    },
};
