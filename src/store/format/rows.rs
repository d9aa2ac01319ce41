//! Rows: the row of each texture, and which rows are tombstones.
//!
//! A texture's *row* is its place in `descriptors` (of every view) and in `points`. Rows are assigned in input order, so
//! ids ascend with rows. A removed texture leaves a *tombstone*: its row stays until rows are compacted.

use crate::store::damage::{Damage, DamageKey};
use crate::store::format::bits::Bits;
use crate::store::format::frame::{self, Kind};
use crate::store::format::tables::ROWS;

/// Rows per block of the `rows` table.
pub(crate) const ROWS_PER_BLOCK: usize = 1024;

/// Up to [`ROWS_PER_BLOCK`] consecutive rows: their ids, and whether each has a texture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct RowBlock {
    /// The ids, ascending.
    pub(crate) ids: Vec<u64>,
    /// Set for a texture, clear for a tombstone.
    pub(crate) live: Bits,
}

impl RowBlock {
    /// Appends the row of a texture.
    pub(crate) fn push(&mut self, id: u64) {
        self.ids.push(id);
        self.live.push(true);
    }

    /// The value of block number `block`.
    pub(crate) fn seal(&self, block: u32) -> Vec<u8> {
        let mut builder = frame::Builder::new(Kind::Rows, 16 + 3 * self.ids.len());
        self.encode(builder.payload());
        builder.seal(&block.to_le_bytes())
    }

    /// The rows of block number `block`.
    pub(crate) fn open(block: u32, value: &[u8]) -> Result<Self, Damage> {
        frame::open(Kind::Rows, &block.to_le_bytes(), value)
            .and_then(Self::decode)
            .map_err(|what| Damage::new(ROWS.name, DamageKey::RowBlock(block), what))
    }

    /// Payload: rows (`u32`), 0 (`u32`), first id (`u64`), live bits, then the gap from each id to the next in LEB128.
    fn encode(&self, payload: &mut Vec<u8>) {
        payload.extend((self.ids.len() as u32).to_le_bytes());
        payload.extend([0; 4]);
        payload.extend(self.ids.first().copied().unwrap_or(0).to_le_bytes());
        payload.extend_from_slice(self.live.bytes());
        for pair in self.ids.windows(2) {
            if let [before, after] = pair {
                write_leb128(payload, after.wrapping_sub(*before));
            }
        }
    }

    pub(crate) fn decode(payload: &[u8]) -> Result<Self, String> {
        let Some((head, rest)) = payload.split_first_chunk::<16>() else {
            return Err("the row block is cut short".into());
        };
        let [r0, r1, r2, r3, 0, 0, 0, 0, first @ ..] = *head else {
            return Err("the head of the row block is malformed".into());
        };
        let rows = u32::from_le_bytes([r0, r1, r2, r3]) as usize;
        if rows == 0 || rows > ROWS_PER_BLOCK {
            return Err(format!("the row block has {rows} rows, expected 1 to {ROWS_PER_BLOCK}"));
        }
        let (live, mut gaps) = Bits::decode(rows, rest)?;
        let mut ids = Vec::with_capacity(rows);
        let mut id = u64::from_le_bytes(first);
        ids.push(id);
        for _ in 1..rows {
            let gap = read_leb128(&mut gaps).filter(|&gap| gap > 0).ok_or("the ids do not ascend")?;
            id = id.checked_add(gap).ok_or("the ids do not ascend")?;
            ids.push(id);
        }
        if !gaps.is_empty() {
            return Err(format!("the row block has {} bytes after its ids", gaps.len()));
        }
        Ok(Self { ids, live })
    }
}

fn write_leb128(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

fn read_leb128(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0_u64;
    for shift in (0..64).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        let bits = u64::from(byte & 0x7F);
        if shift == 63 && bits > 1 {
            return None;
        }
        value |= bits << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// All rows of a store.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rows {
    pub(in crate::store) ids: Vec<u64>,
    pub(in crate::store) live: Bits,
}

impl Rows {
    /// The number of rows, tombstones included.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// The ids by row, tombstones included; they ascend.
    pub fn ids(&self) -> &[u64] {
        &self.ids
    }

    /// Whether the row has a texture: `false` for a tombstone and beyond the last row.
    pub fn is_live(&self, row: usize) -> bool {
        self.live.get(row)
    }

    /// The (row, id) of every texture, ascending in both.
    pub fn live(&self) -> impl Iterator<Item = (usize, u64)> + '_ {
        self.ids.iter().copied().enumerate().filter(|&(row, _)| self.live.get(row))
    }

    /// The row of the texture `id`; `None` if there is no such texture.
    pub fn row_of(&self, id: u64) -> Option<usize> {
        self.ids.binary_search(&id).ok().filter(|&row| self.live.get(row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_block_has_its_golden_bytes() {
        let mut block = RowBlock::default();
        for id in [5, 6, 300] {
            block.push(id);
        }
        block.live.set(1, false);
        let mut payload = Vec::new();
        block.encode(&mut payload);
        assert_eq!(payload, [3, 0, 0, 0, 0, 0, 0, 0, 5, 0, 0, 0, 0, 0, 0, 0, 0b101, 1, 0xA6, 2]);
        assert_eq!(RowBlock::decode(&payload), Ok(block));
        for length in 0..payload.len() {
            assert!(RowBlock::decode(&payload[..length]).is_err());
        }
    }

    #[test]
    fn gaps_of_any_size_are_preserved() {
        for gap in [1, 127, 128, 1 << 35, u64::MAX - 1] {
            let mut block = RowBlock::default();
            block.push(1);
            block.push(1 + gap);
            let mut payload = Vec::new();
            block.encode(&mut payload);
            assert_eq!(RowBlock::decode(&payload), Ok(block));
        }
    }
}
