//! The one body of all vector kernels.

use std::ops::Range;

use super::block::{BLOCK_ROWS, Block, CHUNK, Memory, THIRDS, sum_planes};
use super::lanes::{Lanes, MAX_WORDS};
use super::plan::{ONE, slots};
use super::slab::Slab;
use super::tiles::Plan;
use crate::OctantSums;

/// What the windows of a slab add to the octant sums of its volume.
///
/// # Safety
/// The CPU must have the instructions of `V`, and they must be enabled where this becomes part of.
#[inline(always)]
pub(super) unsafe fn sums<V: Lanes, P: Plan, const FOLD: bool>(slab: &Slab<'_>) -> OctantSums {
    let mut octants = OctantSums::zero();
    let mut memory = Memory::new();
    let [planes, rows, columns] = slab.grid();
    let halves = |length: usize| [0..length / 2, length / 2..length];
    // Lanes in front without a window let the upper half of X begin with a group of lanes.
    let skipped = (columns / 2).next_multiple_of(V::GROUP) - columns / 2;
    for lane in (0..columns + skipped).step_by(V::WORDS) {
        for (word, one) in memory.ones.0[..V::WORDS].iter_mut().enumerate() {
            *one = i16::from((skipped..columns + skipped).contains(&(lane + word)));
        }
        let lower = (columns / 2 + skipped).saturating_sub(lane).min(V::WORDS);
        let first = lane as isize - skipped as isize;
        for (half, planes) in halves(planes).into_iter().enumerate() {
            let planes = planes.start.max(slab.windows.start)..planes.end.min(slab.windows.end);
            for (quarter, rows) in halves(rows).into_iter().enumerate() {
                for chunk in chunks(slab, planes.clone(), rows) {
                    // SAFETY: the caller promises the instructions.
                    unsafe { add_chunk::<V, P, FOLD>(&mut memory, slab, &chunk, first) };
                }
                drain::<V, P>(&mut memory, lower, &mut octants, 4 * half + 2 * quarter);
            }
        }
    }
    octants
}

/// Some windows of equal spacing: `[z, y]` of the first, and how many there are each way.
struct Chunk {
    first: [usize; 2],
    count: [usize; 2],
}

/// Cuts window planes and rows into chunks. With a spacing, windows that are not that far apart share no cells: each of
/// their lattices is cut by itself.
fn chunks(slab: &Slab<'_>, planes: Range<usize>, rows: Range<usize>) -> impl Iterator<Item = Chunk> {
    let lattices = |range: Range<usize>, most: usize, multiple: usize| {
        let spacing = slab.spacing;
        range.clone().take(spacing).flat_map(move |start| {
            let length = (range.end - start).div_ceil(spacing);
            // Parts of nearly the same length.
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
    slab: &Slab<'_>,
    chunk: &Chunk,
    first: isize,
) {
    let [planes, rows] = chunk.count;
    let row_pairs = if FOLD { rows / 2 } else { 0 };
    let step = BLOCK_ROWS / rows;
    // SAFETY: the caller promises the instructions; `pack` writes what the others read.
    unsafe {
        pack::<V>(memory, slab, chunk, first);
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
unsafe fn pack<V: Lanes>(memory: &mut Memory, slab: &Slab<'_>, chunk: &Chunk, first: isize) {
    let (spacing, [plane_stride, row_stride, _]) = (slab.spacing, slab.strides());
    let reach = V::WORDS + 2 * spacing;
    // SAFETY: `ones` holds a register; a row's three registers lie inside the packed voxels; and `reach` bytes are
    // readable from `from` on.
    unsafe {
        let valid = V::zero().subtract_words(V::load(memory.ones.0.as_ptr()));
        let mut edge = [0; MAX_WORDS + 8];
        for plane in 0..chunk.count[0] + 2 {
            let z = chunk.first[0] + spacing * plane - slab.windows.start;
            for row in 0..chunk.count[1] + 2 {
                let y = chunk.first[1] + spacing * row;
                let start = (z * plane_stride + y * row_stride) as isize + first;
                let inside = usize::try_from(start).ok().and_then(|start| slab.voxels.get(start..start + reach));
                let from = inside.unwrap_or_else(|| copy_edge(slab.voxels, start, &mut edge)).as_ptr();
                let to = memory.row::<V>(plane, row);
                for x in 0..3 {
                    V::widen(from.add(x * spacing)).and(valid).store(to.add(x * V::WORDS));
                }
            }
        }
    }
}

/// What lies from `start` on, with 0 for what lies outside.
#[cold]
fn copy_edge<'a>(voxels: &[u8], start: isize, edge: &'a mut [u8; MAX_WORDS + 8]) -> &'a [u8] {
    for (offset, voxel) in edge.iter_mut().enumerate() {
        let at = start.checked_add_unsigned(offset).and_then(|at| usize::try_from(at).ok());
        *voxel = at.and_then(|at| voxels.get(at)).copied().unwrap_or(0);
    }
    edge
}

/// Adds the totals to octants `octant` and, beyond the first `lower` words, `octant + 1`; and sets them to 0.
#[inline(always)]
fn drain<V: Lanes, P: Plan>(memory: &mut Memory, lower: usize, octants: &mut OctantSums, octant: usize) {
    let sides = |register: &[i16]| {
        let (lower, upper) = register.split_at(lower);
        [lower, upper].map(|words| {
            // Little end first, as on every CPU that has a kernel.
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
            // The products of pairs were less by 32 768 each.
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

    /// What no kernel of this machine may run: products added as Arm adds them, and the narrow plan folded.
    #[test]
    fn other_ways_through_the_body_equal_the_reference() {
        for (shape, spacing) in [([7, 9, 21], 1), ([13, 12, 45], 2), ([9, 10, 11], 4)] {
            let voxels: Vec<u8> = (0..shape.iter().product::<usize>()).map(|i| (i * i % 509 / 2) as u8).collect();
            let slab = Slab::whole(shape, spacing, &voxels);
            let expected = scalar::slab(&slab);
            // SAFETY: plain Rust runs everywhere.
            unsafe {
                assert_eq!(sums::<Portable<8>, Wide, false>(&slab), expected, "{shape:?}");
                assert_eq!(sums::<Portable<4>, Narrow, true>(&slab), expected, "{shape:?}");
            }
        }
    }
}
