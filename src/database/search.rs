//! Spaces in memory: their points and indexes, kept up with the store.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, RwLock};

use rayon::prelude::*;

use super::{Database, held, spaces};
use crate::error::Error;
use crate::hlac::View;
use crate::index::{Index, KdTree, Method, Metric, Points};
use crate::space::{self, Recipe, Space};
use crate::store::{
    DESCRIPTOR_ROWS, Damage, DescriptorBlock, Reads, Rows, Snapshot, StoreError, ViewCode, point_rows_per_block,
};

/// A space's points as of one revision of the store. It never changes: a query sees one state.
pub(crate) struct SpaceState {
    revision: u64,
    /// The space that made the points.
    pub(crate) space: Arc<Space>,
    /// The points of all textures that have one.
    pub(crate) index: Index,
    /// Questions asked of this state and those before it: a tree is built once it is worth it.
    asked: Arc<AtomicU64>,
}

/// The newest state of each space that was asked for. Shared with the threads that build trees.
#[derive(Default)]
pub(super) struct SpaceStates(RwLock<BTreeMap<String, Arc<SpaceState>>>);

impl SpaceStates {
    fn get(&self, name: &str) -> Option<Arc<SpaceState>> {
        held(self.0.read()).get(name).cloned()
    }

    fn put(&self, name: &str, state: &Arc<SpaceState>) {
        held(self.0.write()).insert(name.to_owned(), Arc::clone(state));
    }

    /// Gives the newest state of a space a tree that was built over an earlier one of the same points.
    fn install(&self, name: &str, tree: Arc<KdTree>) {
        let mut states = held(self.0.write());
        if let Some(state) = states.get_mut(name) {
            let mut index = state.index.clone();
            if index.install(tree) {
                let (space, asked) = (Arc::clone(&state.space), Arc::clone(&state.asked));
                *state = Arc::new(SpaceState { revision: state.revision, space, index, asked });
            }
        }
    }
}

impl SpaceState {
    /// The revision of the store whose points these are.
    pub(crate) fn revision(&self) -> u64 {
        self.revision
    }

    /// The metric of the space.
    pub(crate) fn metric(&self) -> Metric {
        metric(&self.space)
    }
}

/// The index's word for a space's metric.
pub(super) fn metric(space: &Space) -> Metric {
    match space.metric() {
        space::Metric::L2 => Metric::L2,
        space::Metric::L1 => Metric::L1,
    }
}

/// A texture's id and its point.
pub type IdPoint = (u64, Vec<f32>);

/// Fewer questions than this are answered by the scan alone: a tree would cost more than it saves.
const QUESTIONS_WORTH_A_TREE: u64 = 8;

impl Database {
    /// The state of a space at the revision of `snapshot`, or a later one.
    ///
    /// Where only few textures came or went since the last question, the points are brought up to date; else they are
    /// loaded.
    pub(crate) fn state(&self, snapshot: &Snapshot, name: &str) -> Result<Arc<SpaceState>, Error> {
        let current = |state: &Arc<SpaceState>| state.revision >= snapshot.revision();
        if let Some(state) = self.spaces.get(name).filter(current) {
            return Ok(state);
        }
        let _building = held(self.building.lock());
        let known = self.spaces.get(name);
        if let Some(state) = known.clone().filter(current) {
            return Ok(state);
        }
        let space = Arc::new(spaces::load(snapshot, name)?);
        let same = known.filter(|state| state.space.epoch() == space.epoch() && state.space == space);
        let state = Arc::new(match same {
            Some(state) => advanced(&state, snapshot, name)?,
            None => loaded(snapshot, name, space)?,
        });
        self.spaces.put(name, &state);
        Ok(state)
    }

    /// The state with a tree, where `method` or the number of questions asks for one.
    ///
    /// By name (`kdtree`), the tree is built before the question is answered. By itself, it is built on a thread of its
    /// own once a few questions were asked, and questions are answered by the scan meanwhile.
    pub(crate) fn with_tree(
        &self,
        state: Arc<SpaceState>,
        name: &str,
        method: Method,
        questions: u64,
    ) -> Arc<SpaceState> {
        let asked = state.asked.fetch_add(questions, Ordering::Relaxed) + questions;
        if !state.index.should_rebuild() && (state.index.covered() > 0 || method != Method::KdTree) {
            return state;
        }
        match method {
            Method::Linear => {}
            Method::KdTree => {
                let mut index = state.index.clone();
                index.rebuild();
                let (space, asked) = (Arc::clone(&state.space), Arc::clone(&state.asked));
                let state = Arc::new(SpaceState { revision: state.revision, space, index, asked });
                self.spaces.put(name, &state);
                return state;
            }
            Method::Auto if asked >= QUESTIONS_WORTH_A_TREE => {
                // Counting from far below, so that no second build begins while this one runs.
                state.asked.store(0, Ordering::Relaxed);
                let (states, name, points) = (Arc::clone(&self.spaces), name.to_owned(), state.index.points().clone());
                std::thread::spawn(move || {
                    if let Some(tree) = KdTree::build(&points) {
                        states.install(&name, Arc::new(tree));
                    }
                });
            }
            Method::Auto => {}
        }
        state
    }

    /// The metric of a space and the points of some textures in it, in the order of `ids`; a texture without a point is
    /// left out.
    ///
    /// # Errors
    /// [`Error::NoSuchSpace`], [`Error::Store`].
    pub fn points_of(&self, space: &str, ids: impl IntoIterator<Item = u64>) -> Result<(Metric, Vec<IdPoint>), Error> {
        let state = self.state(&self.store().read()?, space)?;
        let points = ids.into_iter().filter_map(|id| Some((id, state.index.points().point(id)?.to_vec())));
        Ok((state.metric(), points.collect()))
    }
}

/// The points of every texture, from nothing.
fn loaded(snapshot: &Snapshot, name: &str, space: Arc<Space>) -> Result<SpaceState, Error> {
    let rows = snapshot.rows()?;
    let (ids, coordinates) = points_from(snapshot, name, &space, &rows, 0)?;
    let points = Points::from_rows(metric(&space), space.dims(), &ids, &coordinates)?;
    let index = Index::from_points(points);
    Ok(SpaceState { revision: snapshot.revision(), space, index, asked: Arc::default() })
}

/// The points of an earlier state, with what was removed and added since.
fn advanced(state: &SpaceState, snapshot: &Snapshot, name: &str) -> Result<SpaceState, Error> {
    let rows = snapshot.rows()?;
    let mut index = state.index.clone();
    let gone: Vec<u64> = index.points().iter().map(|(id, _)| id).filter(|&id| rows.row_of(id).is_none()).collect();
    for id in gone {
        index.remove(id);
    }
    let first_new = index.points().last_id().map_or(0, |last| rows.ids().partition_point(|&id| id <= last));
    let (ids, coordinates) = points_from(snapshot, name, &state.space, &rows, first_new)?;
    for (&id, point) in ids.iter().zip(coordinates.chunks_exact(state.space.dims().max(1))) {
        index.push(id, point)?;
    }
    let (space, asked) = (Arc::clone(&state.space), Arc::clone(&state.asked));
    Ok(SpaceState { revision: snapshot.revision(), space, index, asked })
}

/// Ids and points, row-major, of the live rows from `first` on that have a point: kept ones as they are, others mapped.
fn points_from(
    snapshot: &Snapshot,
    name: &str,
    space: &Space,
    rows: &Rows,
    first: usize,
) -> Result<(Vec<u64>, Vec<f32>), Error> {
    let (mut ids, mut coordinates) = (Vec::new(), Vec::new());
    let mut take = |row: usize, point: &[f32]| {
        if let Some(&id) = rows.ids().get(row).filter(|_| rows.is_live(row))
            && point.iter().all(|coordinate| coordinate.is_finite())
        {
            ids.push(id);
            coordinates.extend_from_slice(point);
        }
    };
    let kept = kept_points(snapshot, name, space, first, &mut take)?;
    for (row, point) in mapped_points(snapshot, space, kept.max(first)..rows.len())? {
        take(row, &point);
    }
    Ok((ids, coordinates))
}

/// Hands over the kept points of the rows from `first` on; returns the first row whose point is not kept.
pub(super) fn kept_points(
    snapshot: &Snapshot,
    name: &str,
    space: &Space,
    first: usize,
    take: &mut impl FnMut(usize, &[f32]),
) -> Result<usize, Error> {
    let Some(layout) = snapshot.points_layout(name)? else { return Ok(0) };
    if layout.widths.iter().map(|&width| usize::from(width)).sum::<usize>() != space.dims() {
        return Ok(0);
    }
    let kept = layout.rows as usize;
    // Parts have blocks of different lengths: each part is read as a stream of rows.
    let mut parts: Vec<PartRows<'_>> = (0..layout.widths.len() as u8)
        .map(|part| PartRows { snapshot, name, layout: &layout, part, block: None, values: Vec::new() })
        .collect();
    let mut point = Vec::with_capacity(space.dims());
    for row in first..kept {
        point.clear();
        for part in &mut parts {
            point.extend_from_slice(part.row(row)?);
        }
        take(row, &point);
    }
    Ok(kept)
}

/// One part of the kept points, read block by block.
struct PartRows<'a> {
    snapshot: &'a Snapshot,
    name: &'a str,
    layout: &'a crate::store::PointsLayout,
    part: u8,
    block: Option<u32>,
    values: Vec<f32>,
}

impl PartRows<'_> {
    fn row(&mut self, row: usize) -> Result<&[f32], Error> {
        let width = self.layout.widths.get(usize::from(self.part)).map_or(1, |&width| usize::from(width));
        let per_block = point_rows_per_block(width);
        let block = (row / per_block) as u32;
        if self.block != Some(block) {
            self.values = self.snapshot.points(self.name, self.layout, self.part, block)?;
            self.block = Some(block);
        }
        let at = row % per_block * width;
        let missing = || {
            StoreError::Damage(Damage {
                table: "points",
                key: format!("space {}, block {block}", self.name),
                what: "a row is missing".into(),
            })
        };
        Ok(self.values.get(at..at + width).ok_or_else(missing)?)
    }
}

/// Row and point of those rows of a range that have a point, mapped from their moments by `space`.
pub(super) fn mapped_points(
    state: &impl Reads,
    space: &Space,
    rows: std::ops::Range<usize>,
) -> Result<Vec<(usize, Vec<f32>)>, Error> {
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let mut mapped = Vec::with_capacity(rows.len());
    for block in rows.start / DESCRIPTOR_ROWS..rows.end.div_ceil(DESCRIPTOR_ROWS) {
        let moments = BlockMoments::read(state, space.recipe(), block as u32)?;
        let first = block * DESCRIPTOR_ROWS;
        let within = first.max(rows.start)..(first + DESCRIPTOR_ROWS).min(rows.end);
        let points: Result<Vec<_>, Error> = within
            .into_par_iter()
            .filter_map(|row| Some(moments.point(space, row - first).transpose()?.map(|point| (row, point))))
            .collect();
        mapped.extend(points?);
    }
    Ok(mapped)
}

/// The moments of one block of rows in the views of a recipe.
pub(super) struct BlockMoments {
    views: Vec<(View, Option<DescriptorBlock>)>,
}

impl BlockMoments {
    pub(super) fn read(state: &impl Reads, recipe: &Recipe, block: u32) -> Result<Self, Error> {
        let read = |&view: &View| Ok((view, state.descriptors(ViewCode(view.code()), block)?));
        Ok(Self { views: recipe.views().iter().map(read).collect::<Result<_, Error>>()? })
    }

    /// The moments of a row of the block in a view.
    pub(super) fn row(&self, view: View, row: usize) -> Option<&[f32; crate::hlac::MASK_COUNT]> {
        self.views.iter().find(|(other, _)| *other == view)?.1.as_ref()?.row(row)
    }

    /// The point of a row of the block; `None` where it has none of the views.
    fn point(&self, space: &Space, row: usize) -> Result<Option<Vec<f32>>, Error> {
        let recipe = space.recipe();
        if recipe.views().iter().all(|&view| self.row(view, row).is_none()) {
            return Ok(None);
        }
        Ok(Some(space.point(&recipe.features(|view| self.row(view, row))?)?))
    }
}
