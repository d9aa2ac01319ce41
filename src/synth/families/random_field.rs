//! Filtered white noise: Gaussian fields, porous media, labyrinths, brushed metal, smoothed speckle, camouflage,
//! sediment.

use super::family::{Brush, Family, octaves, real, scale, smoothstep, tilt, whole};
use crate::synth::field::Field;
use crate::synth::fractal::Fractal;
use crate::synth::noise::{Lattice, hash, lerp, unit};

/// White noise: one uniform number from 0 to 1 per voxel.
fn white(brush: &mut Brush) -> Field {
    let seed = brush.random.seed();
    let mut field = Field::constant(brush.shape, 0.0);
    for (voxel, value) in (0_u64..).zip(field.values_mut()) {
        *value = unit(hash(seed, voxel as u32, (voxel >> 32) as u32, 0));
    }
    field
}

/// White noise after three box blurs, close to a Gaussian filter, with mean 0 and standard deviation 1.
fn gaussian(brush: &mut Brush, radius: [u32; 3]) -> Field {
    normalised(white(brush).blurred(radius.map(|r| r as usize), 3))
}

/// The field with mean 0 and standard deviation 1; sums in `f64`, in memory order.
fn normalised(field: Field) -> Field {
    let count = field.values().len() as f64;
    let mean = field.values().iter().map(|&v| f64::from(v)).sum::<f64>() / count;
    let variance = field.values().iter().map(|&v| (f64::from(v) - mean) * (f64::from(v) - mean)).sum::<f64>() / count;
    let (mean, scale) = (mean as f32, 1.0 / variance.sqrt().max(1e-9) as f32);
    field.map(|v| (v - mean) * scale)
}

pub(super) static GAUSSIAN: Family = Family {
    name: "gaussian",
    about: "A Gaussian random field: white noise, smoothed.",
    tiles: true,
    parameters: &[whole("radius", [1, 32], [1, 3], "radius of the smoothing, in voxels")],
    paint: |mut brush| {
        let [radius] = brush.values();
        gaussian(&mut brush, [radius as u32; 3]).map(|v| 0.5 + 0.17 * v)
    },
};

pub(super) static BRUSHED: Family = Family {
    name: "brushed",
    about: "Brushed metal: noise smeared along one axis.",
    tiles: true,
    parameters: &[
        whole("length", [1, 64], [4, 8], "radius of the smear, in voxels"),
        real("shine", [0.0, 1.0], [0.1, 0.3], "strength of broad changes of brightness"),
    ],
    paint: |mut brush| {
        let [length, shine] = brush.values();
        let mut radius = [0; 3];
        radius[brush.random.below(3) as usize] = length as u32;
        let broad = brush.noise(1.0);
        let broad = brush.field(broad, 24.0);
        gaussian(&mut brush, radius).zip(&broad, |streak, broad| 0.5 + 0.15 * streak + shine * broad)
    },
};

pub(super) static SPECKLE: Family = Family {
    name: "speckle",
    about: "Salt and pepper: scattered white and black grains on grey, a little smoothed.",
    tiles: true,
    parameters: &[
        real("share", [0.001, 1.0], [0.02, 0.08], "share of the voxels that are salt or pepper"),
        real("salt", [0.0, 1.0], [0.3, 0.7], "share of salt among them"),
    ],
    paint: |mut brush| {
        let [share, salt] = brush.values();
        let speckle = white(&mut brush).map(|v| {
            if v < share * salt {
                1.0
            } else if v < share {
                -1.0
            } else {
                0.0
            }
        });
        // One pass of radius 1 reduces a speck to 1/27 of its height.
        speckle.blurred([1; 3], 1).map(|v| 0.5 + 8.0 * v)
    },
};

pub(super) static SANDSTONE: Family = Family {
    name: "sandstone",
    about: "Sandstone: pale grains with dark pores between, some of them filled with grey clay.",
    tiles: true,
    parameters: &[
        whole("radius", [1, 16], [1, 2], "radius of the smoothing that makes the grains, in voxels"),
        real("porosity", [0.0, 1.0], [0.15, 0.35], "share of pores"),
        real("clay", [0.0, 1.0], [0.1, 0.4], "share of the pores that clay fills"),
    ],
    paint: |mut brush| {
        let [radius, porosity, clay] = brush.values();
        let pores = gaussian(&mut brush, [radius as u32; 3]);
        let filled = gaussian(&mut brush, [radius as u32 + 2; 3]);
        let grain = gaussian(&mut brush, [0; 3]);
        let (edge, full) = (pores.quantile(porosity), filled.quantile(clay));
        let fill = filled.map(|v| if v < full { 0.42 } else { 0.1 });
        let rock = pores.zip(&fill, |v, fill| lerp(smoothstep(edge - 0.12, edge + 0.12, v), fill, 0.75));
        rock.zip(&grain, |rock, grain| rock + 0.02 * grain)
    },
};

pub(super) static SPINODAL: Family = Family {
    name: "spinodal",
    about: "A labyrinth of two separating phases: one channel width, no preferred direction.",
    tiles: true,
    parameters: &[
        whole("radius", [1, 16], [1, 3], "inner radius of the filter, in voxels: a quarter of a channel's width"),
        real("share", [0.05, 0.95], [0.4, 0.6], "share of the light phase"),
    ],
    paint: |mut brush| {
        let [radius, share] = brush.values();
        // A band of wavelengths: a narrow blur minus a wide one.
        let noise = white(&mut brush);
        let radius = radius as usize;
        let wide = noise.clone().blurred([radius + radius.div_ceil(2); 3], 3);
        let band = normalised(noise.blurred([radius; 3], 3).zip(&wide, |narrow, wide| narrow - wide));
        let edge = band.quantile(1.0 - share);
        band.map(|v| 0.12 + 0.76 * smoothstep(edge - 0.35, edge + 0.35, v))
    },
};

pub(super) static CAMOUFLAGE: Family = Family {
    name: "camouflage",
    about: "Camouflage: overlapping blobs of four flat greys.",
    tiles: true,
    parameters: &[
        scale([14.0, 24.0]),
        octaves([2, 3]),
        real("cover", [0.0, 1.0], [0.3, 0.45], "share that a grey covers"),
    ],
    paint: |mut brush| {
        let [scale, octaves, cover] = brush.values();
        let mut flat = Field::constant(brush.shape, 0.85);
        for grey in [0.6, 0.35, 0.1] {
            let noise = brush.noise(octaves);
            let blobs = brush.field(noise, scale);
            let edge = blobs.quantile(1.0 - cover);
            flat = flat.zip(&blobs, |below, blob| if blob > edge { grey } else { below });
        }
        flat
    },
};

pub(super) static SEDIMENT: Family = Family {
    name: "sediment",
    about: "Sediment: beds of many thicknesses and greys, gently folded, with a grain like sand.",
    tiles: false,
    parameters: &[
        real("bed", [2.0, 256.0], [14.0, 28.0], "thickness of the thickest beds, in voxels"),
        real("fold", [0.0, 4.0], [0.1, 0.5], "height of the folds, in beds"),
        real("sand", [0.0, 1.0], [0.05, 0.14], "strength of the grain"),
        tilt([0.0, 180.0]),
    ],
    paint: |mut brush| {
        let [bed, fold, sand, tilt] = brush.values();
        let folds = brush.noise(2.0);
        let folds = brush.field(folds, 48.0);
        let grain = gaussian(&mut brush, [0; 3]);
        let beds: [Lattice; 4] = [(); 4].map(|()| Lattice::wide(brush.random.seed()));
        let frame = brush.frame(tilt);
        let height = brush.positions(&frame, |[_, _, z]| z / bed);
        let layers = height.zip(&folds, |height, folds| {
            let at = height + fold * folds;
            // Value noise along the height only, finer and weaker by octaves.
            let octave = |(i, bed): (i32, &Lattice)| {
                let finer = (1 << i) as f32;
                bed.value([0.5, 0.5, at * finer]) / (1.0 + 0.6 * i as f32)
            };
            0.5 + 0.3 * (0..).zip(&beds).map(octave).sum::<f32>()
        });
        layers.zip(&grain, |layer, grain| layer + sand * grain)
    },
};

pub(super) static LAVA: Family = Family {
    name: "lava",
    about: "Lava: glowing seams between dark, crusted plates of noise.",
    tiles: true,
    parameters: &[
        scale([16.0, 28.0]),
        real("glow", [0.01, 1.0], [0.08, 0.16], "width of the seams, in units of noise"),
        real("crust", [0.0, 1.0], [0.2, 0.35], "contrast of the crust"),
    ],
    paint: |mut brush| {
        let [scale, glow, crust] = brush.values();
        let seams = Fractal { gain: 0.55, ..brush.noise(4.0) };
        let (seams, rough) = (brush.field(seams, scale), brush.noise(3.0));
        let rough = brush.field(rough, 5.0);
        seams.zip(&rough, |seam, rough| {
            let heat = libm::expf(-seam.abs() / glow);
            lerp(heat, 0.15 + crust * rough.abs(), 1.0)
        })
    },
};
