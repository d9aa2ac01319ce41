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

/// The occupied cells of the windows of one quarter (of rows and columns) of a slab, as bits.
///
/// For each place (y, x) that a cell has in a window there is one run of words, plane after plane and row after row,
/// without a gap: bit `i` of word `j` of a row belongs to window `32 j + i` of the columns. So the windows of several
/// planes are one stretch of words for each of a window's 27 cells.
struct Quarter {
    runs: [Vec<u32>; 9],
    words_a_plane: usize,
}

impl Quarter {
    #[inline(always)]
    fn new(columns: &[Vec<u32>; 3], slab: &Slab<'_>, words: usize, rows: &Range<usize>) -> Self {
        let words_a_plane = rows.len() * words;
        let runs = std::array::from_fn(|cell| {
            let start = (rows.start + slab.spacing * (cell / 3)) * words;
            let planes = columns[cell % 3].chunks_exact((slab.shape[1] * words).max(1));
            let mut run = Vec::with_capacity(planes.len() * words_a_plane);
            planes.for_each(|plane| run.extend_from_slice(&plane[start..start + words_a_plane]));
            run
        });
        Self { runs, words_a_plane }
    }

    /// The words of a window's cells, over the windows of `planes` of the slab.
    #[inline(always)]
    fn cells(&self, planes: &Range<usize>, spacing: usize) -> [&[u32]; 27] {
        std::array::from_fn(|cell| {
            let start = (planes.start + spacing * (cell / 9)) * self.words_a_plane;
            &self.runs[cell % 9][start..start + planes.len() * self.words_a_plane]
        })
    }
}

/// The occupied voxels of a slab, as bits: each row in words of its own, and one word more.
#[inline(always)]
fn occupied(slab: &Slab<'_>) -> Vec<u64> {
    let words = words_a_row(slab);
    let mut bits = vec![0; slab.voxels.len() / slab.shape[2] * words];
    for (voxels, bits) in slab.voxels.chunks_exact(slab.shape[2]).zip(bits.chunks_exact_mut(words)) {
        occupy(voxels, bits);
    }
    bits
}

fn words_a_row(slab: &Slab<'_>) -> usize {
    slab.shape[2].div_ceil(64) + 1
}

/// The occupied cells of all rows of a slab, for the windows of `columns`: one array for each of a cell's places in X.
#[inline(always)]
fn columns_of(slab: &Slab<'_>, occupied: &[u64], columns: &Range<usize>) -> [Vec<u32>; 3] {
    let words = columns.len().div_ceil(32);
    let rows = occupied.chunks_exact(words_a_row(slab));
    // What the last word of a row does not need.
    let last = u32::MAX >> (32 * words - columns.len());
    std::array::from_fn(|x| {
        let from = columns.start + slab.spacing * x;
        let mut cells = vec![0; rows.len() * words];
        for (row, cells) in rows.clone().zip(cells.chunks_exact_mut(words.max(1))) {
            cells.iter_mut().enumerate().for_each(|(word, cell)| *cell = field(row, from + 32 * word));
            cells.iter_mut().last().into_iter().for_each(|cell| *cell &= last);
        }
        cells
    })
}

/// Sets bit `i` where voxel `i` is not 0.
#[inline(always)]
fn occupy(voxels: &[u8], bits: &mut [u64]) {
    let (eights, rest) = voxels.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    for (at, &eight) in eights.iter().chain([&last]).enumerate() {
        bits[at / 8] |= occupied_of(eight) << (8 * (at % 8));
    }
}

/// One bit for each of eight voxels that is not 0.
#[inline(always)]
fn occupied_of(voxels: [u8; 8]) -> u64 {
    const LOW: u64 = 0x7f7f_7f7f_7f7f_7f7f;
    let voxels = u64::from_le_bytes(voxels);
    let occupied = (((voxels & LOW) + LOW) | voxels) & !LOW;
    // The eight top bits, gathered into the top byte.
    (occupied >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

/// The 32 bits from `at` on.
#[inline(always)]
fn field(bits: &[u64], at: usize) -> u32 {
    let (word, shift) = (at / 64, at % 64);
    let next = bits.get(word + 1).copied().unwrap_or(0);
    // In two steps, since a shift by 64 is none.
    (bits[word] >> shift | next << 1 << (63 - shift)) as u32
}

#[inline(always)]
fn count(slab: &Slab<'_>) -> OctantSums {
    /// Words in a stretch: enough that starting on a mask costs little, few enough that the cells stay in the cache.
    const STRETCH: usize = 512;
    let mut octants = OctantSums::zero();
    let [depth, rows, columns] = slab.grid();
    let halves = |length: usize| [0..length / 2, length / 2..length];
    // The slab's own planes that lie in the lower and in the upper half of the volume.
    let middle = (depth / 2).clamp(slab.windows.start, slab.windows.end) - slab.windows.start;
    let planes = [0..middle, middle..slab.windows.len()];
    let occupied = occupied(slab);
    for (side, columns) in halves(columns).into_iter().enumerate() {
        let words = columns.len().div_ceil(32);
        let bits = columns_of(slab, &occupied, &columns);
        for (half, rows) in halves(rows).into_iter().enumerate() {
            let quarter = Quarter::new(&bits, slab, words, &rows);
            let together = (STRETCH / quarter.words_a_plane.max(1)).max(1);
            for (upper, planes) in planes.iter().enumerate() {
                let sums = &mut octants.0[4 * upper + 2 * half + side];
                sums.windows += (planes.len() * rows.len() * columns.len()) as u64;
                for start in planes.clone().step_by(together) {
                    let cells = quarter.cells(&(start..planes.end.min(start + together)), slab.spacing);
                    for (value, mask) in sums.values.iter_mut().zip(&MASKS) {
                        *value += 255_u64.pow(mask.order() as u32) * hits(mask, &cells);
                    }
                }
            }
        }
    }
    octants
}

/// In how many windows all of a mask's cells are occupied.
#[inline(always)]
fn hits(mask: &Mask, cells: &[&[u32]; 27]) -> u64 {
    // A stretch is at most a plane of 2^31 voxels long, so that its ones fit an u32, in twice as many lanes as a u64.
    let cell = |cell: u8| cells[usize::from(cell)];
    u64::from(match *mask.cells() {
        [a] => cell(a).iter().map(|a| a.count_ones()).sum::<u32>(),
        [a, b] => cell(a).iter().zip(cell(b)).map(|(a, b)| (a & b).count_ones()).sum(),
        [a, b, c] => cell(a).iter().zip(cell(b)).zip(cell(c)).map(|((a, b), c)| (a & b & c).count_ones()).sum(),
        _ => 0,
    })
}
