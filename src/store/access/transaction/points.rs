//! The points of a space on their way in: begun with a layout, appended row by row, dropped as a whole.

use super::{Transaction, check_name};
use crate::store::access::reads::sealed::Source as _;
use crate::store::access::reads::{self, Reads};
use crate::store::error::StoreError;
use crate::store::format::frame::{self, Kind};
use crate::store::format::keys;
use crate::store::format::points::{self, MAX_POINT_WIDTH, PointsLayout, point_rows_per_block};

impl Transaction {
    /// Begins the points of `space` anew: what was there goes, no row is written, and each part has the given width.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] for a malformed name, no part, over 256 parts, or a width that is 0 or above
    /// [`MAX_POINT_WIDTH`].
    pub fn begin_points(&mut self, space: &str, widths: &[u16]) -> Result<(), StoreError> {
        check_name(space)?;
        let sound = |&width: &u16| (1..=MAX_POINT_WIDTH).contains(&usize::from(width));
        if !(1..=256).contains(&widths.len()) || !widths.iter().all(sound) {
            return Err(StoreError::invalid(format!("points of widths {widths:?} cannot be kept")));
        }
        self.drop_points(space)?;
        self.writing(|this| this.put_layout(space, &PointsLayout { widths: widths.to_vec(), rows: 0 }))
    }

    /// Appends the points of the next rows: for each part, row-major coordinates, the same number of rows in each. A
    /// texture that has no point, and a tombstone, has a row as well: by convention NaN.
    ///
    /// # Errors
    /// [`StoreError::Invalid`] where the points were not begun, parts or lengths do not fit the layout, or there would be
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
            return Err(StoreError::invalid(format!(
                "the points do not fit the widths {:?} of {space}",
                layout.widths
            )));
        }
        if layout.rows + rows as u64 > self.state.rows {
            let (known, there) = (layout.rows, self.state.rows);
            return Err(StoreError::invalid(format!("{rows} points after {known} are more than the {there} rows")));
        }
        self.writing(|this| {
            for (number, part) in parts.iter().enumerate() {
                this.append_part(space, number as u8, &layout, part)?;
            }
            layout.rows += rows as u64;
            this.put_layout(space, &layout)
        })
    }

    /// Removes the points of `space`, if there are any; the space stays.
    pub fn drop_points(&mut self, space: &str) -> Result<(), StoreError> {
        self.writing(|this| {
            this.open.points.retain(|(name, _), _| name != space);
            let prefix = keys::points_layout(space);
            let mut table = this.transaction.open_table(keys::POINTS).map_err(StoreError::when("opening a table"))?;
            let gone = match &keys::after(&prefix) {
                Some(end) => table.retain_in(&prefix[..]..&end[..], |_, _| false),
                None => table.retain_in(&prefix[..].., |_, _| false),
            };
            gone.map_err(StoreError::when("writing the store"))
        })
    }

    pub(in crate::store) fn put_layout(&self, space: &str, layout: &PointsLayout) -> Result<(), StoreError> {
        let key = keys::points_layout(space);
        let mut builder = frame::Builder::new(Kind::PointsLayout, 16 + 2 * layout.widths.len());
        layout.encode(builder.payload());
        self.insert(keys::POINTS, &*key, &*builder.seal(&key))
    }

    fn append_part(&mut self, space: &str, part: u8, layout: &PointsLayout, values: &[f32]) -> Result<(), StoreError> {
        let width = usize::from(layout.widths.get(usize::from(part)).copied().unwrap_or(1));
        let full = point_rows_per_block(width);
        let key = (space.to_owned(), part);
        let mut rest = values;
        let mut row = layout.rows;
        while !rest.is_empty() {
            let block = (row / full as u64) as u32;
            let held = (row % full as u64) as usize;
            let mut open = match self.open.points.remove(&key) {
                Some((number, open)) if number == block => open,
                _ if held > 0 => reads::point_block(self.tables(), space, layout, part, block)?,
                _ => Vec::new(),
            };
            let taken = (full - held).min(rest.len() / width);
            let (now, later) = rest.split_at_checked(taken * width).unwrap_or((rest, &[]));
            open.extend_from_slice(now);
            rest = later;
            row += taken as u64;
            if held + taken == full {
                self.put_point_block(space, part, block, width, &open)?;
            } else {
                self.open.points.insert(key.clone(), (block, open));
            }
        }
        Ok(())
    }

    pub(in crate::store) fn put_point_block(
        &self,
        space: &str,
        part: u8,
        block: u32,
        width: usize,
        values: &[f32],
    ) -> Result<(), StoreError> {
        let key = keys::points_block(space, part, block);
        let mut builder = frame::Builder::new(Kind::Points, 8 + 4 * values.len());
        points::encode_block(builder.payload(), width, values);
        self.insert(keys::POINTS, &*key, &*builder.seal(&key))
    }
}
