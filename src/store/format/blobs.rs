//! Blobs: named bytes of any length (statistics, spaces), cut into [chunks](super::chunks).

use crate::store::format::chunks;
use crate::store::format::frame::{self, Kind};
use crate::store::format::keys;
use crate::store::format::tables::{self, ByBytes};

/// The payload bytes of a chunk before its share of the blob.
const HEAD: usize = 16;

/// A table that holds blobs, and the frame kind of their chunks.
#[derive(Clone, Copy)]
pub(crate) struct Blobs {
    pub(crate) table: ByBytes,
    kind: Kind,
}

/// The `statistics` table.
pub(crate) const STATISTICS: Blobs = Blobs { table: tables::STATISTICS, kind: Kind::Statistics };
/// The `spaces` table.
pub(crate) const SPACES: Blobs = Blobs { table: tables::SPACES, kind: Kind::Space };

/// One chunk of a blob.
pub(crate) struct Chunk<'a> {
    /// The length of the whole blob in bytes and the number of its chunks.
    pub(crate) total: (u64, u32),
    /// The bytes of this chunk.
    pub(crate) share: &'a [u8],
}

impl Blobs {
    /// The chunks of a blob: keys and values, in order.
    pub(crate) fn seal(self, name: &str, blob: &[u8]) -> impl ExactSizeIterator<Item = (Vec<u8>, Vec<u8>)> {
        let (lengths, mut rest) = (chunks::cut(blob.len(), HEAD), blob);
        let chunks = lengths.len() as u32;
        lengths.into_iter().zip(0..chunks).map(move |(length, number)| {
            let (share, after) = rest.split_at_checked(length).unwrap_or((rest, &[]));
            rest = after;
            let key = key(name, number);
            let mut builder = frame::Builder::new(self.kind, HEAD + length);
            builder.payload().extend((blob.len() as u64).to_le_bytes());
            builder.payload().extend(chunks.to_le_bytes());
            builder.payload().extend([0; 4]);
            builder.payload().extend_from_slice(share);
            let value = builder.seal(&key);
            (key, value)
        })
    }

    /// The chunk at `key`; else what is wrong with it.
    pub(crate) fn open<'a>(self, key: &[u8], value: &'a [u8]) -> Result<Chunk<'a>, String> {
        let payload = frame::open(self.kind, key, value)?;
        let Some((&[t0, t1, t2, t3, t4, t5, t6, t7, c0, c1, c2, c3, 0, 0, 0, 0], share)) =
            payload.split_first_chunk::<HEAD>()
        else {
            return Err("the head of the chunk is malformed".into());
        };
        let total = (u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]), u32::from_le_bytes([c0, c1, c2, c3]));
        Ok(Chunk { total, share })
    }
}

/// `name 0 n` with n (`u32`) big-endian: the n-th chunk of a blob.
pub(crate) fn key(name: &str, n: u32) -> Vec<u8> {
    let mut bytes = keys::prefix(name);
    bytes.extend(n.to_be_bytes());
    bytes
}

/// The parts of a key: name, n.
pub(crate) fn parse(bytes: &[u8]) -> Option<(&str, u32)> {
    let (name, n) = bytes.split_last_chunk::<4>()?;
    let name = std::str::from_utf8(name).ok()?.strip_suffix('\0')?;
    (!name.contains('\0')).then_some((name, u32::from_be_bytes(*n)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_have_their_golden_bytes_and_are_parsed() {
        assert_eq!(key("full", 3), b"full\0\0\0\0\x03");
        assert_eq!(parse(&key("x", u32::MAX)), Some(("x", u32::MAX)));
    }

    #[test]
    fn a_blob_has_its_golden_bytes() {
        let chunks: Vec<_> = SPACES.seal("x", b"abc").collect();
        assert_eq!(chunks.len(), 1);
        let (key, value) = &chunks[0];
        assert_eq!(key, b"x\0\0\0\0\0");
        assert_eq!(value[..4], [9, 1, 0, 0]);
        assert_eq!(value[16..], *b"\x03\0\0\0\0\0\0\0\x01\0\0\0\0\0\0\0abc");
        let chunk = SPACES.open(key, value).unwrap();
        assert_eq!((chunk.total, chunk.share), ((3, 1), &b"abc"[..]));
        assert!(STATISTICS.open(key, value).is_err());
    }
}
