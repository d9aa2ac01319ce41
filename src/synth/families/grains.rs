//! Things strewn at random: balls, bubbles, fibres, rust spots.

use super::{Brush, Family, real, smoothstep};
use crate::synth::{Field, Fractal};

/// Something strewn: its middle in voxels (z, y, x), and its radius.
struct Ball {
    middle: [f32; 3],
    radius: f32,
}

/// The most balls that are strewn in one texture: dense enough for any look, and a bound on time.
const MOST_BALLS: f32 = 200_000.0;

/// Balls with radii between `radius[0]` and `radius[1]`, strewn until their volumes add up to `share` of the whole.
fn strew(brush: &mut Brush, radius: [f32; 2], share: f32) -> Vec<Ball> {
    let voxels: f32 = brush.shape.iter().map(|&side| side as f32).product();
    let mean = 0.5 * (radius[0] + radius[1]);
    let count = (share * voxels / (4.19 * mean * mean * mean)).clamp(1.0, MOST_BALLS);
    let sides = brush.shape.map(|side| side as f32);
    let mut ball = |_| Ball {
        middle: sides.map(|side| brush.random.between32(0.0, side)),
        radius: brush.random.between32(radius[0], radius[1]),
    };
    (0..count as u32).map(&mut ball).collect()
}

/// `paint(distance from the middle, voxel)` for every voxel within `reach` of the middle; the volume is one period of a
/// tiling, so that balls at a border go on at the opposite one.
fn stamp(field: &mut Field, middle: [f32; 3], reach: f32, mut paint: impl FnMut(f32, &mut f32)) {
    let shape = field.shape();
    // At most half a turn to either side: no voxel is met twice, and each is met where it is nearest.
    let span = |axis: usize| {
        let side = shape[axis] as f32;
        let low = (middle[axis] - reach.min(0.5 * side)).ceil() as i64;
        let high = (middle[axis] + reach).floor() as i64;
        low..=high.min(low + shape[axis] as i64 - 1)
    };
    let wrapped = |axis: usize, at: i64| at.rem_euclid(shape[axis] as i64) as usize;
    for z in span(0) {
        for y in span(1) {
            let (dz, dy) = (z as f32 - middle[0], y as f32 - middle[1]);
            let row = (wrapped(0, z) * shape[1] + wrapped(1, y)) * shape[2];
            for x in span(2) {
                let dx = x as f32 - middle[2];
                let squared = dz * dz + dy * dy + dx * dx;
                if squared <= reach * reach {
                    paint(squared.sqrt(), &mut field.values_mut()[row + wrapped(2, x)]);
                }
            }
        }
    }
}

/// Fine noise over a painted field.
fn grained(brush: &mut Brush, field: Field, strength: f32) -> Field {
    let grain = Fractal::paper(brush.random.seed(), 2).field(brush.shape, [3.0; 3], false);
    field.zip(&grain, |value, grain| value + strength * grain)
}

pub(super) static SPHERES: Family = Family {
    name: "spheres",
    about: "Balls strewn at random, overlapping: the boolean model of grains.",
    tiles: true,
    parameters: &[
        real("radius", [1.0, 64.0], [3.0, 6.0], "mean radius of a ball, in voxels"),
        real("spread", [0.0, 0.9], [0.1, 0.4], "how far radii differ from their mean, as a share of it"),
        real("density", [0.01, 4.0], [0.25, 0.6], "volume of all balls as a share of the whole"),
    ],
    paint: |mut brush| {
        let [radius, spread, density] = brush.values();
        let balls = strew(&mut brush, [radius * (1.0 - spread), radius * (1.0 + spread)], density);
        let mut field = Field::constant(brush.shape, 0.12);
        for Ball { middle, radius } in balls {
            stamp(&mut field, middle, radius + 0.6, |distance, voxel| {
                *voxel = voxel.max(0.12 + 0.76 * (1.0 - smoothstep(radius - 0.6, radius + 0.6, distance)));
            });
        }
        field
    },
};

pub(super) static BUBBLES: Family = Family {
    name: "bubbles",
    about: "Bubbles: thin bright shells strewn at random, the later ones in front.",
    tiles: true,
    parameters: &[
        real("radius", [2.0, 64.0], [5.0, 9.0], "mean radius of a bubble, in voxels"),
        real("density", [0.01, 4.0], [0.6, 1.4], "volume of all bubbles as a share of the whole"),
        real("shell", [0.3, 8.0], [0.8, 1.3], "half-thickness of a shell, in voxels"),
    ],
    paint: |mut brush| {
        let [radius, density, shell] = brush.values();
        let balls = strew(&mut brush, [0.5 * radius, 1.5 * radius], density);
        let mut field = Field::constant(brush.shape, 0.3);
        for Ball { middle, radius } in balls {
            stamp(&mut field, middle, radius + shell, |distance, voxel| {
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
    about: "Fibres: long thin rods strewn at random, more or less along one direction.",
    tiles: true,
    parameters: &[
        real("radius", [0.5, 16.0], [1.2, 2.2], "radius of a fibre, in voxels"),
        real("density", [0.01, 2.0], [0.1, 0.25], "volume of all fibres as a share of the whole"),
        real("aligned", [0.0, 1.0], [0.0, 0.9], "0: any direction; 1: all along one"),
    ],
    paint: |mut brush| {
        let [radius, density, aligned] = brush.values();
        let voxels: f32 = brush.shape.iter().map(|&side| side as f32).product();
        let sides = brush.shape.map(|side| side as f32);
        let length = sides.iter().fold(0.0_f32, |longest, &side| longest.max(side));
        let count =
            (density * voxels / (std::f32::consts::PI * radius * radius * length)).clamp(1.0, MOST_BALLS / length);
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
                let middle = [0, 1, 2].map(|i| start[i] + along * towards[i]);
                stamp(&mut field, middle, radius + 0.5, |distance, voxel| {
                    *voxel = voxel.max(0.9 - 0.75 * smoothstep(radius - 0.5, radius + 0.5, distance));
                });
            }
        }
        field
    },
};

pub(super) static RUST: Family = Family {
    name: "rust",
    about: "Rust: dark blotches with ragged rims eating into a bright, even ground.",
    tiles: false,
    parameters: &[
        real("radius", [2.0, 64.0], [5.0, 10.0], "mean radius of a blotch, in voxels"),
        real("density", [0.01, 4.0], [0.15, 0.45], "volume of all blotches as a share of the whole"),
        real("ragged", [0.0, 1.0], [0.35, 0.7], "how ragged the rims are, as a share of the radius"),
    ],
    paint: |mut brush| {
        let [radius, density, ragged] = brush.values();
        let balls = strew(&mut brush, [0.4 * radius, 1.6 * radius], density);
        // Depth within the nearest blotch, in voxels: 0 at the rim, positive inside.
        let mut depth = Field::constant(brush.shape, -radius);
        for Ball { middle, radius } in balls {
            let reach = radius * (1.0 + ragged);
            stamp(&mut depth, middle, reach, |distance, voxel| *voxel = voxel.max(radius - distance));
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
    fn a_stamp_meets_every_voxel_in_reach_once_and_goes_around() {
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
