//! The reference: as plain as the definition.

use super::Input;
use crate::{MASKS, OctantSums};

/// What the windows of an input add to the octant sums of its volume, window by window.
pub(super) fn sums(input: &Input<'_>) -> OctantSums {
    let mut octants = OctantSums::zero();
    let windows = input.grid();
    let strides = input.strides();
    // For each mask, how far its cells lie from the window's first cell.
    let cells = MASKS.map(|mask| {
        let mut cells = [usize::MAX; 3];
        for (cell, offset) in cells.iter_mut().zip(mask.offsets()) {
            *cell = input.spacing * (offset[0] * strides[0] + offset[1] * strides[1] + offset[2]);
        }
        cells
    });
    for z in input.windows.clone() {
        for y in 0..windows[1] {
            for x in 0..windows[2] {
                let sums = octants.of_window_mut(windows, [z, y, x]);
                sums.windows += 1;
                let start = (z - input.windows.start) * strides[0] + y * strides[1] + x;
                for ((value, mask), cells) in sums.values.iter_mut().zip(&MASKS).zip(&cells) {
                    let product = |product: u64, cell: &usize| product * u64::from(input.voxels[start + cell]);
                    *value += cells[..mask.order()].iter().fold(1, product);
                }
            }
        }
    }
    octants
}
