//! What the fuzzer drives: every decoder of bytes that come from a file. Built only with the feature `fuzz`.

use crate::store::format::descriptors::{DescriptorBlock, ViewCode};
use crate::store::format::frame::{self, Kind};
use crate::store::format::header::{Header, Settings, State};
use crate::store::format::points::{self, PointsLayout};
use crate::store::format::record::{Content, StoredRecord};
use crate::store::format::rows::RowBlock;
use crate::store::format::{blobs, codec, sums, tags, voxels};

/// Passes the bytes to every decoder, as a whole value and as a payload. None of them may panic.
pub fn values(bytes: &[u8]) {
    for kind in [Kind::Settings, Kind::Record, Kind::Voxels, Kind::Rows, Kind::Sums, Kind::Points] {
        let _ = frame::open(kind, &[0; 8], bytes);
    }
    let _ = Header::decode(bytes);
    let _ = codec::decode::<Settings>(bytes);
    let _ = codec::decode::<State>(bytes);
    let _ = RowBlock::decode(bytes);
    let _ = DescriptorBlock::decode(bytes);
    let _ = DescriptorBlock::open(ViewCode(0), 0, bytes);
    let _ = points::decode_block(bytes, 8, 3);
    if let Ok(layout) = PointsLayout::decode(bytes) {
        let _ = (layout.blocks(0), layout.blocks(255));
    }
    let _ = sums::open(1, &frame::seal(Kind::Sums, &1_u64.to_le_bytes(), bytes));
    let _ = blobs::SPACES.open(b"x", &frame::seal(Kind::Space, b"x", bytes));
    let _ = (tags::parse(bytes), blobs::parse(bytes), points::parse(bytes));
    if let Ok(record) = codec::decode::<StoredRecord>(bytes) {
        let small = |content: &Content| content.shape.iter().all(|&side| side < 64);
        if let (Some(content), Some(stored)) = (record.content.filter(small), record.voxels) {
            let _ = voxels::expand(&content, stored.filter, bytes);
        }
    }
}
