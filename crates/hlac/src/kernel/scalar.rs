//! The reference: as plain as the definition.

use super::Slab;
use crate::voxels::Shape;
use crate::{MASKS, OctantSums};

/// The octant sums of a grey volume of `shape` (every side at least 3), window by window.
pub fn octants(shape: Shape, voxels: &[u8]) -> OctantSums {
    slab(&Slab::whole(shape, 1, voxels))
}

/// What the windows of a slab add to the octant sums of its volume.
pub(super) fn slab(slab: &Slab<'_>) -> OctantSums {
    let mut octants = OctantSums::zero();
    let windows = slab.grid();
    let strides = slab.strides();
    let reach = MASKS.map(|mask| {
        let mut cells = [usize::MAX; 3];
        for (cell, offset) in cells.iter_mut().zip(mask.offsets()) {
            *cell = slab.spacing * (offset[0] * strides[0] + offset[1] * strides[1] + offset[2]);
        }
        cells
    });
    for z in slab.windows.clone() {
        for y in 0..windows[1] {
            for x in 0..windows[2] {
                let sums = octants.of_window_mut(windows, [z, y, x]);
                sums.windows += 1;
                let start = (z - slab.windows.start) * strides[0] + y * strides[1] + x;
                for ((value, mask), cells) in sums.values.iter_mut().zip(&MASKS).zip(&reach) {
                    let product = |product: u64, cell: &usize| product * u64::from(slab.voxels[start + cell]);
                    *value += cells[..mask.order()].iter().fold(1, product);
                }
            }
        }
    }
    octants
}
