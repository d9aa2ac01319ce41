//! Rows packed so that near ones stand together: what lies within a limit is found by passes over whole vectors.
//!
//! Rows are put in order by halving them again and again, each part where its keys vary most (a k-d order that looks at
//! the rows, not at the level), so 16 of them (a *block*) have a small bounding box, and so have 16 blocks (a *group*)
//! and 16 groups (a *cluster*). Rows are bounded by codes (see `scalar_quantisation.rs`), of their keys first and then of their points: 15
//! and 32 bytes instead of 64 and 128, so that a million rows of 32 coordinates take 55 MB here. Boxes are of the keys'
//! codes too, and as these are whole numbers a box is never farther away than a code in it. Boxes and codes stand interleaved:
//! one pass bounds 16 clusters, another the 16 groups of a cluster, another the 16 blocks of a group, another the 16 rows
//! of a block.
//!
//! Measured (32 coordinates of real descriptors, k = 10, one busy core, medians of a thousand questions, in one run):
//!
//! * Won: this order instead of that of kiddo's leaves, which halves each number of the keys in turn: 120 instead of
//!   180 us at 100 k rows, 550 instead of 870 us at 1 M. Codes of points instead of finer keys (7 more directions in
//!   `f32`), which leave tens of rows to measure instead of hundreds: 490 us at 1 M. Codes of keys and no branches on
//!   what was just read: 410 us. No proposals of another tree before: 68 us at 100 k, 260 us at 1 M.
//! * Won: the same code compiled for AVX2 as well (see `multiversion.rs`): medians of four alternating runs of the program 440 -> 330 us at
//!   1 M rows, 100 -> 75 us at 100 k.
//! * Won: asking for blocks before they are looked at, and boxes of all 15 numbers: 270 -> 220 us at 1 M in the middle of three
//!   alternating runs (boxes of codes of 8 or 11 numbers were no better than those of 8 in `f32`).
//! * Lost: steps of 4 or 8 groups at first (twice the time at 10 k rows); byte arithmetic in whole numbers, which the
//!   compiler turns the wrong way round (160 instead of 118 us at 100 k).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::Points;
use super::lower_bound::{LANES, Probe};
use super::multiversion::{multiversioned, prefetch};
use super::scalar_quantisation::{self, QuantisedQuery, Quantiser};
use crate::space::Metric;

/// Rows in a group and in a cluster.
const GROUP: usize = LANES * LANES;
const CLUSTER: usize = GROUP * LANES;

/// A row and its key.
pub(super) type Entry<const K: usize> = (u32, [f32; K]);

/// Keys of rows, and the boxes around them.
pub(super) struct BoxTree {
    /// Rows by their places, which the order gave them.
    rows: Vec<u32>,
    /// Codes of keys, an array for each of their numbers for every block.
    keys: Vec<[i8; LANES]>,
    key_steps: Quantiser,
    /// Codes of points, `dims` for every place.
    codes: Vec<i8>,
    steps: Quantiser,
    blocks: Boxes,
    groups: Boxes,
    clusters: Boxes,
}

impl BoxTree {
    /// Puts rows of `points` in order and packs them, by the threads of the current rayon pool where they are many.
    pub(super) fn new<const K: usize>(points: &Points, mut entries: Vec<Entry<K>>) -> Self {
        arrange(&mut entries);
        let rows: Vec<u32> = entries.iter().map(|&(row, _)| row).collect();
        let (key_steps, key_codes) =
            Quantiser::code(points.metric(), &rows, points.key_numbers(), |row, into| points.all_keys(row, into));
        let (steps, codes) =
            Quantiser::code(points.metric(), &rows, points.dims(), |row, into| into.copy_from_slice(points.row(row)));
        let keys = interleaved(&key_codes, points.key_numbers());
        let blocks = Boxes::around(points.metric(), &keys, points.key_numbers(), rows.len());
        let groups = blocks.around_sixteens();
        let clusters = groups.around_sixteens();
        Self { rows, keys, key_steps, codes, steps, blocks, groups, clusters }
    }

    /// Visits every row that may be at most `limit` away from `point`, roughly the nearest first. `visit` returns the
    /// limit from then on, which must not grow, or `None` to end the sweep. True if it was not ended.
    ///
    /// Memory is what it waits for, so each step goes over all that the one before left and collects without a branch on
    /// what was just read: the processor then reads ahead. Loops are plain here: what iterators do with closures need not be
    /// inlined, and would then know no wide vectors.
    pub(super) fn sweep(
        &self,
        point: &[f32],
        probe: &Probe,
        limit: f64,
        visit: impl FnMut(u32) -> Option<f64>,
    ) -> bool {
        multiversioned(
            #[inline(always)]
            || self.sweep_here(point, probe, limit, visit),
        )
    }

    #[inline(always)]
    fn sweep_here(
        &self,
        point: &[f32],
        probe: &Probe,
        mut limit: f64,
        mut visit: impl FnMut(u32) -> Option<f64>,
    ) -> bool {
        let (own_key, own) = (self.key_steps.of(&probe.numbers()), self.steps.of(point));
        let reach = |limit: f64| self.key_steps.threshold(&own_key, limit + probe.slack()) as f32;
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
            let mut code_threshold = self.steps.threshold(&own, limit);
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
                    code_threshold = self.steps.threshold(&own, limit);
                }
            }
            let threshold = reach(limit);
            groups.retain(|&(bound, _)| bound <= threshold);
            some *= GROWTH;
        }
        true
    }

    /// The groups that are at most `threshold` away, and how far.
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

    /// Appends the places of the rows of a block whose keys' codes are at most `threshold` away.
    #[inline(always)]
    fn rows_within(&self, block: u32, own: &QuantisedQuery, threshold: f32, places: &mut Vec<u32>) {
        let (first, keys) = (block * LANES as u32, self.keys_of(block));
        let bounds = match self.key_steps.metric {
            Metric::L2 => add_lanes(keys, &own.code, |d| d * d),
            Metric::L1 => add_lanes(keys, &own.code, f32::abs),
        };
        let mut within = [(0, false); LANES];
        for (lane, within) in within.iter_mut().enumerate() {
            *within = (first + lane as u32, bounds[lane] <= threshold);
        }
        append(places, within);
        // The last block may have fewer rows.
        while places.last().is_some_and(|&place| place as usize >= self.rows.len()) {
            places.pop();
        }
    }

    /// The codes of the keys of a block; none where there is no such block.
    #[inline(always)]
    fn keys_of(&self, block: u32) -> &[[i8; LANES]] {
        let (block, numbers) = (block as usize, self.key_steps.numbers());
        self.keys.get(block * numbers..(block + 1) * numbers).unwrap_or_default()
    }

    /// The code of the point at a place, which must exist.
    #[inline(always)]
    fn code(&self, place: u32) -> &[i8] {
        let dims = self.steps.numbers();
        &self.codes[place as usize * dims..][..dims]
    }

    /// The distance of the point at a place from a query, in codes.
    #[inline(always)]
    fn bound(&self, place: u32, own: &QuantisedQuery) -> u32 {
        scalar_quantisation::distance(self.steps.metric, self.code(place), &own.code)
    }
}

/// The distances of 16 codes from one. All are whole numbers below 2^24, which `f32` adds exactly, and in whole vectors,
/// as compilers do not with bytes.
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

/// Codes of `numbers` each, 16 of them interleaved; the last 16 are filled up with zeros.
fn interleaved(codes: &[i8], numbers: usize) -> Vec<[i8; LANES]> {
    let mut lanes = vec![[0; LANES]; codes.len().div_ceil(numbers * LANES) * numbers];
    for (block, lanes) in codes.chunks(numbers * LANES).zip(lanes.chunks_exact_mut(numbers)) {
        for (lane, code) in block.chunks_exact(numbers).enumerate() {
            lanes.iter_mut().zip(code).for_each(|(values, &value)| values[lane] = value);
        }
    }
    lanes
}

/// So many blocks, or rows, are asked for before they are looked at.
const AHEAD: usize = 6;

/// Each step looks at so many times the groups of the one before: the limit is known better.
const GROWTH: usize = 8;

/// Takes the `some` nearest out of `groups`, in any order.
fn nearest(groups: &mut Vec<(f32, u32)>, some: usize) -> Vec<(f32, u32)> {
    if groups.len() <= some {
        return std::mem::take(groups);
    }
    groups.select_nth_unstable_by(some, |a, b| a.0.total_cmp(&b.0));
    let far = groups.split_off(some);
    std::mem::replace(groups, far)
}

/// Appends those that are wanted, without a branch for each.
#[inline(always)]
fn append<T: Copy + Default>(to: &mut Vec<T>, candidates: [(T, bool); LANES]) {
    let (from, mut count) = (to.len(), 0);
    to.resize(from + LANES, T::default());
    if let Some(slots) = to[from..].first_chunk_mut::<LANES>() {
        for (candidate, is_wanted) in candidates {
            // As many as came before at most: never out of bounds.
            slots[count % LANES] = candidate;
            count += usize::from(is_wanted);
        }
    }
    to.truncate(from + count);
}

/// Puts entries in an order in which near ones stand together: see the module.
fn arrange<const K: usize>(entries: &mut [Entry<K>]) {
    // Parts are whole clusters, groups or blocks, whichever is the greatest that halves them.
    let unit = [CLUSTER, GROUP, LANES].into_iter().find(|&unit| entries.len() > unit);
    let Some(unit) = unit else { return };
    let axis = widest(entries);
    let middle = entries.len().div_ceil(unit) / 2 * unit;
    entries.select_nth_unstable_by(middle, |(_, a), (_, b)| a[axis].total_cmp(&b[axis]));
    let (first, second) = entries.split_at_mut(middle);
    if middle >= CLUSTER {
        rayon::join(|| arrange(first), || arrange(second));
    } else {
        arrange(first);
        arrange(second);
    }
}

/// The number of the keys that varies most, judged by some thousand of them.
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

/// Boxes around codes of keys that stand in order, 16 of them interleaved: the least and the greatest of each number of a
/// key in turn. Where there are no more things, boxes are those of nothing: nothing is in them.
struct Boxes {
    metric: Metric,
    numbers: usize,
    count: usize,
    lanes: Vec<[i8; LANES]>,
}

impl Boxes {
    /// Around every 16 of `count` codes of `numbers` each, which stand interleaved.
    fn around(metric: Metric, keys: &[[i8; LANES]], numbers: usize, count: usize) -> Self {
        Self::new(metric, numbers, count.div_ceil(LANES), |block, number| {
            let there = (count - block * LANES).min(LANES);
            extent(keys[block * numbers + number][..there].iter().map(|&code| [code; 2]))
        })
    }

    /// Around every 16 of these boxes.
    fn around_sixteens(&self) -> Self {
        Self::new(self.metric, self.numbers, self.sixteens(), |sixteen, number| {
            let (at, there) = ((sixteen * self.numbers + number) * 2, (self.count - sixteen * LANES).min(LANES));
            let all = self.lanes[at].into_iter().zip(self.lanes[at + 1]).take(there);
            extent(all.map(|(least, most)| [least, most]))
        })
    }

    /// `extent` gives the least and the greatest of one number of one thing.
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

    /// How many times 16 boxes there are.
    fn sixteens(&self) -> usize {
        self.count.div_ceil(LANES)
    }

    /// Asks for 16 boxes that will be looked at soon.
    #[inline(always)]
    fn prefetch(&self, sixteen: u32) {
        let sixteen = sixteen as usize;
        if let Some(boxes) = self.lanes.get(sixteen * self.numbers * 2..(sixteen + 1) * self.numbers * 2) {
            prefetch(boxes);
        }
    }

    /// Appends those of the `sixteen`th 16 boxes (none where there are no more) that are at most `threshold` away, and how
    /// far.
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
        // The last boxes may be fewer.
        while found.last().is_some_and(|&(_, at)| at as usize >= self.count) {
            found.pop();
        }
    }
}

/// How far a code is from 16 boxes, in whole numbers as for [`add_lanes`]; 0 inside a box.
#[inline(always)]
fn box_lanes(boxes: &[[i8; LANES]], own: &[i16], term: impl Fn(f32) -> f32) -> [f32; LANES] {
    let mut sums = [0.0f32; LANES];
    let (pairs, _) = boxes.as_chunks::<2>();
    for ([least, most], &own) in pairs.iter().zip(own) {
        let own = f32::from(own);
        for lane in 0..LANES {
            let (below, above) = (f32::from(least[lane]) - own, own - f32::from(most[lane]));
            // Plain comparisons: single instructions on vectors, which `f32::max` is not.
            let outside = if below > above { below } else { above };
            sums[lane] += term(if outside > 0.0 { outside } else { 0.0 });
        }
    }
    sums
}

/// What holds all of these extents.
fn extent(all: impl Iterator<Item = [i8; 2]>) -> [i8; 2] {
    all.fold([i8::MAX, i8::MIN], |[least, most], [a, b]| [least.min(a), most.max(b)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows enough for several clusters, the last of each kind of part not full.
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
            let packed = BoxTree::new(&points, entries.collect());
            let point = &values[..12];
            let mut visited = vec![];
            assert!(packed.sweep(point, &points.probe(point), f64::INFINITY, |row| {
                visited.push(row);
                Some(f64::INFINITY)
            }));
            // The same, in the same order, without wide vectors.
            for limit in [f64::INFINITY, 0.7] {
                let [mut wide, mut narrow] = [vec![], vec![]];
                let near = |seen: &mut Vec<u32>, row| {
                    seen.push(row);
                    Some(limit)
                };
                packed.sweep(point, &points.probe(point), limit, |row| near(&mut wide, row));
                packed.sweep_here(point, &points.probe(point), limit, |row| near(&mut narrow, row));
                assert_eq!(wide, narrow);
            }
            visited.sort_unstable();
            assert_eq!(visited, (0..rows as u32).collect::<Vec<_>>());
            assert!(!packed.sweep(point, &points.probe(point), f64::INFINITY, |_| None));
        }
    }

    #[test]
    fn near_rows_stand_together() {
        let mut entries: Vec<Entry<4>> =
            (0..5000).map(|row| (row, [((row * 7919) % 5000) as f32, 0.0, 0.5, 0.0])).collect();
        arrange(&mut entries);
        for block in entries.chunks(LANES) {
            let least = block.iter().fold(f32::INFINITY, |least, (_, key)| least.min(key[0]));
            let most = block.iter().fold(0.0, |most: f32, (_, key)| most.max(key[0]));
            assert_eq!(most - least, block.len() as f32 - 1.0);
        }
    }
}
