//! Point blocks: the coordinates of consecutive rows in one part of a space.
//!
//! The points of a space are stored in *parts* (codes, coordinates), each with a width and blocks of its own, so that the
//! first query after opening reads few bytes. The store does not interpret coordinates.

use crate::store::damage::{Damage, DamageKey};
use crate::store::format::chunks::capacity;
use crate::store::format::descriptors::{read_f32, write_f32};
use crate::store::format::frame::{self, Kind};
use crate::store::format::keys;
use crate::store::format::tables::POINTS;

/// The largest width of a part, in coordinates.
pub const MAX_POINT_WIDTH: usize = 4096;
/// A full point block takes just under 2^18 bytes.
const BLOCK_POWER: u32 = 18;
/// The payload bytes before the coordinates.
const HEAD: usize = 8;

/// The number of rows of `width` coordinates in a full block.
pub const fn point_rows_per_block(width: usize) -> usize {
    (capacity(BLOCK_POWER) - HEAD) / (4 * width)
}

/// The layout of the points of one space: the width of each part and the number of rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PointsLayout {
    /// The width of each part, in coordinates.
    pub widths: Vec<u16>,
    /// The number of rows of each part. Textures that were added later have no point yet.
    pub rows: u64,
}

impl PointsLayout {
    /// The number of blocks of a part; 0 if there is no such part.
    pub fn blocks(&self, part: u8) -> u32 {
        match self.widths.get(usize::from(part)) {
            Some(&width) => self.rows.div_ceil(point_rows_per_block(usize::from(width)) as u64) as u32,
            None => 0,
        }
    }

    /// The number of rows in a block of a part whose width is `width`.
    pub(in crate::store) fn rows_in_block(&self, width: usize, block: u32) -> usize {
        let full = point_rows_per_block(width) as u64;
        self.rows.saturating_sub(u64::from(block) * full).min(full) as usize
    }

    /// Key and value of the layout of `space`.
    pub(in crate::store) fn seal(&self, space: &str) -> (Vec<u8>, Vec<u8>) {
        let key = layout_key(space);
        let mut builder = frame::Builder::new(Kind::PointsLayout, 16 + 2 * self.widths.len());
        self.encode(builder.payload());
        let value = builder.seal(&key);
        (key, value)
    }

    /// The layout of `space`.
    pub(in crate::store) fn open(space: &str, value: &[u8]) -> Result<Self, Damage> {
        frame::open(Kind::PointsLayout, &layout_key(space), value)
            .and_then(Self::decode)
            .map_err(|what| Damage::new(POINTS.name, DamageKey::Space(space.to_owned()), what))
    }

    /// Payload: rows (`u64`), parts (`u32`), 0 (`u32`), a width (`u16`) per part.
    fn encode(&self, payload: &mut Vec<u8>) {
        payload.extend(self.rows.to_le_bytes());
        payload.extend((self.widths.len() as u32).to_le_bytes());
        payload.extend([0; 4]);
        payload.extend(self.widths.iter().flat_map(|width| width.to_le_bytes()));
    }

    pub(in crate::store) fn decode(payload: &[u8]) -> Result<Self, String> {
        let Some((&[r0, r1, r2, r3, r4, r5, r6, r7, p0, p1, p2, p3, 0, 0, 0, 0], rest)) =
            payload.split_first_chunk::<16>()
        else {
            return Err("the layout of the points is cut short".into());
        };
        let (widths, left) = rest.as_chunks::<2>();
        let widths: Vec<u16> = widths.iter().map(|&width| u16::from_le_bytes(width)).collect();
        let parts = u32::from_le_bytes([p0, p1, p2, p3]) as usize;
        let sound = |&width: &u16| (1..=MAX_POINT_WIDTH).contains(&usize::from(width));
        if widths.len() != parts || !left.is_empty() || !(1..=256).contains(&parts) || !widths.iter().all(sound) {
            return Err(format!("the layout of the points, of {parts} parts, is malformed"));
        }
        Ok(Self { widths, rows: u64::from_le_bytes([r0, r1, r2, r3, r4, r5, r6, r7]) })
    }
}

/// `name 0`: the key of the layout of a space.
pub(crate) fn layout_key(space: &str) -> Vec<u8> {
    keys::prefix(space)
}

/// `name 0 part block` with the block (`u32`) big-endian: the key of a point block.
pub(crate) fn block_key(space: &str, part: u8, block: u32) -> Vec<u8> {
    let mut bytes = layout_key(space);
    bytes.push(part);
    bytes.extend(block.to_be_bytes());
    bytes
}

/// The parts of a key: the space, then part and block unless it is the key of a layout.
pub(crate) fn parse(bytes: &[u8]) -> Option<(&str, Option<(u8, u32)>)> {
    let at = bytes.iter().position(|&byte| byte == 0)?;
    let (name, rest) = bytes.split_at_checked(at)?;
    let name = std::str::from_utf8(name).ok()?;
    match *rest {
        [0] => Some((name, None)),
        [0, part, b0, b1, b2, b3] => Some((name, Some((part, u32::from_be_bytes([b0, b1, b2, b3]))))),
        _ => None,
    }
}

/// Key and value of a block of `width` coordinates a row.
pub(crate) fn seal_block(space: &str, part: u8, block: u32, width: usize, values: &[f32]) -> (Vec<u8>, Vec<u8>) {
    let key = block_key(space, part, block);
    let mut builder = frame::Builder::new(Kind::Points, HEAD + 4 * values.len());
    encode_block(builder.payload(), width, values);
    let value = builder.seal(&key);
    (key, value)
}

/// The coordinates of the value at `key`, which must have `rows` rows of `width`.
pub(crate) fn open_block(key: &[u8], width: usize, rows: usize, value: &[u8]) -> Result<Vec<f32>, String> {
    frame::open(Kind::Points, key, value).and_then(|payload| decode_block(payload, width, rows))
}

/// Payload of a point block: rows (`u32`), width (`u16`), 0 (`u16`), rows x width `f32`.
fn encode_block(payload: &mut Vec<u8>, width: usize, values: &[f32]) {
    payload.extend((values.len().checked_div(width).unwrap_or(0) as u32).to_le_bytes());
    payload.extend((width as u16).to_le_bytes());
    payload.extend([0; 2]);
    write_f32(payload, values);
}

pub(crate) fn decode_block(payload: &[u8], width: usize, rows: usize) -> Result<Vec<f32>, String> {
    let Some((&[r0, r1, r2, r3, w0, w1, 0, 0], values)) = payload.split_first_chunk::<HEAD>() else {
        return Err("the head of the point block is malformed".into());
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
    fn keys_have_their_golden_bytes_and_are_parsed() {
        assert_eq!(layout_key("default"), b"default\0");
        assert_eq!(block_key("default", 1, 258), b"default\0\x01\0\0\x01\x02");
        assert_eq!(parse(&layout_key("x")), Some(("x", None)));
        assert_eq!(parse(&block_key("x", 255, 5)), Some(("x", Some((255, 5)))));
        assert_eq!(parse(b"x\0\0"), None);
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
