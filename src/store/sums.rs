//! Exact sums at rest.

use super::StoreError;
use super::frame::{self, Kind};
use crate::hlac::{MASK_COUNT, Sums};

/// Payload: windows (`u64`), then 251 sums (`u64`).
pub(super) fn encode(id: u64, sums: &Sums) -> Vec<u8> {
    let mut builder = frame::Builder::new(Kind::Sums, 8 * (MASK_COUNT + 1));
    builder.payload().extend(sums.windows.to_le_bytes());
    builder.payload().extend(sums.values.iter().flat_map(|value| value.to_le_bytes()));
    builder.seal(&id.to_le_bytes())
}

pub(super) fn decode(id: u64, value: &[u8]) -> Result<Sums, StoreError> {
    let damage = |what: String| StoreError::damage("sums", format!("id {id}"), what);
    let payload = frame::open(Kind::Sums, &id.to_le_bytes(), value).map_err(damage)?;
    let (words, left) = payload.as_chunks::<8>();
    let Some((&windows, values)) = words.split_first().filter(|(_, v)| v.len() == MASK_COUNT && left.is_empty()) else {
        return Err(damage(format!("the sums have {} bytes", payload.len())));
    };
    let mut sums = Sums { windows: u64::from_le_bytes(windows), ..Sums::ZERO };
    for (sum, &word) in sums.values.iter_mut().zip(values) {
        *sum = u64::from_le_bytes(word);
    }
    Ok(sums)
}
