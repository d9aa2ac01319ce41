//! The paper's own way: the sums over windows at random places.
//!
//! For fidelity only. A random window costs as much as several dense ones: the exact sums of *all* windows are cheaper
//! than about 30 000 random ones.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::{MASKS, Sums};
use crate::volume::Volume;

/// The sums over `windows` windows drawn independently and uniformly (so some may come twice), by ChaCha8 from `seed`.
///
/// The same volume, number and seed give the same sums on every machine: Z, Y and X are drawn in this order, each as
/// `(draw * n) >> 64` of a 64-bit draw and the `n` windows along the axis. `windows == 0` gives [`Sums::ZERO`].
pub fn extract_sampled(volume: &Volume, windows: u64, seed: u64) -> Sums {
    let grey = volume.luma();
    let (shape, voxels) = (grey.shape(), grey.voxels());
    let strides = [shape[1] * shape[2], shape[2], 1];
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sums = Sums::ZERO;
    for _ in 0..windows {
        let mut start = 0;
        for (side, stride) in shape.iter().zip(strides) {
            let draw = (u128::from(rng.next_u64()) * (side - 2) as u128) >> 64;
            start += draw as usize * stride;
        }
        let mut cells = [0_u64; 27];
        for (index, cell) in cells.iter_mut().enumerate() {
            let at = start + index / 9 * strides[0] + index / 3 % 3 * strides[1] + index % 3;
            *cell = u64::from(voxels[at]);
        }
        sums.windows += 1;
        for (value, mask) in sums.values.iter_mut().zip(&MASKS) {
            *value += mask.cells().iter().map(|&cell| cells[usize::from(cell)]).product::<u64>();
        }
    }
    sums
}
