//! Compaction: rows without tombstones, then a file without unused pages.

use serde::Serialize;

use crate::progress::Progress;
use crate::store::access::handle::Store;
use crate::store::access::reads::{Reads, sealed::Source as _};
use crate::store::access::transaction::Transaction;
use crate::store::access::values;
use crate::store::error::StoreError;
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
use crate::store::format::points::{block_key, point_rows_per_block};
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock, Rows};
use crate::store::format::tables::{POINTS, ROWS};
use crate::store::upkeep::job::Job;

const DOING: &str = "compaction";

/// What a compaction did.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct CompactReport {
    /// The number of rows of removed textures that were dropped.
    pub rows_removed: u64,
    /// The length of the file before, in bytes; 0 if the store is not in a file.
    pub bytes_before: u64,
    /// The length of the file after, in bytes; 0 if the store is not in a file.
    pub bytes_after: u64,
}

impl Store {
    /// Rewrites rows without tombstones, if there are any, and returns unused space to the file system. Rows change, ids do
    /// not. Uses about as much memory as the engine's cache.
    ///
    /// # Errors
    /// [`StoreError::Busy`] while a snapshot of any process is open, and [`StoreError::Cancelled`]; after either, rows may
    /// have been rewritten (in a commit of their own) although the file is not shorter. [`StoreError::ReadOnly`].
    /// [`StoreError::Damage`] if a block that must be rewritten is damaged; then nothing was changed.
    pub fn compact(&self, progress: &dyn Progress) -> Result<CompactReport, StoreError> {
        let length = || std::fs::metadata(self.path()).map_or(0, |file| file.len());
        let bytes_before = length();
        let mut transaction = self.write()?;
        let counts = transaction.counts();
        let rows_removed = counts.rows.saturating_sub(counts.textures);
        if rows_removed > 0 {
            transaction.compact_rows(progress)?;
            transaction.commit()?;
        } else {
            drop(transaction);
        }
        Job::new(DOING, progress).begin("moving pages", 1)?;
        self.compact_pages()?;
        Ok(CompactReport { rows_removed, bytes_before, bytes_after: length() })
    }
}

impl Transaction {
    /// Rewrites rows, descriptors and points without tombstones, block after block. Each new block is written at or before
    /// the place of the rows that it takes, so that one block at a time is in memory. Rows change, ids do not.
    ///
    /// # Errors
    /// [`StoreError::Cancelled`], [`StoreError::Damage`]; after either, the transaction can only be dropped.
    pub fn compact_rows(&mut self, progress: &dyn Progress) -> Result<(), StoreError> {
        let job = Job::new(DOING, progress);
        self.flush()?;
        self.writing(|this| {
            let rows = this.rows()?;
            for view in this.described_views()? {
                this.compact_view(view, &rows, job)?;
            }
            for space in this.spaces_with_points()? {
                this.compact_points(&space, &rows, job)?;
            }
            this.compact_row_blocks(&rows)
        })
    }

    fn compact_view(&mut self, view: ViewCode, rows: &Rows, job: Job<'_>) -> Result<(), StoreError> {
        let blocks = self.descriptor_blocks();
        job.begin("rewriting descriptors", blocks.into())?;
        let mut old: Option<(u32, Option<DescriptorBlock>)> = None;
        let mut new = DescriptorBlock::default();
        let (mut number, mut filled) = (0, 0);
        for (row, _) in rows.live() {
            let block = (row / DESCRIPTOR_ROWS) as u32;
            if old.as_ref().is_none_or(|(held, _)| *held != block) {
                job.advance(1)?;
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

    fn compact_points(&mut self, space: &str, rows: &Rows, job: Job<'_>) -> Result<(), StoreError> {
        let Some(mut layout) = self.points_layout(space)? else { return Ok(()) };
        for (part, width) in (0..=u8::MAX).zip(layout.widths.clone()) {
            let (width, blocks) = (usize::from(width), layout.blocks(part));
            job.begin("rewriting points", blocks.into())?;
            let full = point_rows_per_block(width);
            let mut old: Option<(u32, Vec<f32>)> = None;
            let mut new: Vec<f32> = Vec::new();
            let mut number = 0;
            for (row, _) in rows.live().take_while(|&(row, _)| (row as u64) < layout.rows) {
                let block = (row / full) as u32;
                if old.as_ref().is_none_or(|(held, _)| *held != block) {
                    job.advance(1)?;
                    old = Some((block, values::point_block(self.tables(), space, &layout, part, block)?));
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
                    rest if rest.is_empty() => self.delete(POINTS, &*block_key(space, part, block))?,
                    rest => self.put_point_block(space, part, block, width, &rest)?,
                }
            }
        }
        layout.rows = rows.live().take_while(|&(row, _)| (row as u64) < layout.rows).count() as u64;
        self.put_layout(space, &layout)
    }

    fn compact_row_blocks(&mut self, rows: &Rows) -> Result<(), StoreError> {
        let blocks = values::row_blocks(self.tables());
        let ids: Vec<u64> = rows.live().map(|(_, id)| id).collect();
        let mut number = 0;
        for chunk in ids.chunks(ROWS_PER_BLOCK) {
            let mut block = RowBlock::default();
            chunk.iter().for_each(|&id| block.push(id));
            self.put_row_block(number, &block)?;
            number += 1;
        }
        (number..blocks).try_for_each(|block| self.delete(ROWS, block))?;
        self.set_rows(ids.len() as u64);
        Ok(())
    }
}
