//! Rows in the order of a tree's leaves, packed for vectors: what lies within a limit is found without a descent.
//!
//! Neighbours in the tree's order are near one another, so 16 of them (a *block*) have a small bounding box, and so have
//! 16 blocks (a *group*). Boxes stand interleaved like keys (see `bound.rs`): one pass bounds 16 groups, another the 16
//! blocks of a group, another the 16 rows of a block. A box's bound is never above that of a row in it, to the last bit:
//! its differences are smaller and the same operations in the same order round monotonically. So no margin is needed
//! beyond that of the rows.

use super::Points;
use super::bound::{FINE, LANES, Probe};

/// Stands where a block has no row.
const NO_ROW: u32 = u32::MAX;

/// Keys of rows, and the boxes around them.
pub(super) struct Packed {
    width: usize,
    rows: Vec<[u32; LANES]>,
    /// `width` arrays for every block.
    keys: Vec<[f32; LANES]>,
    /// [`FINE`] arrays for every block: fine keys; empty where points have none.
    fine: Vec<[f32; LANES]>,
    /// `2 width` arrays for every 16 blocks: least and greatest of each number of their keys in turn.
    blocks: Vec<[f32; LANES]>,
    /// The same for every 16 groups.
    groups: Vec<[f32; LANES]>,
}

impl Packed {
    /// Packs rows of `points` and their keys in the order given.
    pub(super) fn new<const K: usize>(points: &Points, entries: impl Iterator<Item = (u32, [f32; K])>) -> Self {
        let (mut rows, mut keys, mut fine) = (vec![], vec![], vec![]);
        for (at, (row, key)) in entries.enumerate() {
            let lane = at % LANES;
            if lane == 0 {
                rows.push([NO_ROW; LANES]);
                keys.resize(keys.len() + K, [0.0; LANES]);
                fine.resize(fine.len() + if points.has_fine() { FINE } else { 0 }, [0.0; LANES]);
            }
            let block = rows.len() - 1;
            rows[block][lane] = row;
            for (values, value) in keys[block * K..].iter_mut().zip(key) {
                values[lane] = value;
            }
            if points.has_fine() {
                let numbers = fine[block * FINE..].iter_mut().zip(points.fine_key(row as usize));
                numbers.for_each(|(values, value): (&mut [f32; LANES], f32)| values[lane] = value);
            }
        }
        let extent = |values: &[f32; LANES], block: usize| {
            let there = values.iter().zip(&rows[block]).filter(|&(_, &row)| row != NO_ROW);
            there.fold([f32::INFINITY, f32::NEG_INFINITY], |[least, most], (&v, _)| [least.min(v), most.max(v)])
        };
        let blocks = boxes(K, rows.len(), |block, number| extent(&keys[block * K + number], block));
        let groups = boxes(K, rows.len().div_ceil(LANES), |group, number| {
            let [least, most] = [&blocks[(group * K + number) * 2], &blocks[(group * K + number) * 2 + 1]];
            [
                least.iter().copied().fold(f32::INFINITY, f32::min),
                most.iter().copied().fold(f32::NEG_INFINITY, f32::max),
            ]
        });
        Self { width: K, rows, keys, fine, blocks, groups }
    }

    /// Visits every row whose key is at most `threshold` away, the nearest groups first. `visit` returns the threshold
    /// from then on, which must not grow.
    pub(super) fn sweep(&self, probe: &Probe, mut threshold: f32, mut visit: impl FnMut(u32) -> f32) {
        let mut groups: Vec<(f32, usize)> = vec![];
        for (sixteen, boxes) in self.groups.chunks_exact(self.width * 2).enumerate() {
            let bounds = probe.box_distances(boxes);
            groups
                .extend((sixteen * LANES..).zip(bounds).filter(|&(_, bound)| bound <= threshold).map(|(g, b)| (b, g)));
        }
        groups.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        for (bound, group) in groups {
            if bound > threshold {
                return;
            }
            let Some(boxes) = self.blocks.get(group * self.width * 2..(group + 1) * self.width * 2) else { continue };
            for (block, bound) in (group * LANES..).zip(probe.box_distances(boxes)) {
                if bound <= threshold
                    && let Some(rows) = self.rows.get(block)
                {
                    for (&row, bound) in rows.iter().zip(self.bounds(block, probe, threshold)) {
                        if bound <= threshold && row != NO_ROW {
                            threshold = visit(row);
                        }
                    }
                }
            }
        }
    }
}

impl Packed {
    /// The bounds of the rows of a block: of fine keys where any coarse one is within the threshold.
    #[inline]
    fn bounds(&self, block: usize, probe: &Probe, threshold: f32) -> [f32; LANES] {
        let coarse = probe.coarse(&self.keys[block * self.width..][..self.width]);
        if !probe.has_fine() || !coarse.bounds.iter().any(|&bound| bound <= threshold) {
            return coarse.bounds;
        }
        let mut bounds = probe.fine(&coarse, &self.fine[block * FINE..][..FINE]);
        bounds
            .iter_mut()
            .zip(coarse.bounds)
            .for_each(|(fine, bound)| *fine = if bound > *fine { bound } else { *fine });
        bounds
    }
}

/// Boxes of `count` things, 16 of them interleaved; `extent` gives the least and the greatest of one number of one thing.
fn boxes(width: usize, count: usize, extent: impl Fn(usize, usize) -> [f32; 2]) -> Vec<[f32; LANES]> {
    let mut boxes = Vec::with_capacity(count.div_ceil(LANES) * width * 2);
    for first in (0..count).step_by(LANES) {
        for number in 0..width {
            let (mut least, mut most) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
            for (lane, (least, most)) in least.iter_mut().zip(&mut most).enumerate().take(count - first) {
                [*least, *most] = extent(first + lane, number);
            }
            boxes.extend([least, most]);
        }
    }
    boxes
}
