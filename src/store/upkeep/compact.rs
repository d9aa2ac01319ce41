//! Compaction: rows without tombstones, then pages without gaps.

use crate::store::access::handle::Store;
use crate::store::access::reads::sealed::Source as _;
use crate::store::access::reads::{self, Reads};
use crate::store::access::transaction::Transaction;
use crate::store::error::StoreError;
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
use crate::store::format::keys;
use crate::store::format::points::point_rows_per_block;
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock, Rows};
use crate::store::progress::{Report, tell};

const DOING: &str = "compaction";

/// What compaction did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompactReport {
    /// Tombstones that are gone.
    pub rows_removed: u64,
    /// The file's length before, in bytes; 0 where the store is on a backend of the caller's own.
    pub bytes_before: u64,
    /// The file's length after.
    pub bytes_after: u64,
}

impl Store {
    /// Rewrites rows without tombstones, where there are any, and gives the space that nothing uses back to the file
    /// system. Rows change, ids do not. Takes about as much memory as the engine's cache.
    ///
    /// # Errors
    /// [`StoreError::Busy`] while a snapshot of any process is open; [`StoreError::Cancelled`]; in both cases rows may have
    /// been rewritten (in a commit of its own) though the file is not shorter. [`StoreError::ReadOnly`];
    /// [`StoreError::Damage`] where a block that must be rewritten is not whole: nothing was changed.
    pub fn compact(&self, report: Report<'_>) -> Result<CompactReport, StoreError> {
        let length = || std::fs::metadata(self.path()).map_or(0, |file| file.len());
        let bytes_before = length();
        let mut transaction = self.write()?;
        let counts = transaction.counts();
        let rows_removed = counts.rows.saturating_sub(counts.textures);
        if rows_removed > 0 {
            transaction.compact_rows(report)?;
            transaction.commit()?;
        } else {
            drop(transaction);
        }
        tell(report, DOING, "moving pages", 0, 1)?;
        self.compact_pages()?;
        Ok(CompactReport { rows_removed, bytes_before, bytes_after: length() })
    }
}

impl Transaction {
    /// Rewrites rows, descriptors and points without tombstones, block after block: each new block is written at or before
    /// the place of the rows it takes, of which one block at a time is in memory. Rows change, ids do not.
    ///
    /// # Errors
    /// [`StoreError::Cancelled`], [`StoreError::Damage`]; after either the transaction can only be dropped.
    pub fn compact_rows(&mut self, report: Report<'_>) -> Result<(), StoreError> {
        self.flush()?;
        self.writing(|this| {
            let rows = this.rows()?;
            for view in this.described_views()? {
                this.compact_view(view, &rows, report)?;
            }
            for space in this.spaces_with_points()? {
                this.compact_points(&space, &rows, report)?;
            }
            this.compact_row_blocks(&rows)
        })
    }

    fn compact_view(&mut self, view: ViewCode, rows: &Rows, report: Report<'_>) -> Result<(), StoreError> {
        let blocks = self.descriptor_blocks();
        let mut old: Option<(u32, Option<DescriptorBlock>)> = None;
        let mut new = DescriptorBlock::default();
        let (mut number, mut filled) = (0, 0);
        for (row, _) in rows.live() {
            let block = (row / DESCRIPTOR_ROWS) as u32;
            if old.as_ref().is_none_or(|(held, _)| *held != block) {
                tell(report, DOING, "rewriting descriptors", block.into(), blocks.into())?;
                old = Some((block, self.descriptors(view, block)?));
            }
            let held = old.as_ref().and_then(|(_, held)| held.as_ref());
            if let Some(moments) = held.and_then(|held| held.row(row % DESCRIPTOR_ROWS)) {
                new.set(filled, Some(moments));
            }
            filled += 1;
            if filled == DESCRIPTOR_ROWS {
                self.put_descriptor_block(view, number, &std::mem::take(&mut new))?;
                (number, filled) = (number + 1, 0);
            }
        }
        (number..blocks).try_for_each(|block| self.put_descriptor_block(view, block, &std::mem::take(&mut new)))
    }

    fn compact_points(&mut self, space: &str, rows: &Rows, report: Report<'_>) -> Result<(), StoreError> {
        let Some(mut layout) = self.points_layout(space)? else { return Ok(()) };
        for (part, width) in (0..=u8::MAX).zip(layout.widths.clone()) {
            let (width, blocks) = (usize::from(width), layout.blocks(part));
            let full = point_rows_per_block(width);
            let mut old: Option<(u32, Vec<f32>)> = None;
            let mut new: Vec<f32> = Vec::new();
            let mut number = 0;
            for (row, _) in rows.live().take_while(|&(row, _)| (row as u64) < layout.rows) {
                let block = (row / full) as u32;
                if old.as_ref().is_none_or(|(held, _)| *held != block) {
                    tell(report, DOING, "rewriting points", block.into(), blocks.into())?;
                    old = Some((block, reads::point_block(self.tables(), space, &layout, part, block)?));
                }
                let held = old.as_ref().and_then(|(_, held)| held.get(row % full * width..)?.get(..width));
                new.extend_from_slice(held.unwrap_or_default());
                if new.len() == full * width {
                    self.put_point_block(space, part, number, width, &std::mem::take(&mut new))?;
                    number += 1;
                }
            }
            for block in number..blocks {
                match std::mem::take(&mut new) {
                    rest if rest.is_empty() => self.delete(keys::POINTS, &*keys::points_block(space, part, block))?,
                    rest => self.put_point_block(space, part, block, width, &rest)?,
                }
            }
        }
        layout.rows = rows.live().take_while(|&(row, _)| (row as u64) < layout.rows).count() as u64;
        self.put_layout(space, &layout)
    }

    fn compact_row_blocks(&mut self, rows: &Rows) -> Result<(), StoreError> {
        let blocks = reads::row_blocks(self.tables());
        let ids: Vec<u64> = rows.live().map(|(_, id)| id).collect();
        let mut number = 0;
        for chunk in ids.chunks(ROWS_PER_BLOCK) {
            let mut block = RowBlock::default();
            chunk.iter().for_each(|&id| block.push(id));
            self.put_row_block(number, &block)?;
            number += 1;
        }
        (number..blocks).try_for_each(|block| self.delete(keys::ROWS, block))?;
        self.set_rows(ids.len() as u64);
        Ok(())
    }
}
