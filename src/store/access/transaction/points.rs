//! Points of a space in a transaction: begun with a layout, appended row by row, dropped as a whole.

use super::Transaction;
use super::checks::check_name;
use crate::store::access::reads::{Reads, sealed::Source as _};
use crate::store::access::tables::WriteTable;
use crate::store::access::values;
use crate::store::error::StoreError;
use crate::store::format::keys;
use crate::store::format::points::{self, MAX_POINT_WIDTH, PointsLayout, point_rows_per_block};
use crate::store::format::tables::POINTS;

impl Transaction {
    /// Begins new points of `space`: earlier points are removed, no row is written, and each part has the given width.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] for a malformed name, no part, more than 256 parts, or a width that is 0 or above
    /// [`MAX_POINT_WIDTH`].
    pub fn begin_points(&mut self, space: &str, widths: &[u16]) -> Result<(), StoreError> {
        check_name(space)?;
        let valid = |&width: &u16| (1..=MAX_POINT_WIDTH).contains(&usize::from(width));
        if !(1..=256).contains(&widths.len()) || !widths.iter().all(valid) {
            return Err(StoreError::invalid(format!("points with the widths {widths:?} cannot be stored")));
        }
        self.drop_points(space)?;
        self.writing(|this| this.put_layout(space, &PointsLayout { widths: widths.to_vec(), rows: 0 }))
    }

    /// Appends the points of the next rows: for each part row-major coordinates, the same number of rows in each part. A
    /// texture without a point and a tombstone have a row too, by convention of NaN.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] if the points were not begun, parts or lengths do not match the layout, or there would be
    /// more rows than the store has.
    pub fn append_points(&mut self, space: &str, parts: &[&[f32]]) -> Result<(), StoreError> {
        let Some(mut layout) = self.points_layout(space)? else {
            return Err(StoreError::invalid(format!("the points of space {space} have not been begun")));
        };
        let rows = match (parts.first(), layout.widths.first()) {
            (Some(part), Some(&width)) => part.len() / usize::from(width),
            _ => 0,
        };
        let fits = |(part, &width): (&&[f32], &u16)| part.len() == rows * usize::from(width);
        if parts.len() != layout.widths.len() || !parts.iter().zip(&layout.widths).all(fits) {
            let what = format!("the points do not match the widths {:?} of space {space}", layout.widths);
            return Err(StoreError::invalid(what));
        }
        if layout.rows + rows as u64 > self.state.rows {
            let (before, all) = (layout.rows, self.state.rows);
            return Err(StoreError::invalid(format!("{before} and {rows} points are more than the {all} rows")));
        }
        self.writing(|this| {
            for (part, number) in parts.iter().zip(0..) {
                this.append_part(space, number, &layout, part)?;
            }
            layout.rows += rows as u64;
            this.put_layout(space, &layout)
        })
    }

    /// Removes the points of `space`, if there are any; the space stays.
    ///
    /// # Errors
    /// [`StoreError::Damage`], [`StoreError::Engine`].
    pub fn drop_points(&mut self, space: &str) -> Result<(), StoreError> {
        self.writing(|this| {
            this.buffer.points.retain(|(name, _), _| name != space);
            let prefix = points::layout_key(space);
            let mut table = WriteTable::open(&this.transaction, POINTS)?;
            match &keys::after(&prefix) {
                Some(end) => table.remove_range(&prefix[..]..&end[..]),
                None => table.remove_range(&prefix[..]..),
            }
        })
    }

    pub(in crate::store) fn put_layout(&self, space: &str, layout: &PointsLayout) -> Result<(), StoreError> {
        let (key, value) = layout.seal(space);
        self.insert(POINTS, &*key, &*value)
    }

    pub(in crate::store) fn put_point_block(
        &self,
        space: &str,
        part: u8,
        block: u32,
        width: usize,
        values: &[f32],
    ) -> Result<(), StoreError> {
        let (key, value) = points::seal_block(space, part, block, width, values);
        self.insert(POINTS, &*key, &*value)
    }

    /// Writes the point blocks of the buffer.
    pub(in crate::store) fn flush_points(&mut self) -> Result<(), StoreError> {
        let blocks = std::mem::take(&mut self.buffer.points);
        blocks.into_iter().try_for_each(|((space, part), (block, values))| {
            let layout = self.points_layout(&space)?;
            let width = layout.and_then(|layout| layout.widths.get(usize::from(part)).copied()).unwrap_or(1);
            self.put_point_block(&space, part, block, usize::from(width), &values)
        })
    }

    /// Appends rows to one part. Full blocks are written, the last one stays in the buffer.
    fn append_part(&mut self, space: &str, part: u8, layout: &PointsLayout, values: &[f32]) -> Result<(), StoreError> {
        let width = usize::from(layout.widths.get(usize::from(part)).copied().unwrap_or(1));
        let full = point_rows_per_block(width);
        let key = (space.to_owned(), part);
        let mut rest = values;
        let mut row = layout.rows;
        while !rest.is_empty() {
            let block = (row / full as u64) as u32;
            let before = (row % full as u64) as usize;
            let mut rows = match self.buffer.points.remove(&key) {
                Some((number, rows)) if number == block => rows,
                _ if before > 0 => values::point_block(self.tables(), space, layout, part, block)?,
                _ => Vec::new(),
            };
            let taken = (full - before).min(rest.len() / width);
            let (now, later) = rest.split_at_checked(taken * width).unwrap_or((rest, &[]));
            rows.extend_from_slice(now);
            rest = later;
            row += taken as u64;
            if before + taken == full {
                self.put_point_block(space, part, block, width, &rows)?;
            } else {
                self.buffer.points.insert(key.clone(), (block, rows));
            }
        }
        Ok(())
    }
}
