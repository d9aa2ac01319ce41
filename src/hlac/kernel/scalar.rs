//! The reference: as plain as the definition.

use crate::hlac::{MASKS, OctantSums};
use crate::volume::Shape;

/// The octant sums of a grey volume of `shape` (every side at least 3), window by window.
pub fn octants(shape: Shape, voxels: &[u8]) -> OctantSums {
    let mut octants = OctantSums::zero();
    let windows = shape.map(|side| side - 2);
    let strides = [shape[1] * shape[2], shape[2], 1];
    let reach = MASKS.map(|mask| {
        let mut cells = [usize::MAX; 3];
        for (cell, offset) in cells.iter_mut().zip(mask.offsets()) {
            *cell = offset[0] * strides[0] + offset[1] * strides[1] + offset[2];
        }
        cells
    });
    for z in 0..windows[0] {
        for y in 0..windows[1] {
            for x in 0..windows[2] {
                let sums = octants.of_window_mut(windows, [z, y, x]);
                sums.windows += 1;
                let start = z * strides[0] + y * strides[1] + x;
                for ((value, mask), cells) in sums.values.iter_mut().zip(&MASKS).zip(&reach) {
                    let product = |product: u64, cell: &usize| product * u64::from(voxels[start + cell]);
                    *value += cells[..mask.order()].iter().fold(1, product);
                }
            }
        }
    }
    octants
}
