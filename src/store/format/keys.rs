//! Tables and their keys. Names, types and encodings are frozen with the format version.

use redb::TableDefinition;

/// `meta`: name -> header, settings, state.
pub(in crate::store) const META: TableDefinition<&[u8], &[u8]> = TableDefinition::new("meta");
/// `textures`: id -> record.
pub(in crate::store) const TEXTURES: TableDefinition<u64, &[u8]> = TableDefinition::new("textures");
/// `hashes`: content hash -> id, short checksum.
pub(in crate::store) const HASHES: TableDefinition<&[u8; 32], &[u8; 12]> = TableDefinition::new("hashes");
/// `tags`: [`tag`] -> short checksum of the key.
pub(in crate::store) const TAGS: TableDefinition<&[u8], &[u8; 4]> = TableDefinition::new("tags");
/// `chunks`: (id, n) -> piece of the voxel stream.
pub(in crate::store) const CHUNKS: TableDefinition<(u64, u32), &[u8]> = TableDefinition::new("chunks");
/// `rows`: block -> row block.
pub(in crate::store) const ROWS: TableDefinition<u32, &[u8]> = TableDefinition::new("rows");
/// `descriptors`: (view, block) -> descriptor block.
pub(in crate::store) const DESCRIPTORS: TableDefinition<(u8, u32), &[u8]> = TableDefinition::new("descriptors");
/// `sums`: id -> exact sums of full@1.
pub(in crate::store) const SUMS: TableDefinition<u64, &[u8]> = TableDefinition::new("sums");
/// `statistics`: [`piece`] -> piece of a blob.
pub(in crate::store) const STATISTICS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("statistics");
/// `spaces`: [`piece`] -> piece of a blob.
pub(in crate::store) const SPACES: TableDefinition<&[u8], &[u8]> = TableDefinition::new("spaces");
/// `points`: [`points_layout`] -> layout, [`points_block`] -> point block.
pub(in crate::store) const POINTS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("points");

/// Names of blobs and spaces, and keys of tags, are at most this long (bytes).
pub const MAX_NAME: usize = 255;
/// Values of tags are at most this long (bytes).
pub const MAX_TAG_VALUE: usize = 4096;

/// Makes every table but `meta`, so that a table that is missing later is damage.
pub(in crate::store) fn create_all(transaction: &redb::WriteTransaction) -> Result<(), redb::TableError> {
    transaction.open_table(TEXTURES)?;
    transaction.open_table(HASHES)?;
    transaction.open_table(TAGS)?;
    transaction.open_table(CHUNKS)?;
    transaction.open_table(ROWS)?;
    transaction.open_table(DESCRIPTORS)?;
    transaction.open_table(SUMS)?;
    transaction.open_table(STATISTICS)?;
    transaction.open_table(SPACES)?;
    transaction.open_table(POINTS)?;
    Ok(())
}

/// `key 0 value 0 id` with the id big-endian, so that ids of one tag ascend in key order.
pub(in crate::store) fn tag(key: &str, value: &str, id: u64) -> Vec<u8> {
    let mut bytes = tag_prefix(key, Some(value));
    bytes.extend(id.to_be_bytes());
    bytes
}

/// What the keys of a tag begin with: `key 0`, or `key 0 value 0`.
pub(in crate::store) fn tag_prefix(key: &str, value: Option<&str>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(key.len() + value.map_or(0, str::len) + 10);
    bytes.extend_from_slice(key.as_bytes());
    bytes.push(0);
    if let Some(value) = value {
        bytes.extend_from_slice(value.as_bytes());
        bytes.push(0);
    }
    bytes
}

/// The parts of a tag's key: key, value, id.
pub(in crate::store) fn parse_tag(bytes: &[u8]) -> Option<(&str, &str, u64)> {
    let (text, id) = bytes.split_last_chunk::<8>()?;
    let text = std::str::from_utf8(text).ok()?.strip_suffix('\0')?;
    let (key, value) = text.split_once('\0')?;
    (!value.contains('\0')).then_some((key, value, u64::from_be_bytes(*id)))
}

/// `name 0 n` with n (`u32`) big-endian: the n-th piece of a blob.
pub(in crate::store) fn piece(name: &str, n: u32) -> Vec<u8> {
    let mut bytes = points_layout(name);
    bytes.extend(n.to_be_bytes());
    bytes
}

/// The parts of a piece's key: name, n.
pub(in crate::store) fn parse_piece(bytes: &[u8]) -> Option<(&str, u32)> {
    let (name, n) = bytes.split_last_chunk::<4>()?;
    let name = std::str::from_utf8(name).ok()?.strip_suffix('\0')?;
    (!name.contains('\0')).then_some((name, u32::from_be_bytes(*n)))
}

/// `name 0`: the layout of a space's points.
pub(in crate::store) fn points_layout(space: &str) -> Vec<u8> {
    tag_prefix(space, None)
}

/// `name 0 part block` with the block (`u32`) big-endian.
pub(in crate::store) fn points_block(space: &str, part: u8, block: u32) -> Vec<u8> {
    let mut bytes = points_layout(space);
    bytes.push(part);
    bytes.extend(block.to_be_bytes());
    bytes
}

/// The parts of a key of the `points` table: space, and part and block unless it is the layout.
pub(in crate::store) fn parse_points(bytes: &[u8]) -> Option<(&str, Option<(u8, u32)>)> {
    let at = bytes.iter().position(|&byte| byte == 0)?;
    let (name, rest) = bytes.split_at_checked(at)?;
    let name = std::str::from_utf8(name).ok()?;
    match *rest {
        [0] => Some((name, None)),
        [0, part, b0, b1, b2, b3] => Some((name, Some((part, u32::from_be_bytes([b0, b1, b2, b3]))))),
        _ => None,
    }
}

/// The key bytes of (id, n) in `chunks`, for the checksum: the engine stores tuples of integers one after the other.
pub(in crate::store) fn chunk_bytes(id: u64, n: u32) -> [u8; 12] {
    let mut bytes = [0; 12];
    for (byte, value) in bytes.iter_mut().zip(id.to_le_bytes().into_iter().chain(n.to_le_bytes())) {
        *byte = value;
    }
    bytes
}

/// The key bytes of (view, block) in `descriptors`, for the checksum.
pub(in crate::store) fn descriptor_bytes(view: u8, block: u32) -> [u8; 5] {
    let [b0, b1, b2, b3] = block.to_le_bytes();
    [view, b0, b1, b2, b3]
}

/// The smallest key above all keys that begin with `prefix`; `None` where there is none.
pub(in crate::store) fn after(prefix: &[u8]) -> Option<Vec<u8>> {
    let mut end = prefix.to_vec();
    while let Some(last) = end.last_mut() {
        if *last < u8::MAX {
            *last += 1;
            return Some(end);
        }
        end.pop();
    }
    None
}

#[cfg(test)]
mod tests {
    use redb::{Key, Value};

    use super::*;

    #[test]
    fn keys_have_their_golden_bytes() {
        assert_eq!(tag("family", "marble", 0x0102), b"family\0marble\0\0\0\0\0\0\0\x01\x02");
        assert_eq!(piece("full", 3), b"full\0\0\0\0\x03");
        assert_eq!(points_layout("default"), b"default\0");
        assert_eq!(points_block("default", 1, 258), b"default\0\x01\0\0\x01\x02");
        assert_eq!(chunk_bytes(7, 2), [7, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(<(u64, u32)>::as_bytes(&(7, 2)), chunk_bytes(7, 2));
        assert_eq!(<(u8, u32)>::as_bytes(&(3, 258)), descriptor_bytes(3, 258));
        assert_eq!(<(u64, u32)>::fixed_width(), Some(12));
        assert!(<(u64, u32)>::compare(&chunk_bytes(255, 1), &chunk_bytes(256, 0)).is_lt());
    }

    #[test]
    fn keys_come_apart_again() {
        assert_eq!(parse_tag(&tag("a", "", 9)), Some(("a", "", 9)));
        assert_eq!(parse_tag(b"a\0b\0\0\0\0"), None);
        assert_eq!(parse_piece(&piece("x", u32::MAX)), Some(("x", u32::MAX)));
        assert_eq!(parse_points(&points_layout("x")), Some(("x", None)));
        assert_eq!(parse_points(&points_block("x", 255, 5)), Some(("x", Some((255, 5)))));
        assert_eq!(parse_points(b"x\0\0"), None);
        assert_eq!(after(b"a\xFF\xFF"), Some(b"b".to_vec()));
        assert_eq!(after(b"\xFF"), None);
    }
}
