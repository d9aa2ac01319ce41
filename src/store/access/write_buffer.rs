//! The blocks that a transaction has open: written to their tables once, not once per row.

use std::collections::BTreeMap;

use crate::store::format::descriptors::{DescriptorBlock, ViewCode};
use crate::store::format::rows::RowBlock;

/// One row block, the descriptor blocks beside it, and the tail of each point part, in memory until another is needed.
#[derive(Debug, Default)]
pub(in crate::store) struct WriteBuffer {
    /// The number of the open row block.
    pub(in crate::store) rows: Option<(u32, RowBlock)>,
    /// The open descriptor blocks, all of the same number.
    pub(in crate::store) descriptors: Option<(u32, BTreeMap<ViewCode, DescriptorBlock>)>,
    /// The open point block of each (space, part): its number and its coordinates.
    pub(in crate::store) points: BTreeMap<(String, u8), (u32, Vec<f32>)>,
}

impl WriteBuffer {
    pub(in crate::store) fn row_block(&self, block: u32) -> Option<&RowBlock> {
        self.rows.as_ref().filter(|(number, _)| *number == block).map(|(_, rows)| rows)
    }

    pub(in crate::store) fn descriptor_block(&self, view: ViewCode, block: u32) -> Option<&DescriptorBlock> {
        self.descriptors.as_ref().filter(|(number, _)| *number == block).and_then(|(_, blocks)| blocks.get(&view))
    }

    pub(in crate::store) fn point_block(&self, space: &str, part: u8, block: u32) -> Option<&[f32]> {
        let (number, values) = self.points.get(&(space.to_owned(), part))?;
        (*number == block).then_some(values)
    }
}
