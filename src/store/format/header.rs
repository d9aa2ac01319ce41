//! The `meta` table: the frozen header, the settings and the counters.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use crate::store::format::codec;
use crate::store::format::descriptors::ViewCode;
use crate::store::format::frame::{self, Kind};

/// The format version that this library writes. It is counted separately from the version of the crate.
pub const FORMAT_VERSION: u32 = 1;
/// The required-feature bits that this library knows.
pub(crate) const KNOWN_FEATURES: u64 = 0;

/// The first bytes of the header entry.
pub(crate) const MAGIC: [u8; 8] = *b"hlacdb\r\n";

/// Keys of the `meta` table.
pub(crate) const KEY_FORMAT: &[u8] = b"format";
pub(crate) const KEY_SETTINGS: &[u8] = b"settings";
pub(crate) const KEY_STATE: &[u8] = b"state";

/// The header entry: 32 bytes whose layout never changes, so that every version of hlacdb can read the format version of
/// every store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    /// The format version of the store.
    pub(crate) version: u32,
    /// The lowest format version whose programs can read the store.
    pub(crate) minimum_reader: u32,
    /// Feature bits that a reader must know.
    pub(crate) features: u64,
}

impl Header {
    /// The header of the stores that this library writes.
    pub(crate) const CURRENT: Self = Self { version: FORMAT_VERSION, minimum_reader: FORMAT_VERSION, features: 0 };

    pub(crate) fn encode(self) -> [u8; 32] {
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

    /// Decodes the header; the error says what is wrong with the bytes.
    pub(crate) fn decode(bytes: &[u8]) -> Result<Self, String> {
        let bytes: &[u8; 32] =
            bytes.try_into().map_err(|_| format!("the header has {} bytes, expected 32", bytes.len()))?;
        let (body, sum) = bytes.split_at(24);
        if !body.starts_with(&MAGIC) {
            return Err("the header does not begin with the magic bytes".into());
        }
        if xxh3_64(body).to_le_bytes() != sum {
            return Err("the header's checksum does not match".into());
        }
        let word = |at: usize| body.get(at..at + 4).and_then(|b| b.try_into().ok()).map_or(0, u32::from_le_bytes);
        let features = u64::from(word(16)) | u64::from(word(20)) << 32;
        Ok(Self { version: word(8), minimum_reader: word(12), features })
    }
}

/// Whether a store keeps the voxels of new textures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Volumes {
    /// Keep them, compressed without loss.
    #[default]
    Keep,
    /// Keep provenance, sums and descriptors only.
    None,
}

/// The settings of a store. The store only keeps them; the database applies them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Settings {
    /// The views of new textures, in order.
    pub views: Vec<ViewCode>,
    /// Whether the voxels of new textures are kept.
    pub volumes: Volumes,
    /// Other settings by name.
    pub further: BTreeMap<String, String>,
}

impl Settings {
    /// The value of the settings in `meta`; `None` if they are longer than a record may be.
    pub(in crate::store) fn seal(&self) -> Option<Vec<u8>> {
        Some(frame::seal(Kind::Settings, KEY_SETTINGS, &codec::encode(self)?))
    }

    /// The settings of a value in `meta`; the error says what is wrong with it.
    pub(in crate::store) fn open(value: &[u8]) -> Result<Self, String> {
        frame::open(Kind::Settings, KEY_SETTINGS, value).and_then(codec::decode)
    }
}

/// The counters, which every commit rewrites.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct State {
    /// Grows by one with every commit.
    pub(crate) revision: u64,
    /// The id of the next texture.
    pub(crate) next_id: u64,
    /// The number of textures.
    pub(crate) live: u64,
    /// The number of rows, tombstones included.
    pub(crate) rows: u64,
}

impl State {
    /// The counters of a store without textures, before its first commit.
    pub(crate) const EMPTY: Self = Self { revision: 0, next_id: 1, live: 0, rows: 0 };

    /// The value of the counters in `meta`.
    pub(crate) fn seal(&self) -> Option<Vec<u8>> {
        Some(frame::seal(Kind::State, KEY_STATE, &codec::encode(self)?))
    }

    /// The counters of a value in `meta`; the error says what is wrong with it.
    pub(crate) fn open(value: &[u8]) -> Result<Self, String> {
        frame::open(Kind::State, KEY_STATE, value).and_then(codec::decode)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
