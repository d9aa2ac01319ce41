//! Organic textures: wood.

use super::family::{Family, real, smoothstep, tilt};
use crate::synth::noise::floor;

pub(super) static WOOD: Family = Family {
    name: "wood",
    about: "Wood: growth rings about an axis, early wood fading into late wood, with fibres along the axis.",
    tiles: false,
    parameters: &[
        real("spacing", [2.0, 256.0], [6.0, 12.0], "width of a growth ring, in voxels"),
        real("wobble", [0.0, 4.0], [0.3, 0.9], "deviation of the rings from circles, in rings"),
        real("fibre", [0.0, 1.0], [0.1, 0.25], "contrast of the fibres"),
        tilt([0.0, 180.0]),
    ],
    paint: |mut brush| {
        let [spacing, wobble, fibre, tilt] = brush.values();
        let (bend, strands) = (brush.noise(2.0), brush.noise(2.0));
        let frame = brush.frame(tilt);
        // The pith is in or near the volume; the frame's own origin would put it far away.
        let pith = [brush.random.between32(-40.0, 40.0), brush.random.between32(-40.0, 40.0)];
        brush.positions(&frame, |p| {
            let [x, y] = [p[0] - frame.origin[0] - pith[0], p[1] - frame.origin[1] - pith[1]];
            let out_of_round = wobble * bend.at([p[0] / 30.0, p[1] / 30.0, p[2] / 90.0]);
            let (_, ring) = floor((x * x + y * y).sqrt() / spacing + out_of_round);
            // Slowly darker through the ring, then a sharp step back to early wood.
            let late = smoothstep(0.2, 0.9, ring) * (1.0 - smoothstep(0.92, 1.0, ring));
            0.8 - 0.55 * late + fibre * strands.at([p[0] / 3.0, p[1] / 3.0, p[2] / 30.0])
        })
    },
};
