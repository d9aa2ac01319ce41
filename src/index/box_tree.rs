//! [`BoxTree`]: rows in k-d order under three levels of bounding boxes, searched by passes over vectors.
//!
//! Rows are sorted by halving recursively: each part is split along the number of the keys that varies most in it. After
//! that 16 consecutive rows (a *block*) have a small bounding box, and so have 16 blocks (a *group*) and 16 groups (a
//! *cluster*). Bounds of rows come from quantised numbers (see `scalar_quantisation.rs`), first of their keys and then of
//! their points: 15 and 32 bytes instead of 64 and 128, so that the tree of a million rows of 32 coordinates takes 55 MB.
//! Boxes bound the quantised keys. Since these are integers, a box is never farther away than a key in it. Boxes and
//! codes are interleaved: one pass bounds 16 clusters, another the 16 groups of a cluster, another the 16 blocks of a
//! group, another the 16 rows of a block.
//!
//! # Measurements
//!
//! 32 coordinates of real descriptors, k = 10, one core under load, medians of a thousand queries in one run, at 100 k and
//! 1 M rows:
//!
//! | step | 100 k | 1 M |
//! |---|---|---|
//! | order of kiddo's leaves, which splits along each number of the keys in turn | 180 us | 870 us |
//! | order by the number that varies most | 120 us | 550 us |
//! | quantised points instead of longer keys (7 more directions in `f32`): tens of distances instead of hundreds | | 490 us |
//! | quantised keys; no branches on values that were just read | | 410 us |
//! | no candidates from another tree beforehand | 68 us | 260 us |
//!
//! Compiling for AVX2 as well (see `multiversion.rs`) took it from 100 to 75 us and from 440 to 330 us (medians of four
//! alternating runs of the program). Prefetching blocks, with boxes of all 15 numbers, took it from 270 to 220 us at 1 M
//! (the middle of three alternating runs); boxes of 8 or 11 quantised numbers were no better than boxes of 8 in `f32`.
//!
//! Tried and slower: starting with 4 or 8 groups (twice the time at 10 k rows); integer arithmetic on bytes, which the
//! compiler vectorises badly (160 instead of 118 us at 100 k).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::Points;
use super::lower_bound::{LANES, QueryKey};
use super::multiversion::{multiversioned, prefetch};
use super::scalar_quantisation::{self, QuantisedQuery, Quantiser};
use crate::space::Metric;

/// Rows in a group and in a cluster.
const GROUP: usize = LANES * LANES;
const CLUSTER: usize = GROUP * LANES;

/// A row and its key.
pub(super) type Entry<const K: usize> = (u32, [f32; K]);

/// Quantised rows in k-d order, and the boxes around them. A *place* is a position in this order.
pub(super) struct BoxTree {
    /// The row at each place.
    rows: Vec<u32>,
    /// Quantised keys: for every block an array for each number of a key.
    keys: Vec<[i8; LANES]>,
    key_quantiser: Quantiser,
    /// Quantised points: `dims` numbers for every place.
    codes: Vec<i8>,
    quantiser: Quantiser,
    blocks: Boxes,
    groups: Boxes,
    clusters: Boxes,
}

impl BoxTree {
    /// Builds the tree of these rows of `points`; many rows are sorted by the threads of the current rayon pool.
    pub(super) fn new<const K: usize>(points: &Points, mut entries: Vec<Entry<K>>) -> Self {
        sort(&mut entries);
        let rows: Vec<u32> = entries.iter().map(|&(row, _)| row).collect();
        let (key_quantiser, key_codes) =
            Quantiser::fit(points.metric(), &rows, points.key_numbers(), |row, into| points.long_key(row, into));
        let (quantiser, codes) =
            Quantiser::fit(points.metric(), &rows, points.dims(), |row, into| into.copy_from_slice(points.row(row)));
        let keys = interleaved(&key_codes, points.key_numbers());
        let blocks = Boxes::around(points.metric(), &keys, points.key_numbers(), rows.len());
        let groups = blocks.around_sixteens();
        let clusters = groups.around_sixteens();
        Self { rows, keys, key_quantiser, codes, quantiser, blocks, groups, clusters }
    }

    /// Visits every row that may be at most `limit` away from `point`, roughly in order of distance. `visit` returns the new
    /// limit, which must not be larger, or `None` to stop. True if it was not stopped.
    ///
    /// The time is dominated by memory access. Each step therefore processes everything that the step before left, and
    /// collects results without branches on the values just read, so that the CPU can read ahead. Loops are written
    /// plainly: closures inside iterator adapters may not be inlined and would then be compiled without AVX2.
    pub(super) fn sweep(
        &self,
        point: &[f32],
        query_key: &QueryKey,
        limit: f64,
        visit: impl FnMut(u32) -> Option<f64>,
    ) -> bool {
        multiversioned(
            #[inline(always)]
            || self.sweep_here(point, query_key, limit, visit),
        )
    }

    #[inline(always)]
    fn sweep_here(
        &self,
        point: &[f32],
        query_key: &QueryKey,
        mut limit: f64,
        mut visit: impl FnMut(u32) -> Option<f64>,
    ) -> bool {
        let (own_key, own) = (self.key_quantiser.query(&query_key.numbers()), self.quantiser.query(point));
        let reach = |limit: f64| self.key_quantiser.threshold(&own_key, limit + query_key.slack()) as f32;
        let mut groups = self.groups_within(&own_key, reach(limit));
        let (mut blocks, mut places, mut some) = (vec![], vec![], 1);
        while !groups.is_empty() {
            let near = nearest(&mut groups, some);
            let threshold = reach(limit);
            blocks.clear();
            for (at, &(_, group)) in near.iter().enumerate() {
                if let Some(&(_, soon)) = near.get(at + AHEAD) {
                    self.blocks.prefetch(soon);
                }
                self.blocks.within(group, &own_key, threshold, &mut blocks);
            }
            places.clear();
            for (at, &(_, block)) in blocks.iter().enumerate() {
                if let Some(&(_, soon)) = blocks.get(at + AHEAD) {
                    prefetch(self.keys_of(soon));
                }
                self.rows_within(block, &own_key, threshold, &mut places);
            }
            let mut code_threshold = self.quantiser.threshold(&own, limit);
            let mut coded = Vec::with_capacity(places.len());
            for (at, &place) in places.iter().enumerate() {
                if let Some(&soon) = places.get(at + AHEAD) {
                    prefetch(self.code(soon));
                }
                let bound = self.bound(place, &own);
                if bound <= code_threshold {
                    coded.push(Reverse((bound, place)));
                }
            }
            let mut coded = BinaryHeap::from(coded);
            while let Some(Reverse((bound, place))) = coded.pop()
                && bound <= code_threshold
            {
                let Some(now) = visit(self.rows[place as usize]) else { return false };
                if now < limit {
                    limit = now;
                    code_threshold = self.quantiser.threshold(&own, limit);
                }
            }
            let threshold = reach(limit);
            groups.retain(|&(bound, _)| bound <= threshold);
            some *= GROWTH;
        }
        true
    }

    /// The groups that are at most `threshold` away, with their distances.
    #[inline(always)]
    fn groups_within(&self, own: &QuantisedQuery, threshold: f32) -> Vec<(f32, u32)> {
        let (mut clusters, mut groups) = (vec![], vec![]);
        for sixteen in 0..self.clusters.sixteens() {
            self.clusters.within(sixteen as u32, own, threshold, &mut clusters);
        }
        for &(_, cluster) in &clusters {
            self.groups.within(cluster, own, threshold, &mut groups);
        }
        groups
    }

    /// Appends the places of the rows of a block whose quantised keys are at most `threshold` away.
    #[inline(always)]
    fn rows_within(&self, block: u32, own: &QuantisedQuery, threshold: f32, places: &mut Vec<u32>) {
        let (first, keys) = (block * LANES as u32, self.keys_of(block));
        let bounds = match self.key_quantiser.metric {
            Metric::L2 => add_lanes(keys, &own.code, |d| d * d),
            Metric::L1 => add_lanes(keys, &own.code, f32::abs),
        };
        let mut within = [(0, false); LANES];
        for (lane, within) in within.iter_mut().enumerate() {
            *within = (first + lane as u32, bounds[lane] <= threshold);
        }
        append(places, within);
        // The last block may be incomplete.
        while places.last().is_some_and(|&place| place as usize >= self.rows.len()) {
            places.pop();
        }
    }

    /// The quantised keys of a block; empty if there is no such block.
    #[inline(always)]
    fn keys_of(&self, block: u32) -> &[[i8; LANES]] {
        let (block, numbers) = (block as usize, self.key_quantiser.numbers());
        self.keys.get(block * numbers..(block + 1) * numbers).unwrap_or_default()
    }

    /// The quantised point at a place, which must exist.
    #[inline(always)]
    fn code(&self, place: u32) -> &[i8] {
        let dims = self.quantiser.numbers();
        &self.codes[place as usize * dims..][..dims]
    }

    /// The distance between the quantised point at a place and a quantised query.
    #[inline(always)]
    fn bound(&self, place: u32, own: &QuantisedQuery) -> u32 {
        scalar_quantisation::distance(self.quantiser.metric, self.code(place), &own.code)
    }
}

/// The distances between 16 quantised keys and one. All numbers are integers below 2^24, which `f32` adds exactly and in
/// vectors, unlike bytes.
#[inline(always)]
fn add_lanes(keys: &[[i8; LANES]], own: &[i16], term: impl Fn(f32) -> f32) -> [f32; LANES] {
    let mut bounds = [0.0; LANES];
    for (values, &own) in keys.iter().zip(own) {
        for lane in 0..LANES {
            bounds[lane] += term(f32::from(own) - f32::from(values[lane]));
        }
    }
    bounds
}

/// Interleaves 16 codes of `numbers` each; the last 16 are padded with zeros.
fn interleaved(codes: &[i8], numbers: usize) -> Vec<[i8; LANES]> {
    let mut lanes = vec![[0; LANES]; codes.len().div_ceil(numbers * LANES) * numbers];
    for (block, lanes) in codes.chunks(numbers * LANES).zip(lanes.chunks_exact_mut(numbers)) {
        for (lane, code) in block.chunks_exact(numbers).enumerate() {
            lanes.iter_mut().zip(code).for_each(|(values, &value)| values[lane] = value);
        }
    }
    lanes
}

/// The number of blocks, or rows, that are prefetched.
const AHEAD: usize = 6;

/// Each step processes this many times the groups of the step before, since the limit is tighter by then.
const GROWTH: usize = 8;

/// Removes the `some` nearest groups and returns them, in any order.
fn nearest(groups: &mut Vec<(f32, u32)>, some: usize) -> Vec<(f32, u32)> {
    if groups.len() <= some {
        return std::mem::take(groups);
    }
    groups.select_nth_unstable_by(some, |a, b| a.0.total_cmp(&b.0));
    let far = groups.split_off(some);
    std::mem::replace(groups, far)
}

/// Appends the candidates that are wanted, without a branch for each.
#[inline(always)]
fn append<T: Copy + Default>(to: &mut Vec<T>, candidates: [(T, bool); LANES]) {
    let (from, mut count) = (to.len(), 0);
    to.resize(from + LANES, T::default());
    if let Some(slots) = to[from..].first_chunk_mut::<LANES>() {
        for (candidate, is_wanted) in candidates {
            // `count` is at most the number of candidates before this one, so the remainder changes nothing.
            slots[count % LANES] = candidate;
            count += usize::from(is_wanted);
        }
    }
    to.truncate(from + count);
}

/// Sorts entries into k-d order; see the module.
fn sort<const K: usize>(entries: &mut [Entry<K>]) {
    // Parts are whole clusters, groups or blocks: the largest unit that is smaller than the part.
    let unit = [CLUSTER, GROUP, LANES].into_iter().find(|&unit| entries.len() > unit);
    let Some(unit) = unit else { return };
    let axis = widest(entries);
    let middle = entries.len().div_ceil(unit) / 2 * unit;
    entries.select_nth_unstable_by(middle, |(_, a), (_, b)| a[axis].total_cmp(&b[axis]));
    let (first, second) = entries.split_at_mut(middle);
    if middle >= CLUSTER {
        rayon::join(|| sort(first), || sort(second));
    } else {
        sort(first);
        sort(second);
    }
}

/// The number of the keys with the largest variance, estimated from about a thousand keys.
fn widest<const K: usize>(entries: &[Entry<K>]) -> usize {
    let step = (entries.len() / 1024).max(1);
    let (mut sums, mut squares, mut count) = ([0.0f64; K], [0.0f64; K], 0.0);
    for (_, key) in entries.iter().step_by(step) {
        for ((sum, square), &value) in sums.iter_mut().zip(&mut squares).zip(key) {
            *sum += f64::from(value);
            *square += f64::from(value) * f64::from(value);
        }
        count += 1.0;
    }
    let variance = |axis: usize| squares[axis] - sums[axis] * sums[axis] / count;
    (0..K).max_by(|&a, &b| variance(a).total_cmp(&variance(b))).unwrap_or(0)
}

/// Bounding boxes, 16 of them interleaved: for each number of a key the 16 minima, then the 16 maxima. Boxes beyond `count`
/// contain 0 and are ignored.
struct Boxes {
    metric: Metric,
    numbers: usize,
    count: usize,
    lanes: Vec<[i8; LANES]>,
}

impl Boxes {
    /// The boxes of every 16 of `count` interleaved keys of `numbers` each.
    fn around(metric: Metric, keys: &[[i8; LANES]], numbers: usize, count: usize) -> Self {
        Self::new(metric, numbers, count.div_ceil(LANES), |block, number| {
            let there = (count - block * LANES).min(LANES);
            extent(keys[block * numbers + number][..there].iter().map(|&code| [code; 2]))
        })
    }

    /// The boxes of every 16 of these boxes.
    fn around_sixteens(&self) -> Self {
        Self::new(self.metric, self.numbers, self.sixteens(), |sixteen, number| {
            let (at, there) = ((sixteen * self.numbers + number) * 2, (self.count - sixteen * LANES).min(LANES));
            let all = self.lanes[at].into_iter().zip(self.lanes[at + 1]).take(there);
            extent(all.map(|(least, most)| [least, most]))
        })
    }

    /// `extent(box, number)` is the minimum and maximum of one number in one box.
    fn new(metric: Metric, numbers: usize, count: usize, extent: impl Fn(usize, usize) -> [i8; 2]) -> Self {
        let mut lanes = Vec::with_capacity(count.div_ceil(LANES) * numbers * 2);
        for first in (0..count).step_by(LANES) {
            for number in 0..numbers {
                let (mut least, mut most) = ([0; LANES], [0; LANES]);
                for (lane, (least, most)) in least.iter_mut().zip(&mut most).enumerate().take(count - first) {
                    [*least, *most] = extent(first + lane, number);
                }
                lanes.extend([least, most]);
            }
        }
        Self { metric, numbers, count, lanes }
    }

    /// The number of runs of 16 boxes.
    fn sixteens(&self) -> usize {
        self.count.div_ceil(LANES)
    }

    /// Prefetches 16 boxes.
    #[inline(always)]
    fn prefetch(&self, sixteen: u32) {
        let sixteen = sixteen as usize;
        if let Some(boxes) = self.lanes.get(sixteen * self.numbers * 2..(sixteen + 1) * self.numbers * 2) {
            prefetch(boxes);
        }
    }

    /// Appends the boxes of run `sixteen` that are at most `threshold` away, with their distances; none if there is no such
    /// run.
    #[inline(always)]
    fn within(&self, sixteen: u32, own: &QuantisedQuery, threshold: f32, found: &mut Vec<(f32, u32)>) {
        let sixteen = sixteen as usize;
        let Some(boxes) = self.lanes.get(sixteen * self.numbers * 2..(sixteen + 1) * self.numbers * 2) else { return };
        let bounds = match self.metric {
            Metric::L2 => box_lanes(boxes, &own.code, |d| d * d),
            Metric::L1 => box_lanes(boxes, &own.code, |d| d),
        };
        let first = (sixteen * LANES) as u32;
        let mut within = [((0.0, 0), false); LANES];
        for (lane, within) in within.iter_mut().enumerate() {
            *within = ((bounds[lane], first + lane as u32), bounds[lane] <= threshold);
        }
        append(found, within);
        // The last run may be incomplete.
        while found.last().is_some_and(|&(_, at)| at as usize >= self.count) {
            found.pop();
        }
    }
}

/// The distances between a quantised key and 16 boxes, in integers as in [`add_lanes`]; 0 inside a box.
#[inline(always)]
fn box_lanes(boxes: &[[i8; LANES]], own: &[i16], term: impl Fn(f32) -> f32) -> [f32; LANES] {
    let mut sums = [0.0f32; LANES];
    let (pairs, _) = boxes.as_chunks::<2>();
    for ([least, most], &own) in pairs.iter().zip(own) {
        let own = f32::from(own);
        for lane in 0..LANES {
            let (below, above) = (f32::from(least[lane]) - own, own - f32::from(most[lane]));
            // Comparisons compile to single vector instructions; `f32::max` does not.
            let outside = if below > above { below } else { above };
            sums[lane] += term(if outside > 0.0 { outside } else { 0.0 });
        }
    }
    sums
}

/// The smallest extent that contains all of these.
fn extent(all: impl Iterator<Item = [i8; 2]>) -> [i8; 2] {
    all.fold([i8::MAX, i8::MIN], |[least, most], [a, b]| [least.min(a), most.max(b)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Enough rows for several clusters, with incomplete blocks, groups and clusters at the end.
    #[test]
    fn every_row_is_visited_once() {
        for rows in [1, 15, 16, 17, 255, 257, 4097, 9001] {
            let value = |row: usize, i: usize| ((row * 37 + 11) as f32 * (i as f32 + 1.7).sqrt()).sin();
            let values: Vec<f32> = (0..rows * 12).map(|at| value(at / 12, at % 12)).collect();
            let ids: Vec<u64> = (0..rows as u64).collect();
            let points = Points::from_rows(Metric::L2, 12, &ids, &values).unwrap();
            let entries = (0..rows).map(|row| {
                let mut key = [0.0; 8];
                points.key(row, &mut key);
                (row as u32, key)
            });
            let tree = BoxTree::new(&points, entries.collect());
            let point = &values[..12];
            let mut visited = vec![];
            assert!(tree.sweep(point, &points.query_key(point), f64::INFINITY, |row| {
                visited.push(row);
                Some(f64::INFINITY)
            }));
            // The baseline version visits the same rows in the same order.
            for limit in [f64::INFINITY, 0.7] {
                let [mut avx2, mut baseline] = [vec![], vec![]];
                let near = |seen: &mut Vec<u32>, row| {
                    seen.push(row);
                    Some(limit)
                };
                tree.sweep(point, &points.query_key(point), limit, |row| near(&mut avx2, row));
                tree.sweep_here(point, &points.query_key(point), limit, |row| near(&mut baseline, row));
                assert_eq!(avx2, baseline);
            }
            visited.sort_unstable();
            assert_eq!(visited, (0..rows as u32).collect::<Vec<_>>());
            assert!(!tree.sweep(point, &points.query_key(point), f64::INFINITY, |_| None));
        }
    }

    #[test]
    fn blocks_contain_neighbouring_rows() {
        let mut entries: Vec<Entry<4>> =
            (0..5000).map(|row| (row, [((row * 7919) % 5000) as f32, 0.0, 0.5, 0.0])).collect();
        sort(&mut entries);
        for block in entries.chunks(LANES) {
            let least = block.iter().fold(f32::INFINITY, |least, (_, key)| least.min(key[0]));
            let most = block.iter().fold(0.0, |most: f32, (_, key)| most.max(key[0]));
            assert_eq!(most - least, block.len() as f32 - 1.0);
        }
    }
}
