//! The scan of a store that was just opened: keys are read from one end to the other, full rows only where they matter.
//!
//! A store keeps the *key* of every row ([`key`]: a few leading coordinates and the norm of the rest) apart from the other
//! coordinates. [`ColdScan`] takes the keys block by block; now and then [`ColdScan::settle`] measures the nearest rows so
//! far, whose distances tell which of the others, and of those to come, cannot matter. The answer is that of
//! [`super::Index::search`] to the bit.

use super::bound::{KeyShape, Probe, WIDTHS};
use super::question::Best;
use super::{IndexError, Metric, Neighbour, Question};

/// How many coordinates of a point of `dims` stand in its key as they are; the others give the norm, where there are any.
pub fn key_leading(dims: usize) -> usize {
    let shape = KeyShape::first(dims);
    shape.told() - usize::from(shape.has_rest())
}

/// Numbers in the key of a point of `dims` coordinates.
pub fn key_width(dims: usize) -> usize {
    KeyShape::first(dims).told()
}

/// The key of a point, [`key_width`] numbers, as a store keeps it: for points whose first coordinates vary most.
pub fn key(metric: Metric, point: &[f32]) -> Vec<f32> {
    let shape = KeyShape::first(point.len());
    shape.key(metric, point).coarse.into_iter().take(shape.told()).collect()
}

/// A row that may matter.
struct Candidate {
    bound: f32,
    row: usize,
    id: u64,
    key: [f32; WIDTHS[1]],
}

/// So many rows may wait before the nearest of them are measured.
const MANY: usize = 4096;

/// One question on its way through a store. See the module.
pub struct ColdScan<'q> {
    metric: Metric,
    question: Question<'q>,
    shape: KeyShape,
    probe: Probe,
    best: Best,
    candidates: Vec<Candidate>,
    /// The greatest rest norm of any row so far: the only number of a key that is rounded.
    reach: f32,
}

impl<'q> ColdScan<'q> {
    /// A question about at most `rows` points of `dims` coordinates. Refuses what [`super::Index::search`] refuses.
    pub fn new(metric: Metric, dims: usize, rows: usize, question: Question<'q>) -> Result<Self, IndexError> {
        if dims == 0 {
            return Err(IndexError::NoCoordinates);
        }
        question.check(dims)?;
        let shape = KeyShape::first(dims);
        let probe = Probe::new(metric, &shape, question.point, 0.0);
        let best = Best::new(&question, rows);
        Ok(Self { metric, question, shape, probe, best, candidates: vec![], reach: 0.0 })
    }

    /// Takes the keys of rows `first`, `first + 1`, ..., [`key_width`] numbers for each of `ids`. Rows for which `live` is
    /// false, and rows without a point (their key is NaN), are passed over. Surplus keys or ids are left out.
    pub fn keys(&mut self, first: usize, ids: &[u64], keys: &[f32], live: impl Fn(usize) -> bool) {
        let width = self.shape.told();
        if self.shape.has_rest() {
            // The slack that a norm's rounding takes must be known before rows are dropped. A NaN is passed over by `max`.
            let norms = keys.iter().skip(width - 1).step_by(width);
            let reach = norms.fold(self.reach, |reach, &norm| reach.max(norm));
            if reach > self.reach {
                self.reach = reach;
                self.probe = Probe::new(self.metric, &self.shape, self.question.point, reach.into());
            }
        }
        let threshold = self.probe.threshold(self.best.limit());
        for ((row, &id), numbers) in (first..).zip(ids).zip(keys.chunks_exact(width)) {
            let bound = self.probe.distance(numbers);
            if bound <= threshold && live(row) && self.question.admits(id) {
                let mut key = [0.0; WIDTHS[1]];
                key.iter_mut().zip(numbers).for_each(|(key, &number)| *key = number);
                self.candidates.push(Candidate { bound, row, id, key });
            }
        }
    }

    /// Whether so many rows wait that [`ColdScan::settle`] is worth its reading.
    pub fn is_full(&self) -> bool {
        self.candidates.len() > MANY
    }

    /// Measures the rows of the nearest keys so far and forgets those that cannot matter any more. `fetch` appends the
    /// coordinates of a row that are not in its key to the buffer, which holds those that are; its errors end the scan.
    pub fn settle<E>(&mut self, fetch: impl FnMut(usize, &mut Vec<f32>) -> Result<(), E>) -> Result<(), E> {
        let near = self.best.wanted().saturating_mul(2).max(64).min(self.candidates.len());
        // No need to sort them all.
        if near < self.candidates.len() {
            self.candidates.select_nth_unstable_by(near, |a, b| a.bound.total_cmp(&b.bound));
        }
        let others = self.candidates.split_off(near);
        self.measure(fetch)?;
        let threshold = self.probe.threshold(self.best.limit());
        self.candidates = others;
        self.candidates.retain(|candidate| candidate.bound <= threshold);
        Ok(())
    }

    /// The neighbours, nearest first. `fetch` as for [`ColdScan::settle`].
    pub fn finish<E>(
        mut self,
        mut fetch: impl FnMut(usize, &mut Vec<f32>) -> Result<(), E>,
    ) -> Result<Vec<Neighbour>, E> {
        self.settle(&mut fetch)?;
        self.measure(&mut fetch)?;
        Ok(self.best.into_sorted())
    }

    /// Measures what waits, the nearest keys first, until none that is left can matter; nothing waits then.
    fn measure<E>(&mut self, mut fetch: impl FnMut(usize, &mut Vec<f32>) -> Result<(), E>) -> Result<(), E> {
        let mut candidates = std::mem::take(&mut self.candidates);
        candidates.sort_unstable_by(|a, b| a.bound.total_cmp(&b.bound).then(a.row.cmp(&b.row)));
        let leading = self.shape.told() - usize::from(self.shape.has_rest());
        let mut coordinates = Vec::with_capacity(self.question.point.len());
        for candidate in candidates {
            if candidate.bound > self.probe.threshold(self.best.limit()) {
                break;
            }
            coordinates.clear();
            coordinates.extend(candidate.key.iter().take(leading));
            if self.shape.has_rest() {
                fetch(candidate.row, &mut coordinates)?;
            }
            let distance = self.metric.distance(self.question.point, &coordinates);
            self.best.offer(Neighbour { id: candidate.id, distance });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Allowed, Index, Method, Points};
    use super::*;
    use proptest::prelude::*;

    fn bits(hits: &[Neighbour]) -> Vec<(u64, u64)> {
        hits.iter().map(|hit| (hit.id, hit.distance.to_bits())).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

        #[test]
        fn a_cold_scan_answers_like_the_index(
            dims in 1usize..24,
            values in prop::collection::vec(prop_oneof![(-2i8..3).prop_map(f32::from), -1.0f32..1.0], 24..6000),
            l1: bool, k in 1usize..90, share in 1u64..5, radius in prop::option::of(0.0f64..3.0),
            part in 1usize..3000, settle: bool,
        ) {
            let metric = if l1 { Metric::L1 } else { Metric::L2 };
            let rows: Vec<&[f32]> = values.chunks_exact(dims).collect();
            let ids: Vec<u64> = (0..rows.len() as u64).map(|row| row * 3).collect();
            let mut points = Points::from_rows(metric, dims, &ids, &rows.concat()).unwrap();
            points.remove(9);
            let some = |id: u64| id.is_multiple_of(share);
            let question = Question { point: rows[0], k, within: radius, allowed: Allowed::When(&some), exclude: Some(3) };
            let expected = Index::from_points(points).search(&question, Method::Linear).unwrap();

            let keys: Vec<f32> = rows.iter().flat_map(|row| key(metric, row)).collect();
            let fetch = |row: usize, into: &mut Vec<f32>| { into.extend(&rows[row][key_leading(dims)..]); Ok::<(), ()>(()) };
            let mut scan = ColdScan::new(metric, dims, ids.len(), question).unwrap();
            for first in (0..ids.len()).step_by(part) {
                let end = ids.len().min(first + part);
                scan.keys(first, &ids[first..end], &keys[first * key_width(dims)..], |row| row != 3);
                if settle {
                    scan.settle(fetch).unwrap();
                }
            }
            prop_assert_eq!(bits(&scan.finish(fetch).unwrap()), bits(&expected));
        }
    }

    #[test]
    fn rows_without_a_point_are_no_hits() {
        let mut scan = ColdScan::new(Metric::L2, 9, 2, Question::nearest(&[0.0; 9], 5)).unwrap();
        scan.keys(0, &[5, 6], &[[f32::NAN; 8], [1.0; 8]].concat(), |_| true);
        let hits = scan
            .finish(|row, into| {
                into.extend([row as f32; 2]);
                Ok::<(), ()>(())
            })
            .unwrap();
        assert_eq!(hits.iter().map(|hit| hit.id).collect::<Vec<_>>(), [6]);
    }

    #[test]
    fn an_error_of_the_store_ends_the_scan() {
        let mut scan = ColdScan::new(Metric::L2, 9, 1, Question::nearest(&[0.0; 9], 1)).unwrap();
        scan.keys(0, &[5], &key(Metric::L2, &[1.0; 9]), |_| true);
        assert_eq!(scan.finish(|_, _| Err("damaged")), Err("damaged"));
    }
}
