//! The one body of all vector kernels.

use std::ops::Range;

use super::Input;
use super::block::{BLOCK_ROWS, Block, CHUNK, Memory, THIRDS, sum_planes};
use super::lanes::{Lanes, MAX_WORDS};
use super::plan::{ONE, slots};
use super::tiles::Plan;
use crate::OctantSums;

/// What the windows of an input add to the octant sums of its volume.
///
/// # Safety
/// The CPU must have the instructions of `V`, and they must be enabled for the calling function, which this one is inlined
/// into.
#[inline(always)]
pub(super) unsafe fn sums<V: Lanes, P: Plan, const FOLD: bool>(input: &Input<'_>) -> OctantSums {
    let mut octants = OctantSums::zero();
    let mut memory = Memory::new();
    let [planes, rows, columns] = input.grid();
    let halves = |length: usize| [0..length / 2, length / 2..length];
    // Some lanes in front have no window, so that the upper half of X begins with a new group of lanes.
    let skipped = (columns / 2).next_multiple_of(V::GROUP) - columns / 2;
    for lane in (0..columns + skipped).step_by(V::WORDS) {
        for (word, one) in memory.ones.0[..V::WORDS].iter_mut().enumerate() {
            *one = i16::from((skipped..columns + skipped).contains(&(lane + word)));
        }
        let lower = (columns / 2 + skipped).saturating_sub(lane).min(V::WORDS);
        let first = lane as isize - skipped as isize;
        for (half, planes) in halves(planes).into_iter().enumerate() {
            let planes = planes.start.max(input.windows.start)..planes.end.min(input.windows.end);
            for (quarter, rows) in halves(rows).into_iter().enumerate() {
                for chunk in chunks(input, planes.clone(), rows) {
                    // SAFETY: the caller promises that the CPU has the instructions of `V`.
                    unsafe { add_chunk::<V, P, FOLD>(&mut memory, input, &chunk, first) };
                }
                drain::<V, P>(&mut memory, lower, &mut octants, 4 * half + 2 * quarter);
            }
        }
    }
    octants
}

/// Window rows at equal distances: `[z, y]` of the first, and the number of planes and of rows.
struct Chunk {
    first: [usize; 2],
    count: [usize; 2],
}

/// Cuts window planes and rows into chunks. With a spacing, only windows at multiples of it share cells: each such lattice
/// is cut separately.
fn chunks(input: &Input<'_>, planes: Range<usize>, rows: Range<usize>) -> impl Iterator<Item = Chunk> {
    let lattices = |range: Range<usize>, most: usize, multiple: usize| {
        let spacing = input.spacing;
        range.clone().take(spacing).flat_map(move |start| {
            let length = (range.end - start).div_ceil(spacing);
            // Parts of nearly equal length.
            let step = length.div_ceil(length.div_ceil(most)).next_multiple_of(multiple);
            (0..length).step_by(step).map(move |at| (start + spacing * at, step.min(length - at)))
        })
    };
    lattices(planes, CHUNK[0], 1).flat_map(move |(z, planes)| {
        lattices(rows.clone(), CHUNK[1], 2).map(move |(y, rows)| Chunk { first: [z, y], count: [planes, rows] })
    })
}

/// Packs a chunk's voxels and passes over them, block by block.
///
/// # Safety
/// The CPU must have the instructions of `V`.
#[inline(always)]
unsafe fn add_chunk<V: Lanes, P: Plan, const FOLD: bool>(
    memory: &mut Memory,
    input: &Input<'_>,
    chunk: &Chunk,
    first: isize,
) {
    let [planes, rows] = chunk.count;
    let row_pairs = if FOLD { rows / 2 } else { 0 };
    let step = BLOCK_ROWS / rows;
    // SAFETY: the caller promises that the CPU has the instructions of `V`; `pack` writes what the others read.
    unsafe {
        pack::<V>(memory, input, chunk, first);
        sum_planes::<V, FOLD>(memory, planes, rows);
        for at in (0..planes).step_by(step) {
            let mut block = Block::new(memory, at, step.min(planes - at), row_pairs, rows - 2 * row_pairs);
            if FOLD {
                block.prepare();
            }
            P::pass::<V, FOLD>(&mut block);
        }
    }
}

/// Packs the voxels that a chunk's windows touch; the first lane's windows begin at x = `first`.
///
/// # Safety
/// The CPU must have the instructions of `V`.
#[inline(always)]
unsafe fn pack<V: Lanes>(memory: &mut Memory, input: &Input<'_>, chunk: &Chunk, first: isize) {
    let (spacing, [plane_stride, row_stride, _]) = (input.spacing, input.strides());
    let reach = V::WORDS + 2 * spacing;
    // SAFETY: `ones` holds a register; a row's three registers lie inside the packed voxels; and `reach` bytes are
    // readable from `from` on.
    unsafe {
        let valid = V::zero().subtract_words(V::load(memory.ones.0.as_ptr()));
        let mut edge = [0; MAX_WORDS + 8];
        for plane in 0..chunk.count[0] + 2 {
            let z = chunk.first[0] + spacing * plane - input.windows.start;
            for row in 0..chunk.count[1] + 2 {
                let y = chunk.first[1] + spacing * row;
                let start = (z * plane_stride + y * row_stride) as isize + first;
                let inside = usize::try_from(start).ok().and_then(|start| input.voxels.get(start..start + reach));
                let from = inside.unwrap_or_else(|| copy_edge(input.voxels, start, &mut edge)).as_ptr();
                let to = memory.row::<V>(plane, row);
                for x in 0..3 {
                    V::widen(from.add(x * spacing)).and(valid).store(to.add(x * V::WORDS));
                }
            }
        }
    }
}

/// The voxels from `start` on, with 0 for positions outside the slice.
#[cold]
fn copy_edge<'a>(voxels: &[u8], start: isize, edge: &'a mut [u8; MAX_WORDS + 8]) -> &'a [u8] {
    for (offset, voxel) in edge.iter_mut().enumerate() {
        let at = start.checked_add_unsigned(offset).and_then(|at| usize::try_from(at).ok());
        *voxel = at.and_then(|at| voxels.get(at)).copied().unwrap_or(0);
    }
    edge
}

/// Adds the totals of the first `lower` words to octant `octant` and those of the others to `octant + 1`; then sets the
/// totals to 0.
#[inline(always)]
fn drain<V: Lanes, P: Plan>(memory: &mut Memory, lower: usize, octants: &mut OctantSums, octant: usize) {
    let sides = |register: &[i16]| {
        let (lower, upper) = register.split_at(lower);
        [lower, upper].map(|words| {
            // The words of a 64-bit lane in little-endian order, as on every CPU with a vector kernel.
            let lane = |lane: &[i16; 4]| lane.iter().rev().fold(0, |lane, &word| lane << 16 | i64::from(word as u16));
            words.as_chunks().0.iter().map(lane).sum::<i64>()
        })
    };
    let mut thirds = [[0; 2]; THIRDS];
    for (sums, register) in thirds.iter_mut().zip(memory.third_sums.0.chunks_exact(V::WORDS)) {
        *sums = sides(register);
    }
    for (side, sums) in octants.0[octant..octant + 2].iter_mut().enumerate() {
        sums.windows += thirds[ONE][side] as u64;
        sums.values[0] += thirds[0][side] as u64;
    }
    let slots = const { slots(P::TILES) };
    for ((mask, third), register) in slots.into_iter().zip(memory.totals.0.chunks_exact(V::WORDS)) {
        let totals = sides(register);
        for side in 0..2 {
            // Adds back the 32 768 that was subtracted from each product of a pair.
            octants.0[octant + side].values[mask] += (totals[side] + (thirds[third][side] << 15)) as u64;
        }
    }
    memory.third_sums.0.fill(0);
    memory.totals.0.fill(0);
}

#[cfg(test)]
mod tests {
    use super::super::lanes::Portable;
    use super::super::scalar;
    use super::super::tiles::{Narrow, Wide};
    use super::*;

    /// Combinations that no kernel of this CPU may use: products added in Arm's order, and the narrow plan folded.
    #[test]
    fn other_combinations_of_lanes_and_plans_equal_the_reference() {
        for (shape, spacing) in [([7, 9, 21], 1), ([13, 12, 45], 2), ([9, 10, 11], 4)] {
            let voxels: Vec<u8> = (0..shape.iter().product::<usize>()).map(|i| (i * i % 509 / 2) as u8).collect();
            let input = Input::whole(shape, spacing, &voxels);
            let expected = scalar::sums(&input);
            // SAFETY: plain Rust runs on every CPU.
            unsafe {
                assert_eq!(sums::<Portable<8>, Wide, false>(&input), expected, "{shape:?}");
                assert_eq!(sums::<Portable<4>, Narrow, true>(&input), expected, "{shape:?}");
            }
        }
    }
}
