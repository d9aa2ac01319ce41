//! The one bincode configuration, frozen: little-endian, fixed-width integers, bounded.
//!
//! It is used for small records only; arrays are raw little-endian bytes. Every record is the payload of a
//! [frame](super::frame), which carries version, length and checksum.

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// The longest record in bytes. The decoder fails before it allocates more than this.
pub(crate) const LIMIT: usize = 1 << 24;

const fn configuration() -> Configuration<LittleEndian, Fixint, Limit<LIMIT>> {
    bincode::config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<LIMIT>()
}

/// Encodes a record; `None` if it is longer than [`LIMIT`].
pub(crate) fn encode<T: Serialize>(record: &T) -> Option<Vec<u8>> {
    bincode::serde::encode_to_vec(record, configuration()).ok().filter(|bytes| bytes.len() <= LIMIT)
}

/// Decodes a record, which must use all of `bytes`; the error says what is wrong with them.
pub(crate) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    match bincode::serde::decode_from_slice(bytes, configuration()) {
        Ok((record, used)) if used == bytes.len() => Ok(record),
        Ok((_, used)) => Err(format!("the record ends after {used} of {} bytes", bytes.len())),
        Err(error) => Err(format!("the record cannot be decoded: {error}")),
    }
}
