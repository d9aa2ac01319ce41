//! Entries of `tags`: everything is in the key, so that the ids of one tag are found by its prefix. The value is a short
//! checksum of the key.

use crate::store::damage::{Damage, DamageKey};
use crate::store::format::frame;
use crate::store::format::keys;
use crate::store::format::tables::TAGS;

/// `key 0 value 0 id`, the id big-endian so that the ids of one tag ascend in key order.
pub(crate) fn key(key: &str, value: &str, id: u64) -> Vec<u8> {
    let mut bytes = prefix(key, value);
    bytes.extend(id.to_be_bytes());
    bytes
}

/// `key 0 value 0`: the beginning of the keys of one tag.
pub(crate) fn prefix(key: &str, value: &str) -> Vec<u8> {
    let mut bytes = keys::prefix(key);
    bytes.extend_from_slice(value.as_bytes());
    bytes.push(0);
    bytes
}

/// The parts of a key: tag key, tag value, id.
pub(crate) fn parse(bytes: &[u8]) -> Option<(&str, &str, u64)> {
    let (text, id) = bytes.split_last_chunk::<8>()?;
    let text = std::str::from_utf8(text).ok()?.strip_suffix('\0')?;
    let (key, value) = text.split_once('\0')?;
    (!value.contains('\0')).then_some((key, value, u64::from_be_bytes(*id)))
}

/// The value that belongs to a key.
pub(crate) fn seal(key: &[u8]) -> [u8; 4] {
    frame::short_sum(key)
}

/// Tag key, tag value and id of an entry.
pub(crate) fn open<'a>(key: &'a [u8], value: &[u8; 4]) -> Result<(&'a str, &'a str, u64), Damage> {
    parse(key)
        .filter(|_| seal(key) == *value)
        .ok_or_else(|| Damage::new(TAGS.name, DamageKey::Bytes(key.to_vec()), "the checksum does not match"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_have_their_golden_bytes_and_are_parsed() {
        assert_eq!(key("family", "marble", 0x0102), b"family\0marble\0\0\0\0\0\0\0\x01\x02");
        assert_eq!(parse(&key("a", "", 9)), Some(("a", "", 9)));
        assert_eq!(parse(b"a\0b\0\0\0\0"), None);
        assert!(open(b"a\0b\0\0\0\0\0\0\0\0\x09", &[0; 4]).is_err());
    }
}
