//! [`Points`]: rows that many threads read while one adds and removes.
//!
//! A *row* is a point with an id. Rows are numbered from 0, in ascending order of their ids. A removed row remains as a
//! *tombstone* until the points are compacted. [`Points`] is a value: a clone is a snapshot that shares memory with the
//! original and never changes. Rows are stored in reference-counted chunks of [`CHUNK_ROWS`]. A writer copies the chunk
//! that it changes, and only if a snapshot still shares it, so neither writers nor readers wait for one another.
//!
//! Invariants: ids ascend strictly; every coordinate is finite; all rows have the same number of coordinates.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::IndexError;
use super::lower_bound::{FINE, Key, KeyBlock, KeyLayout, LANES, QueryKey};
use super::query::check_point;
use crate::space::Metric;

/// Rows in a chunk, the unit of sharing between snapshots.
pub const CHUNK_ROWS: usize = 1024;

/// Which rows of a chunk are live: bit `i % 64` of word `i / 64` for row `i` of the chunk.
type Live = [u64; CHUNK_ROWS / 64];

/// Up to [`CHUNK_ROWS`] rows.
#[derive(Clone, Default)]
struct Chunk {
    ids: Vec<u64>,
    /// Coordinates, row by row.
    rows: Vec<f32>,
    /// Coarse keys: `width` arrays for every [`LANES`] rows.
    keys: Vec<[f32; LANES]>,
    /// Fine keys: [`FINE`] arrays for every [`LANES`] rows; empty if there are none.
    fine: Vec<[f32; LANES]>,
}

/// The points of one space with their ids, live ones and tombstones. See the module's documentation.
#[derive(Clone)]
pub struct Points {
    metric: Metric,
    dims: usize,
    layout: Arc<KeyLayout>,
    chunks: Arc<Vec<Arc<Chunk>>>,
    live: Arc<Vec<Arc<Live>>>,
    removed: usize,
    /// The largest norm of a point.
    max_norm: f64,
    /// The largest magnitude of a number of a coarse key.
    magnitude: f32,
    /// Shared by all points that descend from one another without compaction, and so have the same row numbers.
    lineage: u64,
}

fn new_lineage() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

impl Points {
    /// No points, of `dims` coordinates each.
    ///
    /// # Errors
    /// [`IndexError::NoCoordinates`] if `dims` is 0.
    pub fn new(metric: Metric, dims: usize) -> Result<Self, IndexError> {
        Self::empty(metric, dims, KeyLayout::first(dims))
    }

    fn empty(metric: Metric, dims: usize, layout: KeyLayout) -> Result<Self, IndexError> {
        if dims == 0 {
            return Err(IndexError::NoCoordinates);
        }
        Ok(Self {
            metric,
            dims,
            layout: Arc::new(layout),
            chunks: Arc::default(),
            live: Arc::default(),
            removed: 0,
            max_norm: 0.0,
            magnitude: 0.0,
            lineage: new_lineage(),
        })
    }

    /// Points from all their rows: `coordinates` holds the points of `ids`, one after another; ids ascend.
    ///
    /// For many rows this is better than [`Points::push`]: work is shared between threads, and keys are made of the
    /// directions of largest variance, which makes searches faster.
    ///
    /// # Errors
    /// [`IndexError::Length`], [`IndexError::IdOrder`], [`IndexError::Full`], [`IndexError::NoCoordinates`],
    /// [`IndexError::NotFinite`].
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
        let mut points = Self::empty(metric, dims, KeyLayout::learned(metric, dims, coordinates))?;
        let layout = &points.layout;
        let chunks: Vec<(Chunk, f64, f32)> = ids
            .par_chunks(CHUNK_ROWS)
            .zip(coordinates.par_chunks(CHUNK_ROWS * dims))
            .map(|(ids, rows)| Chunk::filled(metric, layout, dims, ids, rows))
            .collect::<Result<_, _>>()?;
        let live = chunks.iter().map(|(chunk, ..)| Arc::new(all_live(chunk.ids.len()))).collect();
        points.live = Arc::new(live);
        points.max_norm = chunks.iter().fold(0.0, |most, &(_, max_norm, _)| most.max(max_norm));
        points.magnitude = chunks.iter().fold(0.0, |most, &(.., magnitude)| most.max(magnitude));
        points.chunks = Arc::new(chunks.into_iter().map(|(chunk, ..)| Arc::new(chunk)).collect());
        Ok(points)
    }

    /// Adds a row. Its id must be larger than all before it, removed ones included.
    ///
    /// # Errors
    /// [`IndexError::Dimensions`], [`IndexError::NotFinite`], [`IndexError::IdOrder`], [`IndexError::Full`].
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
            let (max_norm, magnitude) = Arc::make_mut(chunk).push(self.metric, &self.layout, id, point);
            self.max_norm = self.max_norm.max(max_norm);
            self.magnitude = self.magnitude.max(magnitude);
            Arc::make_mut(live)[at / 64] |= 1 << (at % 64);
        }
        Ok(())
    }

    /// Removes the row with this id: it becomes a tombstone. False if there is no such live row.
    pub fn remove(&mut self, id: u64) -> bool {
        let Some(row) = self.find(id) else { return false };
        let at = row % CHUNK_ROWS;
        Arc::make_mut(&mut Arc::make_mut(&mut self.live)[row / CHUNK_ROWS])[at / 64] &= !(1 << (at % 64));
        self.removed += 1;
        true
    }

    /// A copy of the live rows without tombstones. Row numbers change, so trees must be rebuilt.
    pub fn compacted(&self) -> Self {
        let mut ids = Vec::with_capacity(self.len());
        let mut coordinates = Vec::with_capacity(self.len() * self.dims);
        for (id, point) in self.iter() {
            ids.push(id);
            coordinates.extend_from_slice(point);
        }
        match Self::from_rows(self.metric, self.dims, &ids, &coordinates) {
            Ok(points) => points,
            // Rows that were accepted before are accepted again; if not, nothing is compacted.
            Err(_) => self.clone(),
        }
    }

    /// The metric.
    pub fn metric(&self) -> Metric {
        self.metric
    }

    /// The number of coordinates of a point.
    pub fn dims(&self) -> usize {
        self.dims
    }

    /// The number of live rows.
    pub fn len(&self) -> usize {
        self.rows() - self.removed
    }

    /// Whether no row is live.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The number of rows, tombstones included.
    pub fn rows(&self) -> usize {
        match self.chunks.split_last() {
            Some((last, full)) => full.len() * CHUNK_ROWS + last.ids.len(),
            None => 0,
        }
    }

    /// The number of tombstones.
    pub fn removed(&self) -> usize {
        self.removed
    }

    /// The largest id of a row, live or not.
    pub fn last_id(&self) -> Option<u64> {
        self.chunks.last().and_then(|chunk| chunk.ids.last().copied())
    }

    /// The number of the live row with this id.
    pub fn find(&self, id: u64) -> Option<usize> {
        let chunk = self.chunks.partition_point(|chunk| chunk.ids[0] <= id).checked_sub(1)?;
        let at = self.chunks[chunk].ids.binary_search(&id).ok()?;
        let row = chunk * CHUNK_ROWS + at;
        self.is_live(row).then_some(row)
    }

    /// The point with this id, if it is live.
    pub fn point(&self, id: u64) -> Option<&[f32]> {
        self.find(id).map(|row| self.row(row))
    }

    /// The id and point of every live row, in ascending order of ids.
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

    /// The coarse keys of the rows from `block * LANES` on; bit `i` is set if row `block * LANES + i` exists and is live.
    #[inline]
    pub(super) fn block(&self, block: usize) -> (&KeyBlock, u32) {
        const BLOCKS: usize = CHUNK_ROWS / LANES;
        let width = self.layout.width();
        let (chunk, at) = (block / BLOCKS, block % BLOCKS);
        let word = self.live[chunk][at * LANES / 64];
        let live = (word >> (at * LANES % 64)) as u32 & ((1 << LANES) - 1);
        (&self.chunks[chunk].keys[at * width..][..width], live)
    }

    /// The fine keys of the rows from `block * LANES` on; empty if points have none.
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

    /// The number of numbers in the longest key: see [`Key::numbers`].
    pub(super) fn key_numbers(&self) -> usize {
        Key::default().numbers(self.layout.width(), self.layout.has_fine()).count()
    }

    /// The numbers of the longest key of a row, which must exist.
    pub(super) fn long_key(&self, row: usize, into: &mut [f32]) {
        let mut key = Key::default();
        self.key(row, &mut key.coarse);
        for (value, lanes) in key.fine.iter_mut().zip(self.fine_block(row / LANES)) {
            *value = lanes[row % LANES];
        }
        into.iter_mut().zip(key.numbers(self.layout.width(), self.layout.has_fine())).for_each(|(to, from)| *to = from);
    }

    /// The key of a query for these points.
    pub(super) fn query_key(&self, point: &[f32]) -> QueryKey {
        QueryKey::new(self.metric, &self.layout, point, self.max_norm)
    }

    /// The number of numbers in a coarse key.
    pub(super) fn key_width(&self) -> usize {
        self.layout.width()
    }

    /// The largest magnitude of a number of a coarse key.
    pub(super) fn magnitude(&self) -> f32 {
        self.magnitude
    }

    /// Equal for points that descend from one another without compaction, which have the same row numbers.
    pub(super) fn lineage(&self) -> u64 {
        self.lineage
    }
}

impl Chunk {
    /// A chunk of these rows, their largest norm, and the largest magnitude in their coarse keys.
    fn filled(
        metric: Metric,
        layout: &KeyLayout,
        dims: usize,
        ids: &[u64],
        rows: &[f32],
    ) -> Result<(Self, f64, f32), IndexError> {
        let (ids_here, rows_here) = (Vec::with_capacity(ids.len()), Vec::with_capacity(rows.len()));
        let mut chunk = Self { ids: ids_here, rows: rows_here, keys: vec![], fine: vec![] };
        let (mut max_norm, mut magnitude) = (0.0f64, 0.0f32);
        for (&id, point) in ids.iter().zip(rows.chunks_exact(dims)) {
            check_point(point, dims)?;
            let (r, m) = chunk.push(metric, layout, id, point);
            (max_norm, magnitude) = (max_norm.max(r), magnitude.max(m));
        }
        Ok((chunk, max_norm, magnitude))
    }

    /// Adds a row; returns its norm and the largest magnitude in its coarse key.
    fn push(&mut self, metric: Metric, layout: &KeyLayout, id: u64, point: &[f32]) -> (f64, f32) {
        let width = layout.width();
        let lane = self.ids.len() % LANES;
        let key = layout.key(metric, point);
        if lane == 0 {
            self.keys.resize(self.keys.len() + width, [0.0; LANES]);
            self.fine.resize(self.fine.len() + if layout.has_fine() { FINE } else { 0 }, [0.0; LANES]);
        }
        let (block, mut magnitude) = (self.keys.len() - width, 0.0f32);
        for (numbers, value) in self.keys[block..].iter_mut().zip(key.coarse) {
            numbers[lane] = value;
            magnitude = magnitude.max(value.abs());
        }
        if layout.has_fine() {
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
