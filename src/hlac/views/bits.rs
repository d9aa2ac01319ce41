//! Exact sums of a binary volume: the product of bits is their AND, the sum over windows a count of ones.
//!
//! Octant by octant, so that no window has to be told apart: for each plane and each of the nine places (y, x) that a
//! cell can have in a window, the bits of the octant's windows are packed into words without gaps. A mask's count is
//! then the number of ones in the AND of its cells' packed planes.

use std::ops::Range;

use crate::hlac::{MASK_COUNT, MASKS, OctantSums};
use crate::volume::Shape;

/// The octant sums of the volume that is 255 where `differences` is positive and 0 elsewhere.
pub(super) fn octants(shape: Shape, differences: &[i16]) -> OctantSums {
    let windows = shape.map(|side| side - 2);
    let halves = windows.map(|count| [0..count / 2, count / 2..count]);
    let bits = Bits::of(shape, differences);
    let mut octants = OctantSums::zero();
    for quarter in 0..4 {
        let (y, x) = (&halves[1][quarter / 2], &halves[2][quarter % 2]);
        let packed = Packed::of(&bits, shape[0], y, x);
        for (upper, z) in halves[0].iter().enumerate() {
            let sums = &mut octants.0[4 * upper + quarter];
            sums.windows = (z.len() * y.len() * x.len()) as u64;
            let counts = packed.counts(z.clone());
            for ((value, count), mask) in sums.values.iter_mut().zip(counts).zip(&MASKS) {
                *value = count * 255_u64.pow(mask.order() as u32);
            }
        }
    }
    octants
}

/// One bit a voxel, each row of voxels in words of its own.
struct Bits {
    words: Vec<u64>,
    words_a_row: usize,
    rows_a_plane: usize,
}

impl Bits {
    fn of(shape: Shape, differences: &[i16]) -> Self {
        let words_a_row = shape[2].div_ceil(64);
        let mut words = Vec::with_capacity(shape[0] * shape[1] * words_a_row);
        for row in differences.chunks_exact(shape[2]) {
            words.extend(row.chunks(64).map(|part| {
                // Eight voxels a byte, so that the compiler sees short independent chains.
                let byte =
                    |part: &[i16]| part.iter().enumerate().fold(0, |byte, (at, &d)| byte | u64::from(d > 0) << at);
                part.chunks(8).enumerate().fold(0, |word, (at, part)| word | byte(part) << (8 * at))
            }));
        }
        Self { words, words_a_row, rows_a_plane: shape[1] }
    }

    /// Up to 64 bits of row `y` of plane `z`, the lowest being voxel `x`; what lies beyond the row is 0.
    fn at(&self, z: usize, y: usize, x: usize) -> u64 {
        let start = (z * self.rows_a_plane + y) * self.words_a_row;
        let row = &self.words[start..start + self.words_a_row];
        let word = |at: usize| row.get(at).copied().unwrap_or(0);
        let (at, shift) = (x / 64, x % 64);
        if shift == 0 { word(at) } else { word(at) >> shift | word(at + 1) << (64 - shift) }
    }
}

/// The bits of one quarter's windows, packed: for each plane of voxels, nine runs of words, one for each `3 y + x` of
/// a cell.
struct Packed {
    words: Vec<u64>,
    /// Words in a run; what the last word does not need is 0.
    run: usize,
}

impl Packed {
    fn of(bits: &Bits, planes: usize, y: &Range<usize>, x: &Range<usize>) -> Self {
        let run = (y.len() * x.len()).div_ceil(64);
        let mut words = vec![0; planes * 9 * run];
        if run > 0 {
            for (at, run) in words.chunks_exact_mut(run).enumerate() {
                let (plane, cell) = (at / 9, at % 9);
                let mut end = 0;
                for row in y.clone() {
                    for start in x.clone().step_by(64) {
                        let length = (x.end - start).min(64);
                        let word = bits.at(plane, row + cell / 3, start + cell % 3) & u64::MAX >> (64 - length);
                        append(run, end, word, length);
                        end += length;
                    }
                }
            }
        }
        Self { words, run }
    }

    /// For each mask, in how many of the windows of planes `z` all its cells are one.
    fn counts(&self, z: Range<usize>) -> [u64; MASK_COUNT] {
        let mut counts = [0; MASK_COUNT];
        let mut pair = vec![0; self.run];
        for plane in z {
            let cells = &self.words[plane * 9 * self.run..(plane + 3) * 9 * self.run];
            let cell = |cell: u8| &cells[usize::from(cell) * self.run..][..self.run];
            let mut held = None;
            for (count, mask) in counts.iter_mut().zip(&MASKS) {
                // Masks that share their first two cells follow one another mostly.
                *count += match *mask.cells() {
                    [a] => ones(cell(a)),
                    [a, b] => ones_of_both(cell(a), cell(b)),
                    [a, b, c] => {
                        if held != Some((a, b)) {
                            held = Some((a, b));
                            for ((both, a), b) in pair.iter_mut().zip(cell(a)).zip(cell(b)) {
                                *both = a & b;
                            }
                        }
                        ones_of_both(&pair, cell(c))
                    }
                    _ => 0,
                };
            }
        }
        counts
    }
}

/// Puts the `length` (at most 64) low bits of `word` behind the `end` bits that `run` already holds.
fn append(run: &mut [u64], end: usize, word: u64, length: usize) {
    let (at, shift) = (end / 64, end % 64);
    run[at] |= word << shift;
    if shift + length > 64 {
        run[at + 1] |= word >> (64 - shift);
    }
}

fn ones(words: &[u64]) -> u64 {
    words.iter().map(|word| u64::from(word.count_ones())).sum()
}

fn ones_of_both(a: &[u64], b: &[u64]) -> u64 {
    a.iter().zip(b).map(|(a, b)| u64::from((a & b).count_ones())).sum()
}
