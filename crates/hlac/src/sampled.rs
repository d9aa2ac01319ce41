//! The paper's own method: the sums over windows at random places.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::kernel::windows::{self, Cells, WINDOWS};
use crate::{ExtractError, MaskSpacing, Sums, Voxels};

/// The sums over `windows` random windows, as the paper computes them: drawn independently and uniformly with replacement.
///
/// Use this to reproduce the paper; otherwise [`extract`](crate::extract) is exact and cheap. A random window costs 35
/// times a dense one (85 ns and 2.5 ns on a Zen 4), because its cells lie apart and it shares no product with its
/// neighbours. The exact sums of all windows are cheaper from about 7 000 random windows of a 64^3 volume on, or 500 000 of
/// a 256^3 volume.
///
/// The same volume, number and seed give the same sums on every machine. ChaCha8 seeded with `seed` draws Z, Y and X in
/// this order, each as `(draw * n) >> 64` of a 64-bit draw and the `n` windows along the axis. `windows == 0` gives
/// [`Sums::ZERO`].
///
/// # Errors
/// [`ExtractError::TooManyWindows`] if `windows` exceeds the number of windows of the volume: summing them all is cheaper
/// and exact.
pub fn extract_sampled(volume: Voxels<'_>, windows: u64, seed: u64) -> Result<Sums, ExtractError> {
    let available = MaskSpacing::One.windows(volume.shape());
    if windows > available {
        return Err(ExtractError::TooManyWindows { requested: windows, available });
    }
    let (shape, voxels) = (volume.shape(), volume.as_slice());
    let strides = [shape[1] * shape[2], shape[2], 1];
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sums = Sums { windows, ..Sums::ZERO };
    let mut left = windows;
    while left > 0 {
        // Lanes without a window keep 0 in every cell, which adds nothing to any sum.
        let mut cells: Cells = [[0; WINDOWS]; 27];
        let count = left.min(WINDOWS as u64);
        for window in 0..count as usize {
            let mut start = 0;
            for (side, stride) in shape.iter().zip(strides) {
                let draw = (u128::from(rng.next_u64()) * (side - 2) as u128) >> 64;
                start += draw as usize * stride;
            }
            for (index, cell) in cells.iter_mut().enumerate() {
                cell[window] = voxels[start + index / 9 * strides[0] + index / 3 % 3 * strides[1] + index % 3];
            }
        }
        windows::add(&cells, &mut sums.values);
        left -= count;
    }
    Ok(sums)
}
