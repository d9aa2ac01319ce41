//! The write buffer of a transaction: the blocks that still grow, so that each is written to its table once and not once
//! per row.

use std::collections::BTreeMap;

use crate::store::format::descriptors::{DescriptorBlock, ViewCode};
use crate::store::format::rows::RowBlock;

/// One row block, the descriptor blocks of the same rows, and the last block of each part of points.
#[derive(Debug, Default)]
pub(crate) struct WriteBuffer {
    /// The number of the row block, and the block.
    pub(crate) rows: Option<(u32, RowBlock)>,
    /// The descriptor blocks, all with the same number.
    pub(crate) descriptors: Option<(u32, BTreeMap<ViewCode, DescriptorBlock>)>,
    /// The point block of each (space, part): its number and its coordinates.
    pub(crate) points: BTreeMap<(String, u8), (u32, Vec<f32>)>,
}

impl WriteBuffer {
    pub(crate) fn row_block(&self, block: u32) -> Option<&RowBlock> {
        self.rows.as_ref().filter(|(number, _)| *number == block).map(|(_, rows)| rows)
    }

    pub(crate) fn descriptor_block(&self, view: ViewCode, block: u32) -> Option<&DescriptorBlock> {
        self.descriptors.as_ref().filter(|(number, _)| *number == block).and_then(|(_, blocks)| blocks.get(&view))
    }

    pub(crate) fn point_block(&self, space: &str, part: u8, block: u32) -> Option<&[f32]> {
        let (number, values) = self.points.get(&(space.to_owned(), part))?;
        (*number == block).then_some(values)
    }
}
