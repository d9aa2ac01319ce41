//! Windows at arbitrary positions, gathered side by side.

use crate::MASKS;
use crate::masks::MASK_COUNT;

/// The number of windows taken at once: the sum of 64 products of 24 bits fits 32 bits.
pub(crate) const WINDOWS: usize = 64;

/// The intensities at the 27 cells of some windows.
pub(crate) type Cells = [[u8; WINDOWS]; 27];

/// Adds the products of every mask over all windows to `values`.
pub(crate) fn add(cells: &Cells, values: &mut [u64; MASK_COUNT]) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the CPU was just found to have AVX2.
        return unsafe { add_avx2(cells, values) };
    }
    add_all(cells, values);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn add_avx2(cells: &Cells, values: &mut [u64; MASK_COUNT]) {
    add_all(cells, values);
}

/// Plain loops of fixed length, which the compiler vectorises.
#[inline(always)]
fn add_all(cells: &Cells, values: &mut [u64; MASK_COUNT]) {
    let cells = cells.map(|windows| windows.map(u32::from));
    for (value, mask) in values.iter_mut().zip(&MASKS) {
        let mut products = [1; WINDOWS];
        for &cell in mask.cells() {
            for (product, voxel) in products.iter_mut().zip(&cells[usize::from(cell)]) {
                *product *= voxel;
            }
        }
        *value += u64::from(products.iter().sum::<u32>());
    }
}
