//! Points and moments as the store keeps them, block by block.
//!
//! The points of the default space are kept in two parts, so that a cold question reads few bytes: the *keys* of all rows
//! (leading coordinates and the norm of the rest, see [`crate::index::key`]), and the coordinates that are not in the key.

use rayon::prelude::*;

use crate::error::Error;
use crate::hlac::View;
use crate::index::{key, key_leading, key_width};
use crate::space::{Recipe, Space};
use crate::store::{
    DESCRIPTOR_ROWS, Damage, DescriptorBlock, PointsLayout, Reads, StoreError, Transaction, ViewCode,
    point_rows_per_block,
};

/// The part that holds keys, and the one that holds the coordinates beside them.
const KEYS: u8 = 0;
const REST: u8 = 1;

/// The widths of the parts that points of `dims` coordinates are kept in.
fn widths(dims: usize) -> Vec<u16> {
    let widths = [key_width(dims), dims - key_leading(dims)];
    widths.into_iter().filter(|&width| width > 0).map(|width| width as u16).collect()
}

/// The kept points of a space.
pub(super) struct KeptPoints<'a, R> {
    state: &'a R,
    name: &'a str,
    dims: usize,
    layout: PointsLayout,
}

impl<'a, R: Reads> KeptPoints<'a, R> {
    /// Those of a space; `None` where none are kept, or not in the way of this version.
    pub(super) fn of(state: &'a R, name: &'a str, space: &Space) -> Result<Option<Self>, Error> {
        let dims = space.dims();
        let layout = state.points_layout(name)?.filter(|layout| layout.widths == widths(dims));
        Ok(layout.map(|layout| Self { state, name, dims, layout }))
    }

    /// How many rows are kept; those of textures added since are not.
    pub(super) fn rows(&self) -> usize {
        self.layout.rows as usize
    }

    /// Rows of a block of keys.
    pub(super) fn key_rows(&self) -> usize {
        point_rows_per_block(key_width(self.dims))
    }

    /// The keys of the rows from `block * key_rows()` on.
    pub(super) fn keys(&self, block: u32) -> Result<Vec<f32>, Error> {
        Ok(self.state.points(self.name, &self.layout, KEYS, block)?)
    }

    /// A reader of the coordinates beside the keys; of none where the key is the point.
    pub(super) fn rest(&self) -> PartRows<'_, R> {
        self.part(REST)
    }

    fn part(&self, part: u8) -> PartRows<'_, R> {
        let width = self.layout.widths.get(usize::from(part)).map_or(0, |&width| usize::from(width));
        PartRows { kept: self, part, width, blocks: Vec::new() }
    }

    /// Hands over row, key and point of the rows from `first` on.
    pub(super) fn each(&self, first: usize, mut take: impl FnMut(usize, &[f32], &[f32])) -> Result<(), Error> {
        // Parts have blocks of different lengths: each part is read as a stream of rows.
        let (mut keys, mut rest) = (self.part(KEYS), self.part(REST));
        let leading = key_leading(self.dims);
        let mut point = Vec::with_capacity(self.dims);
        for row in first..self.rows() {
            point.clear();
            let key = keys.row(row)?;
            point.extend(key.iter().take(leading));
            point.extend_from_slice(rest.row(row)?);
            take(row, key, &point);
        }
        Ok(())
    }

    /// The point of a row; NaN where it has none.
    pub(super) fn point(&self, row: usize) -> Result<Vec<f32>, Error> {
        let mut point = self.part(KEYS).row(row)?.to_vec();
        point.truncate(key_leading(self.dims));
        point.extend_from_slice(self.part(REST).row(row)?);
        Ok(point)
    }
}

/// So many blocks of one part are held in memory: 16 MiB.
const HELD: usize = 64;

/// One part of the kept points. The blocks read last are held.
pub(super) struct PartRows<'a, R> {
    kept: &'a KeptPoints<'a, R>,
    part: u8,
    width: usize,
    /// The block read last at the end.
    blocks: Vec<(u32, Vec<f32>)>,
}

impl<R: Reads> PartRows<'_, R> {
    /// The numbers of a row; none for a part that is not there.
    pub(super) fn row(&mut self, row: usize) -> Result<&[f32], Error> {
        if self.width == 0 {
            return Ok(&[]);
        }
        let per_block = point_rows_per_block(self.width);
        let block = (row / per_block) as u32;
        let KeptPoints { state, name, layout, .. } = self.kept;
        match self.blocks.iter().rposition(|(number, _)| *number == block) {
            Some(at) if at + 1 == self.blocks.len() => {}
            Some(at) => {
                let found = self.blocks.remove(at);
                self.blocks.push(found);
            }
            None => {
                if self.blocks.len() >= HELD {
                    self.blocks.remove(0);
                }
                self.blocks.push((block, state.points(name, layout, self.part, block)?));
            }
        }
        let at = row % per_block * self.width;
        let values = self.blocks.last().and_then(|(_, values)| values.get(at..at + self.width));
        Ok(values.ok_or_else(|| {
            let key = format!("space {name}, block {block}");
            StoreError::Damage(Damage { table: "points", key, what: "a row is missing".into() })
        })?)
    }
}

/// Keeps the points of a space of every row that has none yet.
pub(super) fn keep_points(transaction: &mut Transaction, name: &str, space: &Space) -> Result<(), Error> {
    let dims = space.dims();
    let (leading, width) = (key_leading(dims), key_width(dims));
    if transaction.points_layout(name)?.is_none_or(|layout| layout.widths != widths(dims)) {
        transaction.begin_points(name, &widths(dims))?;
    }
    let rows = transaction.counts().rows as usize;
    let mut next = transaction.points_layout(name)?.map_or(0, |layout| layout.rows as usize);
    // Some blocks at a time, so that a million rows take little memory.
    while next < rows {
        let end = ((next / DESCRIPTOR_ROWS + 16) * DESCRIPTOR_ROWS).min(rows);
        let mut keys = vec![f32::NAN; (end - next) * width];
        let mut rest = vec![f32::NAN; (end - next) * (dims - leading)];
        for (row, point) in mapped_points(transaction, space, next..end)? {
            let at = row - next;
            copy(&mut keys, at * width, &key(space.metric(), &point));
            copy(&mut rest, at * (dims - leading), point.get(leading..).unwrap_or_default());
        }
        let parts: Vec<&[f32]> = if dims > leading { vec![&keys, &rest] } else { vec![&keys] };
        transaction.append_points(name, &parts)?;
        next = end;
    }
    Ok(())
}

fn copy(into: &mut [f32], at: usize, values: &[f32]) {
    if let Some(place) = into.get_mut(at..at + values.len()) {
        place.copy_from_slice(values);
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
