//! Rows of points that many threads read while one adds and removes.
//!
//! A *row* is a point with its id; rows are numbered from 0 in ascending order of their ids. A removed row stays where
//! it is as a *tombstone* until the points are compacted. [`Points`] is a value: a clone is a snapshot that shares all
//! memory with its origin and never changes. Rows live in chunks of [`CHUNK_ROWS`] behind reference counts; a writer
//! copies only the chunk it touches, and only while a snapshot still holds it, so adding never waits for a query nor a
//! query for it.
//!
//! Invariants: ids ascend strictly; every coordinate is finite; all rows have the same number of coordinates.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::IndexError;
use super::lower_bound::{FINE, Key, KeyBlock, KeyShape, LANES, Probe};
use super::query::check_point;
use crate::space::Metric;

/// Rows of a chunk, the unit of sharing between snapshots.
pub const CHUNK_ROWS: usize = 1024;

/// Which rows of a chunk are live: bit `i % 64` of word `i / 64` for row `i` of the chunk.
type Live = [u64; CHUNK_ROWS / 64];

/// Up to [`CHUNK_ROWS`] rows.
#[derive(Clone, Default)]
struct Chunk {
    ids: Vec<u64>,
    /// Coordinates, row after row.
    rows: Vec<f32>,
    /// Coarse keys, `width` arrays for every [`LANES`] rows.
    keys: Vec<[f32; LANES]>,
    /// Fine keys, [`FINE`] arrays for every [`LANES`] rows; empty where there are none.
    fine: Vec<[f32; LANES]>,
}

/// Points of one space, with their ids, and which of them are live. See the module.
#[derive(Clone)]
pub struct Points {
    metric: Metric,
    dims: usize,
    shape: Arc<KeyShape>,
    chunks: Arc<Vec<Arc<Chunk>>>,
    live: Arc<Vec<Arc<Live>>>,
    removed: usize,
    /// The greatest norm of any point.
    reach: f64,
    /// The greatest magnitude of any number of a coarse key.
    magnitude: f32,
    /// Which points these descend from: a tree belongs to one lineage, whose row numbers never change.
    lineage: u64,
}

fn new_lineage() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

impl Points {
    /// No points yet, of `dims` coordinates each (at least 1).
    pub fn new(metric: Metric, dims: usize) -> Result<Self, IndexError> {
        Self::empty(metric, dims, KeyShape::first(dims))
    }

    fn empty(metric: Metric, dims: usize, shape: KeyShape) -> Result<Self, IndexError> {
        if dims == 0 {
            return Err(IndexError::NoCoordinates);
        }
        Ok(Self {
            metric,
            dims,
            shape: Arc::new(shape),
            chunks: Arc::default(),
            live: Arc::default(),
            removed: 0,
            reach: 0.0,
            magnitude: 0.0,
            lineage: new_lineage(),
        })
    }

    /// All rows at once: `coordinates` holds the points of `ids` (ascending) one after another.
    ///
    /// Better than adding one by one where there are many: work is shared between threads, and the directions of
    /// greatest variance are looked for and lead the scan.
    pub fn from_rows(metric: Metric, dims: usize, ids: &[u64], coordinates: &[f32]) -> Result<Self, IndexError> {
        if Some(coordinates.len()) != ids.len().checked_mul(dims) {
            return Err(IndexError::Length { ids: ids.len(), dims, coordinates: coordinates.len() });
        }
        if let Some(pair) = ids.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(IndexError::IdOrder { id: pair[1], last: pair[0] });
        }
        if u32::try_from(ids.len()).is_err() {
            return Err(IndexError::Full);
        }
        let mut points = Self::empty(metric, dims, KeyShape::learned(metric, dims, coordinates))?;
        let shape = &points.shape;
        let chunks: Vec<(Chunk, f64, f32)> = ids
            .par_chunks(CHUNK_ROWS)
            .zip(coordinates.par_chunks(CHUNK_ROWS * dims))
            .map(|(ids, rows)| Chunk::filled(metric, shape, dims, ids, rows))
            .collect::<Result<_, _>>()?;
        let live = chunks.iter().map(|(chunk, ..)| Arc::new(all_live(chunk.ids.len()))).collect();
        points.live = Arc::new(live);
        points.reach = chunks.iter().fold(0.0, |most, &(_, reach, _)| most.max(reach));
        points.magnitude = chunks.iter().fold(0.0, |most, &(.., magnitude)| most.max(magnitude));
        points.chunks = Arc::new(chunks.into_iter().map(|(chunk, ..)| Arc::new(chunk)).collect());
        Ok(points)
    }

    /// Adds a row. Its id must be greater than all before it.
    pub fn push(&mut self, id: u64, point: &[f32]) -> Result<(), IndexError> {
        check_point(point, self.dims)?;
        if let Some(last) = self.last_id()
            && id <= last
        {
            return Err(IndexError::IdOrder { id, last });
        }
        let row = self.rows();
        if u32::try_from(row + 1).is_err() {
            return Err(IndexError::Full);
        }
        let chunks = Arc::make_mut(&mut self.chunks);
        let live = Arc::make_mut(&mut self.live);
        if row.is_multiple_of(CHUNK_ROWS) {
            chunks.push(Arc::default());
            live.push(Arc::default());
        }
        let at = row % CHUNK_ROWS;
        if let (Some(chunk), Some(live)) = (chunks.last_mut(), live.last_mut()) {
            let (reach, magnitude) = Arc::make_mut(chunk).push(self.metric, &self.shape, id, point);
            self.reach = self.reach.max(reach);
            self.magnitude = self.magnitude.max(magnitude);
            Arc::make_mut(live)[at / 64] |= 1 << (at % 64);
        }
        Ok(())
    }

    /// Makes the row of this id a tombstone. False where there is no such live row.
    pub fn remove(&mut self, id: u64) -> bool {
        let Some(row) = self.find(id) else { return false };
        let at = row % CHUNK_ROWS;
        Arc::make_mut(&mut Arc::make_mut(&mut self.live)[row / CHUNK_ROWS])[at / 64] &= !(1 << (at % 64));
        self.removed += 1;
        true
    }

    /// The same live rows, without tombstones, in memory of their own. Row numbers change: trees are built anew.
    pub fn compacted(&self) -> Self {
        let mut ids = Vec::with_capacity(self.len());
        let mut coordinates = Vec::with_capacity(self.len() * self.dims);
        for (id, point) in self.iter() {
            ids.push(id);
            coordinates.extend_from_slice(point);
        }
        match Self::from_rows(self.metric, self.dims, &ids, &coordinates) {
            Ok(points) => points,
            // Rows that were taken in once cannot be refused now; if they were, they stay as they are.
            Err(_) => self.clone(),
        }
    }

    /// The metric of the space.
    pub fn metric(&self) -> Metric {
        self.metric
    }

    /// Coordinates of a point.
    pub fn dims(&self) -> usize {
        self.dims
    }

    /// Live rows.
    pub fn len(&self) -> usize {
        self.rows() - self.removed
    }

    /// Whether there is no live row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All rows, tombstones included.
    pub fn rows(&self) -> usize {
        match self.chunks.split_last() {
            Some((last, full)) => full.len() * CHUNK_ROWS + last.ids.len(),
            None => 0,
        }
    }

    /// Tombstones.
    pub fn removed(&self) -> usize {
        self.removed
    }

    /// The greatest id of any row, live or not.
    pub fn last_id(&self) -> Option<u64> {
        self.chunks.last().and_then(|chunk| chunk.ids.last().copied())
    }

    /// The live row of an id.
    pub fn find(&self, id: u64) -> Option<usize> {
        let chunk = self.chunks.partition_point(|chunk| chunk.ids[0] <= id).checked_sub(1)?;
        let at = self.chunks[chunk].ids.binary_search(&id).ok()?;
        let row = chunk * CHUNK_ROWS + at;
        self.is_live(row).then_some(row)
    }

    /// The point of an id, if it is live.
    pub fn point(&self, id: u64) -> Option<&[f32]> {
        self.find(id).map(|row| self.row(row))
    }

    /// Id and point of every live row, in ascending order of ids.
    pub fn iter(&self) -> impl Iterator<Item = (u64, &[f32])> {
        (0..self.rows()).filter(|&row| self.is_live(row)).map(|row| (self.id(row), self.row(row)))
    }

    /// The id of a row, which must exist.
    #[inline]
    pub(super) fn id(&self, row: usize) -> u64 {
        self.chunks[row / CHUNK_ROWS].ids[row % CHUNK_ROWS]
    }

    /// The coordinates of a row, which must exist.
    #[inline]
    pub(super) fn row(&self, row: usize) -> &[f32] {
        &self.chunks[row / CHUNK_ROWS].rows[row % CHUNK_ROWS * self.dims..][..self.dims]
    }

    /// Whether a row, which must exist, is not a tombstone.
    #[inline]
    pub(super) fn is_live(&self, row: usize) -> bool {
        let at = row % CHUNK_ROWS;
        self.live[row / CHUNK_ROWS][at / 64] >> (at % 64) & 1 == 1
    }

    /// The coarse keys of rows `block * LANES ..`, and bit `i` set where row `block * LANES + i` is there and live.
    #[inline]
    pub(super) fn block(&self, block: usize) -> (&KeyBlock, u32) {
        const BLOCKS: usize = CHUNK_ROWS / LANES;
        let width = self.shape.width();
        let (chunk, at) = (block / BLOCKS, block % BLOCKS);
        let word = self.live[chunk][at * LANES / 64];
        let live = (word >> (at * LANES % 64)) as u32 & ((1 << LANES) - 1);
        (&self.chunks[chunk].keys[at * width..][..width], live)
    }

    /// The fine keys of rows `block * LANES ..`; none where points have none.
    #[inline]
    pub(super) fn fine_block(&self, block: usize) -> &KeyBlock {
        const BLOCKS: usize = CHUNK_ROWS / LANES;
        let fine = &self.chunks[block / BLOCKS].fine;
        fine.get(block % BLOCKS * FINE..).and_then(|fine| fine.get(..FINE)).unwrap_or_default()
    }

    /// The coarse key of a row, which must exist.
    pub(super) fn key(&self, row: usize, key: &mut [f32]) {
        let (block, _) = self.block(row / LANES);
        for (value, lanes) in key.iter_mut().zip(block) {
            *value = lanes[row % LANES];
        }
    }

    /// Numbers in the best key that points have: see [`Key::numbers`].
    pub(super) fn key_numbers(&self) -> usize {
        Key::default().numbers(self.shape.width(), self.shape.has_fine()).count()
    }

    /// The numbers of the best key of a row, which must exist.
    pub(super) fn all_keys(&self, row: usize, into: &mut [f32]) {
        let mut key = Key::default();
        self.key(row, &mut key.coarse);
        for (value, lanes) in key.fine.iter_mut().zip(self.fine_block(row / LANES)) {
            *value = lanes[row % LANES];
        }
        into.iter_mut().zip(key.numbers(self.shape.width(), self.shape.has_fine())).for_each(|(to, from)| *to = from);
    }

    /// The key of a query, for these points.
    pub(super) fn probe(&self, point: &[f32]) -> Probe {
        Probe::new(self.metric, &self.shape, point, self.reach)
    }

    /// Numbers in a key.
    pub(super) fn key_width(&self) -> usize {
        self.shape.width()
    }

    /// The greatest magnitude of any number of a key.
    pub(super) fn magnitude(&self) -> f32 {
        self.magnitude
    }

    /// Equal for points that descend from one another without compaction.
    pub(super) fn lineage(&self) -> u64 {
        self.lineage
    }
}

impl Chunk {
    /// A chunk of these rows, with their greatest norm and the greatest magnitude in their coarse keys.
    fn filled(
        metric: Metric,
        shape: &KeyShape,
        dims: usize,
        ids: &[u64],
        rows: &[f32],
    ) -> Result<(Self, f64, f32), IndexError> {
        let (ids_here, rows_here) = (Vec::with_capacity(ids.len()), Vec::with_capacity(rows.len()));
        let mut chunk = Self { ids: ids_here, rows: rows_here, keys: vec![], fine: vec![] };
        let (mut reach, mut magnitude) = (0.0f64, 0.0f32);
        for (&id, point) in ids.iter().zip(rows.chunks_exact(dims)) {
            check_point(point, dims)?;
            let (r, m) = chunk.push(metric, shape, id, point);
            (reach, magnitude) = (reach.max(r), magnitude.max(m));
        }
        Ok((chunk, reach, magnitude))
    }

    /// Adds a row; returns its norm and the greatest magnitude in its coarse key.
    fn push(&mut self, metric: Metric, shape: &KeyShape, id: u64, point: &[f32]) -> (f64, f32) {
        let width = shape.width();
        let lane = self.ids.len() % LANES;
        let key = shape.key(metric, point);
        if lane == 0 {
            self.keys.resize(self.keys.len() + width, [0.0; LANES]);
            self.fine.resize(self.fine.len() + if shape.has_fine() { FINE } else { 0 }, [0.0; LANES]);
        }
        let (block, mut magnitude) = (self.keys.len() - width, 0.0f32);
        for (numbers, value) in self.keys[block..].iter_mut().zip(key.coarse) {
            numbers[lane] = value;
            magnitude = magnitude.max(value.abs());
        }
        if shape.has_fine() {
            let block = self.fine.len() - FINE;
            self.fine[block..].iter_mut().zip(key.fine).for_each(|(numbers, value)| numbers[lane] = value);
        }
        self.ids.push(id);
        self.rows.extend_from_slice(point);
        (metric.norm(point.iter().copied()), magnitude)
    }
}

/// The first `rows` bits set.
fn all_live(rows: usize) -> Live {
    let mut live = Live::default();
    for (word, bits) in live.iter_mut().enumerate() {
        let here = rows.saturating_sub(word * 64).min(64);
        *bits = if here == 64 { u64::MAX } else { (1 << here) - 1 };
    }
    live
}
