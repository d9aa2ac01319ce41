//! [`DiskScan`]: a query answered from disk, which reads the codes of all points and the coordinates of few.
//!
//! A store contains the *code* of every point ([`quantise`]) apart from the points: one byte per coordinate, in steps of
//! 1/127. A code is off by at most half a step in each coordinate, so the distance between two codes bounds that between
//! their points, for a quarter of the bytes. The caller passes codes to [`DiskScan::push_codes`] block by block. From
//! time to time [`DiskScan::refine`] computes the distances of the nearest rows so far, which exclude most other rows,
//! read or still to come. The answer equals that of [`super::Index::search`] to the bit.
//!
//! # The margin
//!
//! Let `c(x)` be the coordinates clamped to [-1, 1] and `r(x)` those in whole steps. Clamping increases no distance, and
//! `|r(x)/127 - c(x)|` is at most `1/254` in each coordinate, so at most `e = sqrt(d)/254` (L2) or `e = d/254` (L1) in all.
//! The error of the query is known. So `distance(r(x), r(q)) / 127 <= distance(x, q) + e + error of the query` (see
//! `scalar_quantisation.rs`).
//!
//! For a million points of a store of moments (32 coordinates, k = 10) a few dozen rows are fetched. Keys of the same size
//! (seven leading coordinates and the norm of the rest) would leave some thousand.

use super::scalar_quantisation::{self, NO_POINT, STEPS, quantise};
use super::top_k::TopK;
use super::{IndexError, KnnQuery, Neighbour};
use crate::space::Metric;

/// A row that may be a hit.
#[derive(Clone, Copy)]
struct Candidate {
    bound: u32,
    row: usize,
    id: u64,
}

/// The number of candidates above which [`DiskScan::refine`] should be called.
const MANY: usize = 4096;

/// A running scan for one query. See the module's documentation.
pub struct DiskScan<'q> {
    metric: Metric,
    query: KnnQuery<'q>,
    codes: Vec<i16>,
    /// The most by which the distance between codes, divided by 127, exceeds that between points.
    slack: f64,
    best: TopK,
    candidates: Vec<Candidate>,
}

impl<'q> DiskScan<'q> {
    /// Starts a scan over at most `rows` points of `dims` coordinates.
    ///
    /// # Errors
    /// As [`super::Index::search`].
    pub fn new(metric: Metric, dims: usize, rows: usize, query: KnnQuery<'q>) -> Result<Self, IndexError> {
        if dims == 0 {
            return Err(IndexError::NoCoordinates);
        }
        query.check(dims)?;
        let codes: Vec<i16> = quantise(query.point).map(i16::from).collect();
        let whole: Vec<f32> = codes.iter().map(|&code| f32::from(code) / STEPS).collect();
        let cut: Vec<f32> = query.point.iter().map(|coordinate| coordinate.clamp(-1.0, 1.0)).collect();
        let half = 0.5 / f64::from(STEPS);
        let others = match metric {
            Metric::L2 => half * (dims as f64).sqrt(),
            Metric::L1 => half * dims as f64,
        };
        // Rounding in `f32` can move a coordinate slightly beyond half a step.
        let slack = (others + metric.distance(&whole, &cut)) * (1.0 + 1e-6) + 1e-6 * dims as f64;
        let best = TopK::new(&query, rows);
        Ok(Self { metric, query, codes, slack, best, candidates: vec![] })
    }

    /// Reads the codes of the rows `first`, `first + 1`, ...: one byte for each coordinate of each of `ids`; a row begins
    /// every `stride` bytes. Rows for which `live` is false and rows without a point are skipped, surplus codes or ids
    /// ignored.
    pub fn push_codes(&mut self, first: usize, ids: &[u64], stride: usize, codes: &[i8], live: impl Fn(usize) -> bool) {
        let threshold = self.threshold();
        for ((row, &id), code) in (first..).zip(ids).zip(codes.chunks_exact(stride.max(self.codes.len()))) {
            let bound = scalar_quantisation::distance(self.metric, code, &self.codes);
            let there = code.first() != Some(&NO_POINT);
            if bound <= threshold && there && live(row) && self.query.admits(id) {
                self.candidates.push(Candidate { bound, row, id });
            }
        }
    }

    /// The largest bound of a row that may be a hit.
    fn threshold(&self) -> u32 {
        scalar_quantisation::threshold(self.metric, (self.best.limit() + self.slack) * f64::from(STEPS))
    }

    /// Whether there are so many candidates that [`DiskScan::refine`] is worth its reads.
    pub fn is_full(&self) -> bool {
        self.candidates.len() > MANY
    }

    /// Computes the distances of the rows with the nearest codes so far and drops candidates that cannot be hits any more.
    /// `fetch` appends the coordinates of a row to an empty buffer.
    ///
    /// # Errors
    /// Those of `fetch`.
    pub fn refine<E>(&mut self, fetch: impl FnMut(usize, &mut Vec<f32>) -> Result<(), E>) -> Result<(), E> {
        let near = self.best.wanted().saturating_add(self.best.wanted() / 2).max(16).min(self.candidates.len());
        // Sorting all of them is not needed.
        if near < self.candidates.len() {
            self.candidates.select_nth_unstable_by_key(near, |candidate| candidate.bound);
        }
        let others = self.candidates.split_off(near);
        self.measure(fetch)?;
        let threshold = self.threshold();
        self.candidates = others;
        self.candidates.retain(|candidate| candidate.bound <= threshold);
        Ok(())
    }

    /// Ends the scan and returns the neighbours, nearest first. `fetch` is as in [`DiskScan::refine`].
    ///
    /// # Errors
    /// Those of `fetch`.
    pub fn finish<E>(
        mut self,
        mut fetch: impl FnMut(usize, &mut Vec<f32>) -> Result<(), E>,
    ) -> Result<Vec<Neighbour>, E> {
        self.refine(&mut fetch)?;
        self.measure(&mut fetch)?;
        Ok(self.best.into_sorted())
    }

    /// Computes distances of candidates in order of their bounds until the others cannot be hits; no candidates are left.
    fn measure<E>(&mut self, mut fetch: impl FnMut(usize, &mut Vec<f32>) -> Result<(), E>) -> Result<(), E> {
        let mut candidates = std::mem::take(&mut self.candidates);
        candidates.sort_unstable_by_key(|candidate| (candidate.bound, candidate.row));
        let mut coordinates = Vec::with_capacity(self.query.point.len());
        for candidate in candidates {
            if candidate.bound > self.threshold() {
                break;
            }
            coordinates.clear();
            fetch(candidate.row, &mut coordinates)?;
            let distance = self.metric.distance(self.query.point, &coordinates);
            self.best.offer(Neighbour { id: candidate.id, distance });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{IdFilter, Index, IndexMethod, Points};
    use super::*;
    use proptest::prelude::*;

    fn bits(hits: &[Neighbour]) -> Vec<(u64, u64)> {
        hits.iter().map(|hit| (hit.id, hit.distance.to_bits())).collect()
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(100))]

        #[test]
        fn a_disk_scan_answers_like_the_index(
            dims in 1usize..24,
            values in prop::collection::vec(
                prop_oneof![
                    (-2i8..3).prop_map(f32::from), -1.0f32..1.0, (-130i16..130).prop_map(|n| f32::from(n) / 254.0),
                ],
                24..6000,
            ),
            l1: bool, k in 1usize..90, share in 1u64..5, radius in prop::option::of(0.0f64..3.0),
            part in 1usize..3000, settle: bool,
        ) {
            let metric = if l1 { Metric::L1 } else { Metric::L2 };
            let rows: Vec<&[f32]> = values.chunks_exact(dims).collect();
            let ids: Vec<u64> = (0..rows.len() as u64).map(|row| row * 3).collect();
            let mut points = Points::from_rows(metric, dims, &ids, &rows.concat()).unwrap();
            points.remove(9);
            let some = |id: u64| id.is_multiple_of(share);
            let query = KnnQuery { point: rows[0], k, within: radius, filter: IdFilter::Predicate(&some), exclude: Some(3) };
            let expected = Index::from_points(points).search(&query, IndexMethod::Linear).unwrap();

            let coded: Vec<i8> = rows.iter().flat_map(|row| quantise(row)).collect();
            let fetch = |row: usize, into: &mut Vec<f32>| { into.extend(rows[row]); Ok::<(), ()>(()) };
            let mut scan = DiskScan::new(metric, dims, ids.len(), query).unwrap();
            for first in (0..ids.len()).step_by(part) {
                let end = ids.len().min(first + part);
                scan.push_codes(first, &ids[first..end], dims, &coded[first * dims..], |row| row != 3);
                if settle {
                    scan.refine(fetch).unwrap();
                }
            }
            prop_assert_eq!(bits(&scan.finish(fetch).unwrap()), bits(&expected));
        }
    }

    #[test]
    fn few_rows_are_fetched() {
        const ROWS: usize = 20_000;
        let value = |row: usize, i: usize| ((row * 31 + 7) as f32 * (i as f32 + 1.3).sqrt()).sin() / 3.0;
        let point = |row: usize| (0..8).map(|i| value(row, i)).collect::<Vec<f32>>();
        let query = point(ROWS + 3);
        let ids: Vec<u64> = (0..ROWS as u64).collect();
        let coded: Vec<i8> = (0..ROWS).flat_map(|row| quantise(&point(row)).collect::<Vec<_>>()).collect();
        let mut scan = DiskScan::new(Metric::L2, 8, ROWS, KnnQuery::nearest(&query, 10)).unwrap();
        scan.push_codes(0, &ids, 8, &coded, |_| true);
        let mut fetched = 0;
        let fetch = |row: usize, into: &mut Vec<f32>| {
            into.extend(point(row));
            fetched += 1;
            Ok::<(), ()>(())
        };
        assert_eq!(scan.finish(fetch).unwrap().len(), 10);
        assert!(fetched < 100, "{fetched}");
    }

    #[test]
    fn rows_without_a_point_are_no_hits() {
        let mut scan = DiskScan::new(Metric::L2, 9, 2, KnnQuery::nearest(&[0.0; 9], 5)).unwrap();
        let coded: Vec<i8> = quantise(&[f32::NAN; 9]).chain(quantise(&[1.0; 9])).collect();
        scan.push_codes(0, &[5, 6], 9, &coded, |_| true);
        let hits = scan
            .finish(|row, into| {
                into.extend([row as f32; 9]);
                Ok::<(), ()>(())
            })
            .unwrap();
        assert_eq!(hits.iter().map(|hit| hit.id).collect::<Vec<_>>(), [6]);
    }

    #[test]
    fn an_error_of_the_store_ends_the_scan() {
        let mut scan = DiskScan::new(Metric::L2, 1, 1, KnnQuery::nearest(&[0.0], 1)).unwrap();
        scan.push_codes(0, &[5], 1, &[127], |_| true);
        assert_eq!(scan.finish(|_, _| Err("damaged")), Err("damaged"));
    }
}
