//! The scan of a store that was just opened: keys are read from one end to the other, full rows only where they matter.
//!
//! A store keeps the *key* of every row ([`key`]: a few leading coordinates and the norm of the rest) apart from the full
//! rows. [`ColdScan`] takes the keys block by block, in any pieces, and then asks for full rows one by one, the nearest
//! keys first, until no other row can matter. The answer is that of [`super::Index::search`] to the bit.

use super::bound::{KeyShape, Probe};
use super::question::Best;
use super::{IndexError, Metric, Neighbour, Question};

/// Numbers in the key of a point of `dims` coordinates.
pub fn key_width(dims: usize) -> usize {
    KeyShape::first(dims).width()
}

/// The key of a point, [`key_width`] numbers, as a store keeps it: for points whose first coordinates vary most.
pub fn key(metric: Metric, point: &[f32]) -> Vec<f32> {
    KeyShape::first(point.len()).key(metric, point).collect()
}

/// A row that may matter.
struct Candidate {
    bound: f32,
    row: usize,
    id: u64,
}

/// One question on its way through a store. See the module.
pub struct ColdScan<'q> {
    metric: Metric,
    question: Question<'q>,
    shape: KeyShape,
    probe: Probe,
    candidates: Vec<Candidate>,
    /// The greatest rest norm of any row.
    reach: f32,
}

impl<'q> ColdScan<'q> {
    /// A question about points of `dims` coordinates. Refuses what [`super::Index::search`] refuses.
    pub fn new(metric: Metric, dims: usize, question: Question<'q>) -> Result<Self, IndexError> {
        if dims == 0 {
            return Err(IndexError::NoCoordinates);
        }
        question.check(dims)?;
        let shape = KeyShape::first(dims);
        let probe = Probe::new(metric, &shape, question.point, 0.0);
        Ok(Self { metric, question, shape, probe, candidates: vec![], reach: 0.0 })
    }

    /// Takes the keys of rows `first`, `first + 1`, ..., [`key_width`] numbers for each of `ids`. Rows for which `live` is
    /// false are passed over. Surplus keys or ids are left out.
    pub fn keys(&mut self, first: usize, ids: &[u64], keys: &[f32], live: impl Fn(usize) -> bool) {
        let width = self.shape.width();
        for ((row, &id), key) in (first..).zip(ids).zip(keys.chunks_exact(width)) {
            if live(row) && self.question.admits(id) {
                let bound = self.probe.distance(key);
                self.candidates.push(Candidate { bound, row, id });
                if self.shape.has_rest() {
                    self.reach = self.reach.max(key[width - 1]);
                }
            }
        }
    }

    /// The neighbours, nearest first. `fetch` puts the full coordinates of a row into the buffer (cleared before); its
    /// errors end the scan.
    pub fn finish<E>(
        mut self,
        mut fetch: impl FnMut(usize, &mut Vec<f32>) -> Result<(), E>,
    ) -> Result<Vec<Neighbour>, E> {
        let probe = Probe::new(self.metric, &self.shape, self.question.point, self.reach);
        let mut best = Best::new(&self.question, self.candidates.len());
        // The nearest keys give a limit, the limit leaves few of the others: no need to sort them all.
        let near = best.wanted().saturating_mul(2).max(64).min(self.candidates.len());
        if near < self.candidates.len() {
            self.candidates.select_nth_unstable_by(near, |a, b| a.bound.total_cmp(&b.bound));
        }
        let mut others = self.candidates.split_off(near);
        measure(self.metric, &self.question, &probe, &mut self.candidates, &mut best, &mut fetch)?;
        let threshold = probe.threshold(best.limit());
        others.retain(|candidate| candidate.bound <= threshold);
        measure(self.metric, &self.question, &probe, &mut others, &mut best, &mut fetch)?;
        Ok(best.into_sorted())
    }
}

/// Measures candidates, the nearest keys first, until none that is left can matter.
fn measure<E>(
    metric: Metric,
    question: &Question<'_>,
    probe: &Probe,
    candidates: &mut [Candidate],
    best: &mut Best,
    fetch: &mut impl FnMut(usize, &mut Vec<f32>) -> Result<(), E>,
) -> Result<(), E> {
    candidates.sort_unstable_by(|a, b| a.bound.total_cmp(&b.bound).then(a.row.cmp(&b.row)));
    let mut coordinates = Vec::with_capacity(question.point.len());
    for candidate in candidates {
        if candidate.bound > probe.threshold(best.limit()) {
            break;
        }
        coordinates.clear();
        fetch(candidate.row, &mut coordinates)?;
        best.offer(Neighbour { id: candidate.id, distance: metric.distance(question.point, &coordinates) });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Allowed, Index, Method, Points};
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

        #[test]
        fn a_cold_scan_answers_like_the_index(
            dims in 1usize..24,
            values in prop::collection::vec(prop_oneof![(-2i8..3).prop_map(f32::from), -1.0f32..1.0], 24..6000),
            l1: bool, k in 1usize..90, share in 1u64..5, radius in prop::option::of(0.0f64..3.0),
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
            let mut scan = ColdScan::new(metric, dims, question).unwrap();
            let half = ids.len() / 2;
            let (front, back) = keys.split_at(half * key_width(dims));
            scan.keys(0, &ids[..half], front, |row| row != 3);
            scan.keys(half, &ids[half..], back, |row| row != 3);
            let found = scan.finish(|row, into| { into.extend(rows[row]); Ok::<(), ()>(()) }).unwrap();
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn an_error_of_the_store_ends_the_scan() {
        let mut scan = ColdScan::new(Metric::L2, 1, Question::nearest(&[0.0], 1)).unwrap();
        scan.keys(0, &[5], &key(Metric::L2, &[1.0]), |_| true);
        assert_eq!(scan.finish(|_, _| Err("damaged")), Err("damaged"));
    }
}
