//! Point blocks: the coordinates of consecutive rows in one part of a space.
//!
//! A space's points are kept in *parts* (codes, coordinates), each with its own width and its
//! own blocks, so that a cold question reads only the few bytes it needs. To the store, coordinates are numbers.

use crate::store::format::chunks::capacity;
use crate::store::format::descriptors::{read_f32, write_f32};

/// The widest point part.
pub const MAX_POINT_WIDTH: usize = 4096;
/// A full point block is just under 2^18 bytes.
const BLOCK_POWER: u32 = 18;
/// Payload bytes before the coordinates.
const HEAD: usize = 8;

/// How many rows of `width` coordinates one block holds.
pub const fn point_rows_per_block(width: usize) -> usize {
    (capacity(BLOCK_POWER) - HEAD) / (4 * width)
}

/// The points of one space: the parts' widths and how many rows are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PointsLayout {
    /// The width of each part, in coordinates.
    pub widths: Vec<u16>,
    /// How many rows each part has; rows of textures added since are not mapped yet.
    pub rows: u64,
}

impl PointsLayout {
    /// The number of blocks of a part; 0 for a part that is not there.
    pub fn blocks(&self, part: u8) -> u32 {
        match self.widths.get(usize::from(part)) {
            Some(&width) => self.rows.div_ceil(point_rows_per_block(usize::from(width)) as u64) as u32,
            None => 0,
        }
    }

    /// Payload: rows (`u64`), parts (`u32`), 0 (`u32`), a width (`u16`) per part.
    pub(in crate::store) fn encode(&self, payload: &mut Vec<u8>) {
        payload.extend(self.rows.to_le_bytes());
        payload.extend((self.widths.len() as u32).to_le_bytes());
        payload.extend([0; 4]);
        payload.extend(self.widths.iter().flat_map(|width| width.to_le_bytes()));
    }

    pub(in crate::store) fn decode(payload: &[u8]) -> Result<Self, String> {
        let Some((&[r0, r1, r2, r3, r4, r5, r6, r7, p0, p1, p2, p3, 0, 0, 0, 0], rest)) =
            payload.split_first_chunk::<16>()
        else {
            return Err("the points' layout is short".into());
        };
        let (widths, left) = rest.as_chunks::<2>();
        let widths: Vec<u16> = widths.iter().map(|&width| u16::from_le_bytes(width)).collect();
        let parts = u32::from_le_bytes([p0, p1, p2, p3]) as usize;
        let sound = |&width: &u16| (1..=MAX_POINT_WIDTH).contains(&usize::from(width));
        if widths.len() != parts || !left.is_empty() || !(1..=256).contains(&parts) || !widths.iter().all(sound) {
            return Err(format!("the points' layout of {parts} parts is odd"));
        }
        Ok(Self { widths, rows: u64::from_le_bytes([r0, r1, r2, r3, r4, r5, r6, r7]) })
    }
}

/// Payload of a point block: rows (`u32`), width (`u16`), 0 (`u16`), rows x width `f32`.
pub(in crate::store) fn encode_block(payload: &mut Vec<u8>, width: usize, values: &[f32]) {
    payload.extend((values.len().checked_div(width).unwrap_or(0) as u32).to_le_bytes());
    payload.extend((width as u16).to_le_bytes());
    payload.extend([0; 2]);
    write_f32(payload, values);
}

pub(in crate::store) fn decode_block(payload: &[u8], width: usize, rows: usize) -> Result<Vec<f32>, String> {
    let Some((&[r0, r1, r2, r3, w0, w1, 0, 0], values)) = payload.split_first_chunk::<HEAD>() else {
        return Err("the point block's head is odd".into());
    };
    let found = (u32::from_le_bytes([r0, r1, r2, r3]) as usize, usize::from(u16::from_le_bytes([w0, w1])));
    if found != (rows, width) || values.len() != rows * width * 4 {
        return Err(format!("the point block has {} rows of {}, expected {rows} of {width}", found.0, found.1));
    }
    Ok(read_f32(values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_block_has_its_golden_bytes() {
        let mut payload = Vec::new();
        encode_block(&mut payload, 2, &[1.0, 0.5, -2.0, 0.0]);
        assert_eq!(payload[..12], [2, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0x80, 0x3F]);
        assert_eq!(decode_block(&payload, 2, 2), Ok(vec![1.0, 0.5, -2.0, 0.0]));
        assert!(decode_block(&payload, 2, 1).is_err() && decode_block(&payload, 1, 4).is_err());
        for length in 0..payload.len() {
            assert!(decode_block(&payload[..length], 2, 2).is_err());
        }
    }

    #[test]
    fn a_layout_has_its_golden_bytes() {
        let layout = PointsLayout { widths: vec![9, 24], rows: 7 };
        let mut payload = Vec::new();
        layout.encode(&mut payload);
        assert_eq!(payload, [7, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 9, 0, 24, 0]);
        assert_eq!(PointsLayout::decode(&payload), Ok(layout));
        for length in 0..payload.len() {
            assert!(PointsLayout::decode(&payload[..length]).is_err());
        }
    }

    #[test]
    fn full_blocks_fill_their_page_runs() {
        for width in [1, 8, 9, 24, 32, 251] {
            let bytes = HEAD + point_rows_per_block(width) * width * 4;
            assert!(bytes <= capacity(BLOCK_POWER) && bytes > capacity(BLOCK_POWER) - 4 * width);
        }
    }
}
