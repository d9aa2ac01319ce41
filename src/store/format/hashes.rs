//! Entries of `hashes`: the id of the texture with a content hash, and a short checksum over both.

use crate::store::damage::{Damage, DamageKey};
use crate::store::format::frame;
use crate::store::format::tables::HASHES;

/// The id (`u64`), then the short checksum of hash and id.
pub(crate) fn seal(hash: &[u8; 32], id: u64) -> [u8; 12] {
    let mut bytes = [0; 12];
    let sum = frame::short_sum(&[&hash[..], &id.to_le_bytes()].concat());
    for (byte, value) in bytes.iter_mut().zip(id.to_le_bytes().into_iter().chain(sum)) {
        *byte = value;
    }
    bytes
}

/// The id of an entry.
pub(crate) fn open(hash: &[u8; 32], value: &[u8; 12]) -> Result<u64, Damage> {
    let [id @ .., _, _, _, _] = *value;
    let id = u64::from_le_bytes(id);
    match seal(hash, id) == *value {
        true => Ok(id),
        false => Err(Damage::new(HASHES.name, DamageKey::ContentHash(*hash), "the checksum does not match")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_covers_hash_and_id() {
        let value = seal(&[7; 32], 9);
        assert_eq!(value[..8], 9_u64.to_le_bytes());
        assert_eq!(open(&[7; 32], &value), Ok(9));
        assert!(open(&[8; 32], &value).is_err());
        for bit in 0..96 {
            let mut damaged = value;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(open(&[7; 32], &damaged).is_err(), "bit {bit}");
        }
    }
}
