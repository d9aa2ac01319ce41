//! The one bincode configuration, frozen: little-endian, fixed-width integers, bounded.
//!
//! Only small records pass here; arrays are raw little-endian bytes elsewhere. Every record lies inside a
//! [frame](super::frame), which carries version, length and checksum.

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// No record is longer; a decoder refuses before it allocates more.
pub(in crate::store) const LIMIT: usize = 1 << 24;

const fn configuration() -> Configuration<LittleEndian, Fixint, Limit<LIMIT>> {
    bincode::config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<LIMIT>()
}

/// The record's bytes; `None` where it is longer than [`LIMIT`].
pub(in crate::store) fn encode<T: Serialize>(record: &T) -> Option<Vec<u8>> {
    bincode::serde::encode_to_vec(record, configuration()).ok().filter(|bytes| bytes.len() <= LIMIT)
}

/// The record, which must take up all of `bytes`; else what is wrong with them.
pub(in crate::store) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    match bincode::serde::decode_from_slice(bytes, configuration()) {
        Ok((record, used)) if used == bytes.len() => Ok(record),
        Ok((_, used)) => Err(format!("the record ends after {used} of {} bytes", bytes.len())),
        Err(error) => Err(format!("the record cannot be decoded: {error}")),
    }
}
