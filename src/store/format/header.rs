//! The `meta` table: the frozen header, the settings and the counters.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use crate::store::format::descriptors::ViewCode;

/// The format version that this library writes. An integer of its own, not the crate's version.
pub const FORMAT_VERSION: u32 = 1;
/// The required-feature bits that this library knows.
pub(in crate::store) const KNOWN_FEATURES: u64 = 0;

/// The first bytes of the header entry.
pub(in crate::store) const MAGIC: [u8; 8] = *b"hlacdb\r\n";

/// Keys of the `meta` table.
pub(in crate::store) const KEY_FORMAT: &[u8] = b"format";
pub(in crate::store) const KEY_SETTINGS: &[u8] = b"settings";
pub(in crate::store) const KEY_STATE: &[u8] = b"state";

/// The header entry: 32 bytes whose layout no version may ever change, so that any program can tell any store's version.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) struct Header {
    /// The format version of the store.
    pub(in crate::store) version: u32,
    /// The lowest version whose readers read it.
    pub(in crate::store) minimum_reader: u32,
    /// Bits that a reader must know.
    pub(in crate::store) features: u64,
}

impl Header {
    /// The header of the stores that this library writes.
    pub(in crate::store) const CURRENT: Self =
        Self { version: FORMAT_VERSION, minimum_reader: FORMAT_VERSION, features: 0 };

    pub(in crate::store) fn encode(self) -> [u8; 32] {
        let mut bytes = [0; 32];
        let fields = MAGIC.into_iter().chain(self.version.to_le_bytes()).chain(self.minimum_reader.to_le_bytes());
        for (byte, value) in bytes.iter_mut().zip(fields.chain(self.features.to_le_bytes())) {
            *byte = value;
        }
        let sum = xxh3_64(bytes.first_chunk::<24>().unwrap_or(&[0; 24]));
        for (byte, value) in bytes.iter_mut().skip(24).zip(sum.to_le_bytes()) {
            *byte = value;
        }
        bytes
    }

    /// The header, or what is wrong with the bytes.
    pub(in crate::store) fn decode(bytes: &[u8]) -> Result<Self, String> {
        let bytes: &[u8; 32] =
            bytes.try_into().map_err(|_| format!("the header has {} bytes, expected 32", bytes.len()))?;
        let (body, sum) = bytes.split_at(24);
        if !body.starts_with(&MAGIC) {
            return Err("the header does not begin with the store's magic".into());
        }
        if xxh3_64(body).to_le_bytes() != sum {
            return Err("the header's checksum does not match".into());
        }
        let word = |at: usize| body.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes);
        let features = u64::from(word(16)) | u64::from(word(20)) << 32;
        Ok(Self { version: word(8), minimum_reader: word(12), features })
    }
}

/// Whether the voxels of new textures are kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Volumes {
    /// Compressed, without loss.
    #[default]
    Keep,
    /// Not at all: provenance, sums and descriptors only.
    None,
}

/// What a store was made for. The store keeps settings; it is the database that obeys them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// The views that new textures are described by, in order.
    pub views: Vec<ViewCode>,
    /// Whether voxels are kept.
    pub volumes: Volumes,
    /// Further settings by name.
    pub further: BTreeMap<String, String>,
}

/// The counters: rewritten by every commit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::store) struct State {
    /// Grows by one with every commit.
    pub(in crate::store) revision: u64,
    /// The id of the next texture.
    pub(in crate::store) next_id: u64,
    /// The number of textures.
    pub(in crate::store) live: u64,
    /// The number of rows, tombstones included.
    pub(in crate::store) rows: u64,
}

impl State {
    pub(in crate::store) const EMPTY: Self = Self { revision: 0, next_id: 1, live: 0, rows: 0 };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::format::codec;

    #[test]
    fn the_header_is_frozen() {
        let bytes = Header::CURRENT.encode();
        assert_eq!(bytes[..24], *b"hlacdb\r\n\x01\0\0\0\x01\0\0\0\0\0\0\0\0\0\0\0");
        assert_eq!(bytes[24..], xxh3_64(&bytes[..24]).to_le_bytes());
        let header = Header { version: 7, minimum_reader: 3, features: 0x8000_0000_0000_0001 };
        assert_eq!(Header::decode(&header.encode()), Ok(header));
        for bit in 0..256 {
            let mut damaged = bytes;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(Header::decode(&damaged).is_err());
        }
    }
    #[test]
    fn settings_and_state_have_their_golden_bytes() {
        let settings =
            Settings { views: vec![ViewCode(0), ViewCode(7)], volumes: Volumes::None, ..Settings::default() };
        let bytes = [2, 0, 0, 0, 0, 0, 0, 0, 0, 7, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(codec::encode(&settings).as_deref(), Some(&bytes[..]));
        let state = State { revision: 1, next_id: 2, live: 3, rows: 4 };
        let bytes: Vec<u8> = [1_u64, 2, 3, 4].iter().flat_map(|word| word.to_le_bytes()).collect();
        assert_eq!(codec::encode(&state), Some(bytes));
    }
}
