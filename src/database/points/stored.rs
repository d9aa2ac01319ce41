//! Points and moments as they are stored, block by block.
//!
//! The points of the default space are stored in two parts, so that a query from the file reads few bytes: as *codes* of one
//! byte per coordinate (see [`crate::index::quantise`]), and in full. To the store both are parts of 4-byte numbers: four codes
//! make one number.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::error::Error;
use crate::hlac::View;
use crate::index::{NO_POINT, quantise};
use crate::space::{FeatureSet, Space};
use crate::store::{
    DESCRIPTOR_ROWS, Damage, DamageKey, DescriptorBlock, PointsLayout, Reads, StoreError, Transaction, ViewCode,
    point_rows_per_block,
};

/// The parts with codes and with points.
const CODES: u8 = 0;
const POINTS: u8 = 1;

/// The number of codes in a number.
const PACKED: usize = 4;

/// The widths of the parts for points of `dims` coordinates.
fn widths(dims: usize) -> [u16; 2] {
    [dims.div_ceil(PACKED) as u16, dims as u16]
}

/// Codes as the store holds them, four in a number; the rest of the last number is 0.
fn pack(codes: impl Iterator<Item = i8>) -> Vec<f32> {
    let bytes: Vec<u8> = codes.map(i8::cast_unsigned).collect();
    let number = |four: &[u8]| {
        let mut bytes = [0; PACKED];
        bytes.iter_mut().zip(four).for_each(|(byte, &code)| *byte = code);
        f32::from_le_bytes(bytes)
    };
    bytes.chunks(PACKED).map(number).collect()
}

/// The stored points of a space.
pub(crate) struct StoredPoints<'a, R> {
    state: &'a R,
    name: &'a str,
    dims: usize,
    layout: PointsLayout,
}

impl<'a, R: Reads> StoredPoints<'a, R> {
    /// The stored points of a space; `None` if there are none, or if they have another layout.
    pub(crate) fn of(state: &'a R, name: &'a str, space: &Space) -> Result<Option<Self>, Error> {
        let dims = space.dims();
        let layout = state.points_layout(name)?.filter(|layout| layout.widths == widths(dims));
        Ok(layout.map(|layout| Self { state, name, dims, layout }))
    }

    /// The number of rows with stored points.
    pub(crate) fn rows(&self) -> usize {
        self.layout.rows as usize
    }

    /// The number of rows in a block of codes.
    pub(crate) fn code_rows(&self) -> usize {
        point_rows_per_block(self.dims.div_ceil(PACKED))
    }

    /// The codes of the rows from `block * code_rows()` on, packed in numbers; see [`unpacked`].
    pub(crate) fn codes(&self, block: u32) -> Result<Vec<f32>, Error> {
        Ok(self.state.points(self.name, &self.layout, CODES, block)?)
    }

    /// The number of bytes from the codes of a row to those of the next.
    pub(crate) fn stride(&self) -> usize {
        self.dims.div_ceil(PACKED) * PACKED
    }

    /// A reader of points.
    pub(crate) fn points(&self) -> PartRows<'_, R> {
        self.part(POINTS)
    }

    fn part(&self, part: u8) -> PartRows<'_, R> {
        let width = self.layout.widths.get(usize::from(part)).map_or(0, |&width| usize::from(width));
        PartRows { stored: self, part, width, most: CACHED_BLOCKS, blocks: Vec::new() }
    }

    /// A reader of points with their codes, for rows in ascending order: it holds one block of each in memory.
    pub(crate) fn checked_rows(&self) -> CheckedRows<'_, R> {
        let in_order = |part| PartRows { most: 1, ..self.part(part) };
        CheckedRows { codes: in_order(CODES), points: in_order(POINTS) }
    }

    /// Calls `take` with each row from `first` on and its point, which is NaN if the row has none.
    pub(crate) fn each(&self, first: usize, mut take: impl FnMut(usize, &[f32])) -> Result<(), Error> {
        let mut points = self.part(POINTS);
        for row in first..self.rows() {
            take(row, points.row(row)?);
        }
        Ok(())
    }
}

/// Packed codes, one after the other. On little-endian machines the numbers are reinterpreted.
pub(crate) fn unpacked(numbers: &[f32]) -> Cow<'_, [i8]> {
    if cfg!(target_endian = "little") {
        Cow::Borrowed(bytemuck::cast_slice(numbers))
    } else {
        unpack(numbers).collect()
    }
}

fn unpack(numbers: &[f32]) -> impl Iterator<Item = i8> + '_ {
    numbers.iter().flat_map(|number| number.to_le_bytes()).map(u8::cast_signed)
}

/// The number of blocks of one part that are cached: 32 MiB.
const CACHED_BLOCKS: usize = 128;

/// Points with their codes.
pub(crate) struct CheckedRows<'a, R> {
    codes: PartRows<'a, R>,
    points: PartRows<'a, R>,
}

impl<R: Reads> CheckedRows<'_, R> {
    /// The point of a row, and whether its code is that of the point; `None` if the row has no point.
    pub(crate) fn row(&mut self, row: usize) -> Result<Option<(&[f32], bool)>, Error> {
        let point = self.points.row(row)?;
        if !point.iter().all(|coordinate| coordinate.is_finite()) {
            return Ok(None);
        }
        let coded = unpack(self.codes.row(row)?).take(point.len()).eq(quantise(point));
        Ok(Some((point, coded)))
    }
}

/// One part of the stored points. The blocks read last are cached.
pub(crate) struct PartRows<'a, R> {
    stored: &'a StoredPoints<'a, R>,
    part: u8,
    width: usize,
    /// The number of blocks that are cached.
    most: usize,
    /// The block read last at the end.
    blocks: Vec<(u32, Vec<f32>)>,
}

impl<R: Reads> PartRows<'_, R> {
    /// The numbers of a row.
    pub(crate) fn row(&mut self, row: usize) -> Result<&[f32], Error> {
        let per_block = point_rows_per_block(self.width.max(1));
        let block = (row / per_block) as u32;
        let StoredPoints { state, name, layout, .. } = self.stored;
        match self.blocks.iter().rposition(|(number, _)| *number == block) {
            Some(at) if at + 1 == self.blocks.len() => {}
            Some(at) => {
                let found = self.blocks.remove(at);
                self.blocks.push(found);
            }
            None => {
                if self.blocks.len() >= self.most {
                    self.blocks.remove(0);
                }
                self.blocks.push((block, state.points(name, layout, self.part, block)?));
            }
        }
        let at = row % per_block * self.width;
        let values = self.blocks.last().and_then(|(_, values)| values.get(at..at + self.width));
        Ok(values.ok_or_else(|| {
            let key = DamageKey::PointBlock { space: name.to_string(), part: self.part, block };
            StoreError::Damage(Damage::new("points", key, "a row is missing"))
        })?)
    }
}

/// Stores the points of a space for all rows that have none yet.
pub(crate) fn store_points(transaction: &mut Transaction, name: &str, space: &Space) -> Result<(), Error> {
    let dims = space.dims();
    if transaction.points_layout(name)?.is_none_or(|layout| layout.widths != widths(dims)) {
        transaction.begin_points(name, &widths(dims))?;
    }
    let no_codes = pack(std::iter::repeat_n(NO_POINT, dims));
    let rows = transaction.counts().rows as usize;
    let mut next = transaction.points_layout(name)?.map_or(0, |layout| layout.rows as usize);
    // A few blocks at a time, so that a million rows take little memory.
    while next < rows {
        let end = ((next / DESCRIPTOR_ROWS + 16) * DESCRIPTOR_ROWS).min(rows);
        let mut coded: Vec<f32> = no_codes.repeat(end - next);
        let mut points = vec![f32::NAN; (end - next) * dims];
        for (row, point) in mapped_points(transaction, space, next..end)? {
            let at = row - next;
            copy(&mut coded, at * no_codes.len(), &pack(quantise(&point)));
            copy(&mut points, at * dims, &point);
        }
        transaction.append_points(name, &[&coded, &points])?;
        next = end;
    }
    Ok(())
}

fn copy(into: &mut [f32], at: usize, values: &[f32]) {
    if let Some(place) = into.get_mut(at..at + values.len()) {
        place.copy_from_slice(values);
    }
}

/// The rows of a range that have a point, with their points, mapped from their moments by `space`.
pub(crate) fn mapped_points(
    state: &impl Reads,
    space: &Space,
    rows: std::ops::Range<usize>,
) -> Result<Vec<(usize, Vec<f32>)>, Error> {
    if rows.is_empty() {
        return Ok(Vec::new());
    }
    let mut mapped = Vec::with_capacity(rows.len());
    for block in rows.start / DESCRIPTOR_ROWS..rows.end.div_ceil(DESCRIPTOR_ROWS) {
        let moments = BlockMoments::read(state, space.feature_set(), block as u32)?;
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

/// The moments of one block of rows in the views of a feature set.
pub(crate) struct BlockMoments {
    views: Vec<(View, Option<DescriptorBlock>)>,
}

impl BlockMoments {
    pub(crate) fn read(state: &impl Reads, feature_set: &FeatureSet, block: u32) -> Result<Self, Error> {
        let read = |&view: &View| Ok((view, state.descriptors(ViewCode(view.code()), block)?));
        Ok(Self { views: feature_set.views().iter().map(read).collect::<Result<_, Error>>()? })
    }

    /// The moments of a row of the block in a view.
    pub(crate) fn row(&self, view: View, row: usize) -> Option<&[f32; crate::hlac::MASK_COUNT]> {
        self.views.iter().find(|(other, _)| *other == view)?.1.as_ref()?.row(row)
    }

    /// The point of a row of the block; `None` if it has none of the views.
    fn point(&self, space: &Space, row: usize) -> Result<Option<Vec<f32>>, Error> {
        let feature_set = space.feature_set();
        if feature_set.views().iter().all(|&view| self.row(view, row).is_none()) {
            return Ok(None);
        }
        Ok(Some(space.point(&feature_set.features_from(|view| self.row(view, row))?)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packed_codes_are_unpacked() {
        for dims in 1..40 {
            let all: Vec<i8> = (0..dims).map(|at| (at as i8).wrapping_mul(37).wrapping_sub(100)).collect();
            let packed = pack(all.iter().copied());
            assert_eq!(packed.len(), usize::from(widths(dims)[0]));
            assert_eq!(unpack(&packed).take(dims).collect::<Vec<_>>(), all);
            assert_eq!(unpacked(&packed)[..dims], all);
        }
        assert_eq!(pack([1, 2, -1].into_iter())[0].to_bits(), 0x00FF_0201);
    }
}
