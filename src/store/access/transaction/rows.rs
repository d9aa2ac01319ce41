//! Rows and descriptors in a transaction, through the write buffer.

use std::collections::BTreeMap;

use super::Transaction;
use super::checks::check_descriptors;
use crate::hlac::MASK_COUNT;
use crate::store::access::reads::{Reads, sealed::Source as _};
use crate::store::access::values;
use crate::store::error::StoreError;
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock, ViewCode};
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock};
use crate::store::format::tables::{DESCRIPTORS, ROWS};

impl Transaction {
    /// Replaces moments of a texture, view by view; `None` removes a view, and views that are not named stay. Cheapest in
    /// the order of ids, where each block is written once.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`]; [`StoreError::Invalid`] for moments that are not finite or a view given twice.
    pub fn set_descriptors(
        &mut self,
        id: u64,
        descriptors: &[(ViewCode, Option<[f32; MASK_COUNT]>)],
    ) -> Result<(), StoreError> {
        let given: Vec<_> = descriptors.iter().filter_map(|(view, moments)| Some((*view, (*moments)?))).collect();
        check_descriptors(&given)?;
        let row = self.row(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        self.writing(|this| {
            for (view, moments) in descriptors {
                this.set_descriptor(row, *view, moments.as_ref())?;
            }
            Ok(())
        })
    }

    /// Appends the row of a texture.
    pub(in crate::store) fn add_row(
        &mut self,
        id: u64,
        descriptors: &[(ViewCode, [f32; MASK_COUNT])],
    ) -> Result<(), StoreError> {
        let row = self.state.rows;
        self.buffered_row_block((row / ROWS_PER_BLOCK as u64) as u32)?.push(id);
        for (view, moments) in descriptors {
            self.set_descriptor(row, *view, Some(moments))?;
        }
        self.state.rows += 1;
        Ok(())
    }

    /// Makes a row a tombstone.
    pub(in crate::store) fn remove_row(&mut self, row: u64) -> Result<(), StoreError> {
        let (block, row) = (row / ROWS_PER_BLOCK as u64, row % ROWS_PER_BLOCK as u64);
        self.buffered_row_block(block as u32)?.live.set(row as usize, false);
        self.state.live = self.state.live.saturating_sub(1);
        Ok(())
    }

    /// Sets or removes the moments of a row in one view.
    pub(in crate::store) fn set_descriptor(
        &mut self,
        row: u64,
        view: ViewCode,
        moments: Option<&[f32; MASK_COUNT]>,
    ) -> Result<(), StoreError> {
        let block = (row / DESCRIPTOR_ROWS as u64) as u32;
        if self.buffer.descriptors.as_ref().is_none_or(|(number, _)| *number != block) {
            self.flush_descriptor_blocks()?;
            self.buffer.descriptors = Some((block, BTreeMap::new()));
        }
        let loaded = match self.buffer.descriptor_block(view, block) {
            Some(_) => None,
            None => Some(values::descriptor_block(self.tables(), view, block)?.unwrap_or_default()),
        };
        let (_, blocks) = self.buffer.descriptors.get_or_insert_default();
        let rows = blocks.entry(view).or_default();
        if let Some(loaded) = loaded {
            *rows = loaded;
        }
        rows.set((row % DESCRIPTOR_ROWS as u64) as usize, moments);
        Ok(())
    }

    /// The row block `block` in the buffer; the block that was there before is written.
    fn buffered_row_block(&mut self, block: u32) -> Result<&mut RowBlock, StoreError> {
        if self.buffer.row_block(block).is_none() {
            self.flush_row_block()?;
            let exists = u64::from(block) * (ROWS_PER_BLOCK as u64) < self.state.rows;
            let rows = if exists { values::row_block(self.tables(), block)? } else { RowBlock::default() };
            self.buffer.rows = Some((block, rows));
        }
        Ok(&mut self.buffer.rows.get_or_insert_default().1)
    }

    /// Writes the row block of the buffer.
    pub(in crate::store) fn flush_row_block(&mut self) -> Result<(), StoreError> {
        let Some((block, rows)) = self.buffer.rows.take() else { return Ok(()) };
        self.put_row_block(block, &rows)
    }

    pub(in crate::store) fn put_row_block(&self, block: u32, rows: &RowBlock) -> Result<(), StoreError> {
        self.insert(ROWS, block, &*rows.seal(block))
    }

    /// Writes the descriptor blocks of the buffer.
    pub(in crate::store) fn flush_descriptor_blocks(&mut self) -> Result<(), StoreError> {
        let Some((block, blocks)) = self.buffer.descriptors.take() else { return Ok(()) };
        blocks.into_iter().try_for_each(|(view, rows)| self.put_descriptor_block(view, block, &rows))
    }

    /// Writes a descriptor block, or removes it if none of its rows is present.
    pub(in crate::store) fn put_descriptor_block(
        &self,
        view: ViewCode,
        block: u32,
        rows: &DescriptorBlock,
    ) -> Result<(), StoreError> {
        match rows.present() {
            0 => self.delete(DESCRIPTORS, (view.0, block)),
            _ => self.insert(DESCRIPTORS, (view.0, block), &*rows.seal(view, block)),
        }
    }
}
