//! Descriptor blocks: the moments of consecutive rows in one view.

use crate::hlac::MASK_COUNT;
use crate::store::damage::{Damage, DamageKey};
use crate::store::format::bits::Bits;
use crate::store::format::frame::{self, Kind};
use crate::store::format::keys;
use crate::store::format::tables::DESCRIPTORS;

/// The code of a view, as the crate `hlac` assigns it. The store does not interpret it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
pub struct ViewCode(pub u8);

/// Rows per descriptor block: 256 x 251 f32 with flags and frame is just under 2^18 - 256 bytes.
///
/// Measured against 1024 rows with eight views: committing one texture takes half the time (15 ms instead of 29 ms), the
/// file before compaction takes two thirds of the space, and reading all blocks takes as long.
pub const DESCRIPTOR_ROWS: usize = 256;

/// The bytes of one row.
const ROW_BYTES: usize = MASK_COUNT * 4;

/// The moments of up to [`DESCRIPTOR_ROWS`] consecutive rows in one view. A row is absent if its texture lacks the view
/// (small volumes lack some).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DescriptorBlock {
    present: Bits,
    values: Vec<f32>,
}

impl DescriptorBlock {
    /// The number of rows up to the last one that was written; rows beyond it are absent.
    pub fn len(&self) -> usize {
        self.present.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.present.len() == 0
    }

    /// The moments of the `row`-th row of the block; `None` if it is absent.
    pub fn row(&self, row: usize) -> Option<&[f32; MASK_COUNT]> {
        if !self.present.get(row) {
            return None;
        }
        self.values.get(row * MASK_COUNT..)?.first_chunk()
    }

    /// All rows, row-major, 251 values each; zeros for absent rows.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The number of rows that are present.
    pub fn present(&self) -> usize {
        self.present.ones()
    }

    /// Sets the `row`-th row, and appends absent rows before it if needed; `None` makes it absent.
    pub(in crate::store) fn set(&mut self, row: usize, moments: Option<&[f32; MASK_COUNT]>) {
        while self.present.len() <= row {
            self.present.push(false);
            self.values.extend([0.0; MASK_COUNT]);
        }
        self.present.set(row, moments.is_some());
        if let Some(target) = self.values.get_mut(row * MASK_COUNT..).and_then(<[f32]>::first_chunk_mut) {
            *target = moments.copied().unwrap_or([0.0; MASK_COUNT]);
        }
    }

    /// The value of block number `block` of `view`.
    pub(in crate::store) fn seal(&self, view: ViewCode, block: u32) -> Vec<u8> {
        let mut builder = frame::Builder::new(Kind::Descriptors, Self::encoded_len(self.len()));
        self.encode(builder.payload());
        builder.seal(&keys::descriptors(view.0, block))
    }

    /// Block number `block` of `view`.
    pub(in crate::store) fn open(view: ViewCode, block: u32, value: &[u8]) -> Result<Self, Damage> {
        let key = DamageKey::DescriptorBlock { view: view.0, block };
        frame::open(Kind::Descriptors, &keys::descriptors(view.0, block), value)
            .and_then(Self::decode)
            .map_err(|what| Damage::new(DESCRIPTORS.name, key, what))
    }

    /// Payload: rows (`u32`), 0 (`u32`), presence bits padded to a multiple of 8 bytes, rows x 251 `f32`.
    fn encode(&self, payload: &mut Vec<u8>) {
        payload.extend((self.len() as u32).to_le_bytes());
        payload.extend([0; 4]);
        payload.extend_from_slice(self.present.bytes());
        payload.extend(std::iter::repeat_n(0, padding(self.len())));
        write_f32(payload, &self.values);
    }

    /// The length of the payload for `rows` rows.
    fn encoded_len(rows: usize) -> usize {
        8 + rows.div_ceil(64) * 8 + rows * ROW_BYTES
    }

    pub(in crate::store) fn decode(payload: &[u8]) -> Result<Self, String> {
        let Some((&[r0, r1, r2, r3, 0, 0, 0, 0], rest)) = payload.split_first_chunk::<8>() else {
            return Err("the head of the descriptor block is malformed".into());
        };
        let rows = u32::from_le_bytes([r0, r1, r2, r3]) as usize;
        if rows == 0 || rows > DESCRIPTOR_ROWS || payload.len() != Self::encoded_len(rows) {
            return Err(format!("the descriptor block has {rows} rows in {} bytes", payload.len()));
        }
        let (present, rest) = Bits::decode(rows, rest)?;
        let Some((pad, values)) = rest.split_at_checked(padding(rows)) else {
            return Err("the descriptor block is cut short".into());
        };
        if pad.iter().any(|&byte| byte != 0) {
            return Err("the padding of the presence bits is not 0".into());
        }
        Ok(Self { present, values: read_f32(values) })
    }
}

/// The number of bytes from the presence bits of `rows` rows to the next multiple of 8.
fn padding(rows: usize) -> usize {
    rows.div_ceil(64) * 8 - rows.div_ceil(8)
}

/// Appends `values` in little-endian order.
pub(crate) fn write_f32(bytes: &mut Vec<u8>, values: &[f32]) {
    if cfg!(target_endian = "little") {
        bytes.extend_from_slice(bytemuck::cast_slice(values));
    } else {
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
}

/// Reads little-endian values; a remainder of less than 4 bytes is ignored (callers have checked the length).
pub(crate) fn read_f32(bytes: &[u8]) -> Vec<f32> {
    let (quads, _) = bytes.as_chunks::<4>();
    if cfg!(target_endian = "little") {
        bytemuck::pod_collect_to_vec(quads)
    } else {
        quads.iter().map(|&quad| f32::from_le_bytes(quad)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_descriptor_block_has_its_golden_bytes() {
        let mut block = DescriptorBlock::default();
        block.set(2, Some(&[0.5; MASK_COUNT]));
        block.set(0, Some(&[1.0; MASK_COUNT]));
        let mut payload = Vec::new();
        block.encode(&mut payload);
        assert_eq!(payload.len(), DescriptorBlock::encoded_len(3));
        assert_eq!(payload[..20], [3, 0, 0, 0, 0, 0, 0, 0, 0b101, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x80, 0x3F]);
        assert_eq!(payload[16 + 2 * 1004..][..4], 0.5_f32.to_le_bytes());
        assert_eq!(DescriptorBlock::decode(&payload), Ok(block.clone()));
        assert_eq!((block.row(1), block.row(3), block.present()), (None, None, 2));
        for length in 0..payload.len() {
            assert!(DescriptorBlock::decode(&payload[..length]).is_err());
        }
    }

    #[test]
    fn a_full_block_fills_its_page_run() {
        let bytes = DescriptorBlock::encoded_len(DESCRIPTOR_ROWS);
        let room = crate::store::format::chunks::capacity(18);
        assert!(bytes <= room && bytes > room / 50 * 49);
    }
}
