//! Objects scattered at random: balls, bubbles, fibres, rust spots.

use super::family::{Brush, Family, real, smoothstep};
use crate::synth::field::Field;
use crate::synth::fractal::Fractal;

/// A ball: its centre (z, y, x) and its radius, in voxels.
struct Ball {
    centre: [f32; 3],
    radius: f32,
}

/// The most balls of one texture: more than any useful density needs, and a limit on time.
const MAX_BALLS: f32 = 200_000.0;

/// Scatters balls with radii from `radius[0]` to `radius[1]` whose volumes add up to `share` of the whole.
fn scatter(brush: &mut Brush, radius: [f32; 2], share: f32) -> Vec<Ball> {
    let voxels: f32 = brush.shape.iter().map(|&side| side as f32).product();
    let mean = 0.5 * (radius[0] + radius[1]);
    let count = (share * voxels / (4.19 * mean * mean * mean)).clamp(1.0, MAX_BALLS);
    let sides = brush.shape.map(|side| side as f32);
    let mut ball = |_| Ball {
        centre: sides.map(|side| brush.random.between32(0.0, side)),
        radius: brush.random.between32(radius[0], radius[1]),
    };
    (0..count as u32).map(&mut ball).collect()
}

/// Calls `paint(distance from the centre, voxel)` for every voxel within `reach` of the centre. The field is treated as one
/// period of a periodic field, so that balls continue across borders.
fn stamp(field: &mut Field, centre: [f32; 3], reach: f32, mut paint: impl FnMut(f32, &mut f32)) {
    let shape = field.shape();
    // At most half a period to either side, so that each voxel is visited once, at its nearest image.
    let span = |axis: usize| {
        let side = shape[axis] as f32;
        let low = (centre[axis] - reach.min(0.5 * side)).ceil() as i64;
        let high = (centre[axis] + reach).floor() as i64;
        low..=high.min(low + shape[axis] as i64 - 1)
    };
    let wrapped = |axis: usize, at: i64| at.rem_euclid(shape[axis] as i64) as usize;
    for z in span(0) {
        for y in span(1) {
            let (dz, dy) = (z as f32 - centre[0], y as f32 - centre[1]);
            let row = (wrapped(0, z) * shape[1] + wrapped(1, y)) * shape[2];
            for x in span(2) {
                let dx = x as f32 - centre[2];
                let squared = dz * dz + dy * dy + dx * dx;
                if squared <= reach * reach {
                    paint(squared.sqrt(), &mut field.values_mut()[row + wrapped(2, x)]);
                }
            }
        }
    }
}

/// Adds fine noise to a field.
fn grained(brush: &mut Brush, field: Field, strength: f32) -> Field {
    let grain = Fractal::paper(brush.random.seed(), 2).field(brush.shape, [3.0; 3], false);
    field.zip(&grain, |value, grain| value + strength * grain)
}

pub(super) static SPHERES: Family = Family {
    name: "spheres",
    about: "Overlapping balls scattered at random: the Boolean model of grains.",
    tiles: true,
    parameters: &[
        real("radius", [1.0, 64.0], [3.0, 6.0], "mean radius of a ball, in voxels"),
        real("spread", [0.0, 0.9], [0.1, 0.4], "deviation of radii from their mean, as a fraction of it"),
        real("density", [0.01, 4.0], [0.25, 0.6], "volume of all balls, as a fraction of the whole"),
    ],
    paint: |mut brush| {
        let [radius, spread, density] = brush.values();
        let balls = scatter(&mut brush, [radius * (1.0 - spread), radius * (1.0 + spread)], density);
        let mut field = Field::constant(brush.shape, 0.12);
        for Ball { centre, radius } in balls {
            stamp(&mut field, centre, radius + 0.6, |distance, voxel| {
                *voxel = voxel.max(0.12 + 0.76 * (1.0 - smoothstep(radius - 0.6, radius + 0.6, distance)));
            });
        }
        field
    },
};

pub(super) static BUBBLES: Family = Family {
    name: "bubbles",
    about: "Bubbles: thin bright shells scattered at random, later ones in front.",
    tiles: true,
    parameters: &[
        real("radius", [2.0, 64.0], [5.0, 9.0], "mean radius of a bubble, in voxels"),
        real("density", [0.01, 4.0], [0.6, 1.4], "volume of all bubbles, as a fraction of the whole"),
        real("shell", [0.3, 8.0], [0.8, 1.3], "half-thickness of a shell, in voxels"),
    ],
    paint: |mut brush| {
        let [radius, density, shell] = brush.values();
        let balls = scatter(&mut brush, [0.5 * radius, 1.5 * radius], density);
        let mut field = Field::constant(brush.shape, 0.3);
        for Ball { centre, radius } in balls {
            stamp(&mut field, centre, radius + shell, |distance, voxel| {
                let wall = 1.0 - smoothstep(0.5 * shell, shell, (distance - radius).abs());
                let inside = if distance < radius { 0.1 } else { *voxel };
                *voxel = inside + wall * (0.92 - inside);
            });
        }
        field
    },
};

pub(super) static FIBRES: Family = Family {
    name: "fibres",
    about: "Fibres: long thin rods scattered at random, more or less aligned.",
    tiles: true,
    parameters: &[
        real("radius", [0.5, 16.0], [1.2, 2.2], "radius of a fibre, in voxels"),
        real("density", [0.01, 2.0], [0.1, 0.25], "volume of all fibres, as a fraction of the whole"),
        real("aligned", [0.0, 1.0], [0.0, 0.9], "0: any direction; 1: all along one"),
    ],
    paint: |mut brush| {
        let [radius, density, aligned] = brush.values();
        let voxels: f32 = brush.shape.iter().map(|&side| side as f32).product();
        let sides = brush.shape.map(|side| side as f32);
        let length = sides.iter().fold(0.0_f32, |longest, &side| longest.max(side));
        let count =
            (density * voxels / (std::f32::consts::PI * radius * radius * length)).clamp(1.0, MAX_BALLS / length);
        let main = brush.random.direction();
        let mut field = Field::constant(brush.shape, 0.15);
        for _ in 0..count as u32 {
            let start = sides.map(|side| brush.random.between32(0.0, side));
            let own = brush.random.direction();
            let towards = [0, 1, 2].map(|i| aligned * main[i] + (1.0 - aligned) * own[i]);
            let norm = towards.iter().map(|v| v * v).sum::<f32>().sqrt().max(1e-3);
            // A rod is a chain of balls half a radius apart.
            let links = (2.0 * length / radius) as u32;
            for link in 0..links {
                let along = 0.5 * radius * link as f32 / norm;
                let centre = [0, 1, 2].map(|i| start[i] + along * towards[i]);
                stamp(&mut field, centre, radius + 0.5, |distance, voxel| {
                    *voxel = voxel.max(0.9 - 0.75 * smoothstep(radius - 0.5, radius + 0.5, distance));
                });
            }
        }
        field
    },
};

pub(super) static RUST: Family = Family {
    name: "rust",
    about: "Rust: dark blotches with ragged rims on a bright, even background.",
    tiles: false,
    parameters: &[
        real("radius", [2.0, 64.0], [5.0, 10.0], "mean radius of a blotch, in voxels"),
        real("density", [0.01, 4.0], [0.15, 0.45], "volume of all blotches, as a fraction of the whole"),
        real("ragged", [0.0, 1.0], [0.35, 0.7], "raggedness of the rims, as a fraction of the radius"),
    ],
    paint: |mut brush| {
        let [radius, density, ragged] = brush.values();
        let balls = scatter(&mut brush, [0.4 * radius, 1.6 * radius], density);
        // The depth within the nearest blotch, in voxels: 0 at the rim, positive inside.
        let mut depth = Field::constant(brush.shape, -radius);
        for Ball { centre, radius } in balls {
            let reach = radius * (1.0 + ragged);
            stamp(&mut depth, centre, reach, |distance, voxel| *voxel = voxel.max(radius - distance));
        }
        let rims = brush.noise(3.0);
        let rims = brush.field(rims, 0.8 * radius);
        let painted = depth.zip(&rims, |depth, rim| {
            let depth = depth + ragged * radius * rim;
            0.8 - 0.5 * smoothstep(-0.7, 0.7, depth) - 0.15 * smoothstep(0.0, 0.5 * radius, depth)
        });
        grained(&mut brush, painted, 0.06)
    },
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stamp_visits_every_voxel_in_reach_once_and_wraps_around() {
        let mut field = Field::constant([6, 7, 8], 0.0);
        stamp(&mut field, [0.0, 0.0, 0.0], 1.0, |_, voxel| *voxel += 1.0);
        let at = |z: usize, y: usize, x: usize| field.values()[(z * 7 + y) * 8 + x];
        assert_eq!((at(0, 0, 0), at(5, 0, 0), at(0, 6, 0), at(0, 0, 7), at(1, 0, 0)), (1.0, 1.0, 1.0, 1.0, 1.0));
        assert_eq!(field.values().iter().sum::<f32>(), 7.0);
        let mut field = Field::constant([3, 3, 3], 0.0);
        stamp(&mut field, [1.0; 3], 50.0, |_, voxel| *voxel += 1.0);
        assert!(field.values().iter().all(|&voxel| voxel == 1.0));
    }
}
