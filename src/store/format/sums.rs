//! The exact sums of `full@1` of a texture.

use crate::hlac::{MASK_COUNT, Sums};
use crate::store::damage::{Damage, DamageKey};
use crate::store::format::frame::{self, Kind};
use crate::store::format::tables::SUMS;

/// Payload: windows (`u64`), then 251 sums (`u64`).
pub(crate) fn seal(id: u64, sums: &Sums) -> Vec<u8> {
    let mut builder = frame::Builder::new(Kind::Sums, 8 * (MASK_COUNT + 1));
    builder.payload().extend(sums.windows.to_le_bytes());
    builder.payload().extend(sums.values.iter().flat_map(|value| value.to_le_bytes()));
    builder.seal(&id.to_le_bytes())
}

/// The sums of the texture `id`.
pub(crate) fn open(id: u64, value: &[u8]) -> Result<Sums, Damage> {
    let damage = |what: String| Damage::new(SUMS.name, DamageKey::Texture(id), what);
    let payload = frame::open(Kind::Sums, &id.to_le_bytes(), value).map_err(damage)?;
    let (words, left) = payload.as_chunks::<8>();
    let Some((&windows, values)) = words.split_first().filter(|(_, v)| v.len() == MASK_COUNT && left.is_empty()) else {
        return Err(damage(format!(
            "the payload has {} bytes, which is not the length of windows and sums",
            payload.len()
        )));
    };
    let mut sums = Sums { windows: u64::from_le_bytes(windows), ..Sums::ZERO };
    for (sum, &word) in sums.values.iter_mut().zip(values) {
        *sum = u64::from_le_bytes(word);
    }
    Ok(sums)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_have_their_golden_bytes() {
        let mut sums = Sums { windows: 5, ..Sums::ZERO };
        sums.values[250] = 0x0102;
        let value = seal(9, &sums);
        assert_eq!(value.len(), 16 + 2016);
        assert_eq!((&value[..8], value[16]), (&[7, 1, 0, 0, 0xE0, 7, 0, 0][..], 5));
        assert_eq!(value[2024..], [2, 1, 0, 0, 0, 0, 0, 0]);
        assert_eq!(open(9, &value).unwrap(), sums);
        assert!(open(8, &value).is_err());
    }
}
