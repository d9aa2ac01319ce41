//! Volumes of two values: the product of a mask's cells is a bitwise *and* of 32 windows at once, and its sum a
//! population count.
//!
//! The body is plain Rust; the compiler makes vectors of it for each set of instructions that it is built for.

use std::ops::Range;

use super::slab::Slab;
use crate::hlac::{MASKS, Mask, OctantSums};

/// Whether every voxel is 0 or 255.
pub(super) fn is_binary(voxels: &[u8]) -> bool {
    // Whole chunks without a branch, so that the compiler makes vectors; ordinary volumes leave at the first.
    voxels.chunks(4096).all(|chunk| chunk.iter().fold(true, |binary, voxel| binary & (voxel.wrapping_add(1) <= 1)))
}

/// What a slab adds to the octant sums of its volume, where every voxel that is not 0 counts as 255.
pub(super) fn sums(slab: &Slab<'_>) -> OctantSums {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vpopcntdq") {
            // SAFETY: the CPU was just found to have the instructions.
            return unsafe { sums_avx512(slab) };
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("popcnt") {
            // SAFETY: as above.
            return unsafe { sums_avx2(slab) };
        }
    }
    count(slab)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vpopcntdq")]
fn sums_avx512(slab: &Slab<'_>) -> OctantSums {
    count(slab)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,popcnt")]
fn sums_avx2(slab: &Slab<'_>) -> OctantSums {
    count(slab)
}

/// The occupied cells of a slab as bits: for each cell of x = 0, 1 and 2 one array over planes, rows and words, where bit `i`
/// of word `j` belongs to window `32 j + i` of the columns.
struct Bits {
    cells: [Vec<u32>; 3],
    rows: usize,
    words: usize,
}

impl Bits {
    #[inline(always)]
    fn new(slab: &Slab<'_>, columns: &Range<usize>) -> Self {
        let [_, rows, row] = slab.shape;
        let words = columns.len().div_ceil(32);
        let mut cells = [const { Vec::new() }; 3];
        let mut occupied = vec![0_u64; row.div_ceil(64) + 1];
        for voxels in slab.voxels.chunks_exact(row) {
            occupy(voxels, &mut occupied);
            for (x, cells) in cells.iter_mut().enumerate() {
                let from = columns.start + slab.spacing * x;
                cells.extend((0..words).map(|word| {
                    let bits = field(&occupied, from + 32 * word);
                    let left = columns.len() - 32 * word;
                    if left < 32 { bits & ((1 << left) - 1) } else { bits }
                }));
            }
        }
        Self { cells, rows, words }
    }

    /// The words of a cell, over the windows of `rows` in the plane `z` of the slab.
    #[inline(always)]
    fn cell(&self, cell: u8, z: usize, rows: &Range<usize>, spacing: usize) -> &[u32] {
        let [dz, dy, dx] = [cell / 9, cell / 3 % 3, cell % 3].map(usize::from);
        let plane = (z + spacing * dz) * self.rows + spacing * dy;
        &self.cells[dx][(plane + rows.start) * self.words..(plane + rows.end) * self.words]
    }
}

/// Sets bit `i` where voxel `i` is not 0.
#[inline(always)]
fn occupy(voxels: &[u8], bits: &mut [u64]) {
    const LOW: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    for (word, voxels) in bits.iter_mut().zip(voxels.chunks(64)) {
        *word = 0;
        for (byte, voxels) in voxels.chunks(8).enumerate() {
            let mut eight = [0; 8];
            eight[..voxels.len()].copy_from_slice(voxels);
            let eight = u64::from_le_bytes(eight);
            let occupied = (((eight & LOW) + LOW) | eight) & !LOW;
            // The eight top bits, gathered into the top byte.
            *word |= ((occupied >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * byte);
        }
    }
}

/// The 32 bits from `at` on.
#[inline(always)]
fn field(bits: &[u64], at: usize) -> u32 {
    let (word, shift) = (at / 64, at % 64);
    let next = bits.get(word + 1).copied().unwrap_or(0);
    ((u128::from(next) << 64 | u128::from(bits[word])) >> shift) as u32
}

#[inline(always)]
fn count(slab: &Slab<'_>) -> OctantSums {
    let mut octants = OctantSums::zero();
    let [planes, rows, columns] = slab.grid();
    let halves = |length: usize| [0..length / 2, length / 2..length];
    for (side, columns) in halves(columns).into_iter().enumerate() {
        let bits = Bits::new(slab, &columns);
        for z in slab.windows.clone() {
            let upper = usize::from(z >= planes / 2);
            for (half, rows) in halves(rows).into_iter().enumerate() {
                let sums = &mut octants.0[4 * upper + 2 * half + side];
                sums.windows += (rows.len() * columns.len()) as u64;
                let cell = |cell: u8| bits.cell(cell, z - slab.windows.start, &rows, slab.spacing);
                for (value, mask) in sums.values.iter_mut().zip(&MASKS) {
                    *value += 255_u64.pow(mask.order() as u32) * hits(mask, cell);
                }
            }
        }
    }
    octants
}

/// In how many windows all of a mask's cells are occupied.
#[inline(always)]
fn hits<'a>(mask: &Mask, cell: impl Fn(u8) -> &'a [u32]) -> u64 {
    let ones = |word: u32| u64::from(word.count_ones());
    match *mask.cells() {
        [a] => cell(a).iter().map(|&a| ones(a)).sum(),
        [a, b] => cell(a).iter().zip(cell(b)).map(|(a, b)| ones(a & b)).sum(),
        [a, b, c] => cell(a).iter().zip(cell(b)).zip(cell(c)).map(|((a, b), c)| ones(a & b & c)).sum(),
        _ => 0,
    }
}
