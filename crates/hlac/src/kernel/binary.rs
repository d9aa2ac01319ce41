//! Volumes of two values: the product of a mask's cells is a bitwise *and* of 32 windows at once, and the sum of products
//! a population count.
//!
//! [`count`] is plain Rust, which the compiler vectorises for each instruction set that it is compiled for.

use std::ops::Range;

use super::Input;
use crate::{MASKS, Mask, OctantSums};

/// Whether every voxel is 0 or 255.
pub(super) fn is_binary(voxels: &[u8]) -> bool {
    // No branch within a chunk, so that the compiler vectorises it; most volumes of other values end at the first chunk.
    voxels.chunks(4096).all(|chunk| chunk.iter().fold(true, |binary, voxel| binary & (voxel.wrapping_add(1) <= 1)))
}

/// What an input adds to the octant sums of its volume, where every voxel that is not 0 counts as 255.
pub(crate) fn sums(input: &Input<'_>) -> OctantSums {
    #[cfg(target_arch = "x86_64")]
    {
        let has_avx512 = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl");
        if has_avx512 && is_x86_feature_detected!("avx512vpopcntdq") {
            // SAFETY: the CPU was just found to have AVX-512 F, VL and VPOPCNTDQ.
            return unsafe { sums_avx512(input) };
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("popcnt") {
            // SAFETY: the CPU was just found to have AVX2 and POPCNT.
            return unsafe { sums_avx2(input) };
        }
    }
    count(input)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512vpopcntdq")]
fn sums_avx512(input: &Input<'_>) -> OctantSums {
    count(input)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,popcnt")]
fn sums_avx2(input: &Input<'_>) -> OctantSums {
    count(input)
}

/// The occupied cells of some rows and columns of windows, as bits: for each (y, x) of a cell, one array over the planes of
/// the input, the rows, and words of 32 columns. Successive planes are contiguous, so that loops are long.
struct Bits {
    cells: [Vec<u32>; 9],
    /// The number of words of a plane.
    plane: usize,
}

impl Bits {
    /// `columns` holds, for each x of a cell, the words of every row of the input; `rows` are the window rows.
    #[inline(always)]
    fn new(columns: &[Vec<u32>; 3], input: &Input<'_>, rows: &Range<usize>) -> Self {
        let lines = input.voxels.len() / input.shape[2];
        let words = columns[0].len() / lines;
        let mut cells = [const { Vec::new() }; 9];
        for (cell, bits) in cells.iter_mut().enumerate() {
            let y = input.spacing * (cell / 3);
            for plane in columns[cell % 3].chunks_exact(input.shape[1] * words) {
                bits.extend_from_slice(&plane[(rows.start + y) * words..(rows.end + y) * words]);
            }
        }
        Self { cells, plane: rows.len() * words }
    }

    /// The words of a cell over the windows of `planes`, counted from the input's first window plane.
    #[inline(always)]
    fn cell(&self, cell: u8, planes: &Range<usize>, spacing: usize) -> &[u32] {
        let (z, cell) = (spacing * usize::from(cell / 9), usize::from(cell % 9));
        &self.cells[cell][(planes.start + z) * self.plane..(planes.end + z) * self.plane]
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
            // Gathers the eight top bits into the top byte.
            *word |= ((occupied >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56) << (8 * byte);
        }
    }
}

/// The bits `from .. from + length` of each row, as words of 32 bits.
#[inline(always)]
fn shifted(occupied: &[u64], stride: usize, from: usize, length: usize) -> Vec<u32> {
    let words = length.div_ceil(32);
    let last = if length.is_multiple_of(32) { u32::MAX } else { (1 << (length % 32)) - 1 };
    let mut shifted = Vec::with_capacity(occupied.len() / stride * words);
    for row in occupied.chunks_exact(stride) {
        for word in 0..words {
            let valid = if word + 1 == words { last } else { u32::MAX };
            shifted.push(field(row, from + 32 * word) & valid);
        }
    }
    shifted
}

/// The 32 bits from `at` on.
#[inline(always)]
fn field(bits: &[u64], at: usize) -> u32 {
    let (word, shift) = (at / 64, at % 64);
    let next = bits.get(word + 1).copied().unwrap_or(0);
    ((u128::from(next) << 64 | u128::from(bits[word])) >> shift) as u32
}

#[inline(always)]
fn count(input: &Input<'_>) -> OctantSums {
    let mut octants = OctantSums::zero();
    let grid = input.grid();
    let halves = |length: usize| [0..length / 2, length / 2..length];
    let row = input.shape[2];
    let stride = row.div_ceil(64);
    let mut occupied = vec![0; input.voxels.len() / row * stride];
    for (bits, voxels) in occupied.chunks_exact_mut(stride).zip(input.voxels.chunks_exact(row)) {
        occupy(voxels, bits);
    }
    for octant in 0..4 {
        let (rows, columns) = (&halves(grid[1])[octant / 2], &halves(grid[2])[octant % 2]);
        if rows.is_empty() || columns.is_empty() {
            continue;
        }
        let cells = [0, 1, 2].map(|x| shifted(&occupied, stride, columns.start + input.spacing * x, columns.len()));
        let bits = Bits::new(&cells, input, rows);
        for (upper, planes) in halves(grid[0]).into_iter().enumerate() {
            let planes = planes.start.max(input.windows.start)..planes.end.min(input.windows.end);
            if planes.is_empty() {
                continue;
            }
            let planes = planes.start - input.windows.start..planes.end - input.windows.start;
            let sums = &mut octants.0[4 * upper + octant];
            sums.windows += (planes.len() * rows.len() * columns.len()) as u64;
            for (value, mask) in sums.values.iter_mut().zip(&MASKS) {
                *value += 255_u64.pow(mask.order() as u32) * hits(mask, |cell| bits.cell(cell, &planes, input.spacing));
            }
        }
    }
    octants
}

/// The number of windows in which all of a mask's cells are occupied.
#[inline(always)]
fn hits<'a>(mask: &Mask, cell: impl Fn(u8) -> &'a [u32]) -> u64 {
    match *mask.cells() {
        [a] => ones(cell(a), cell(a), cell(a)),
        [a, b] => ones(cell(a), cell(b), cell(b)),
        [a, b, c] => ones(cell(a), cell(b), cell(c)),
        _ => 0,
    }
}

/// The number of bits set in all three. Counts stay in 32 bits as long as they fit, which makes the vectors wide.
#[inline(always)]
fn ones(a: &[u32], b: &[u32], c: &[u32]) -> u64 {
    const LONG: usize = 1 << 20;
    let parts = a.chunks(LONG).zip(b.chunks(LONG)).zip(c.chunks(LONG));
    parts
        .map(|((a, b), c)| {
            let words = a.iter().zip(b).zip(c);
            u64::from(words.map(|((a, b), c)| (a & b & c).count_ones()).sum::<u32>())
        })
        .sum()
}
