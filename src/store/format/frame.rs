//! The frame around every value: its kind, its length and its checksum.
//!
//! The engine does not verify checksums on an ordinary read, so every value carries its own. The checksum covers the key
//! as well: an intact value under the wrong key is damage.

use xxhash_rust::xxh3::Xxh3;

/// The number of bytes before the payload.
pub(crate) const HEAD: usize = 16;

/// The kind of a value. The numbers are frozen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Kind {
    Settings = 1,
    State = 2,
    Record = 3,
    Voxels = 4,
    Rows = 5,
    Descriptors = 6,
    Sums = 7,
    Statistics = 8,
    Space = 9,
    PointsLayout = 10,
    Points = 11,
}

impl Kind {
    /// The version of the layout of the payload, counted separately for each kind.
    const fn version(self) -> u8 {
        1
    }
}

/// A frame under construction: the payload is appended in place and [`Builder::seal`] fills in the head.
pub(crate) struct Builder {
    kind: Kind,
    bytes: Vec<u8>,
}

impl Builder {
    pub(crate) fn new(kind: Kind, capacity: usize) -> Self {
        let mut bytes = Vec::with_capacity(HEAD + capacity);
        bytes.resize(HEAD, 0);
        Self { kind, bytes }
    }

    /// The buffer to append the payload to.
    pub(crate) fn payload(&mut self) -> &mut Vec<u8> {
        &mut self.bytes
    }

    /// The finished value for `key`.
    pub(crate) fn seal(mut self, key: &[u8]) -> Vec<u8> {
        let length = (self.bytes.len() - HEAD) as u32;
        let [l0, l1, l2, l3] = length.to_le_bytes();
        let head = [self.kind as u8, self.kind.version(), 0, 0, l0, l1, l2, l3];
        let sum = checksum(&head, key, self.bytes.get(HEAD..).unwrap_or_default());
        for (byte, value) in self.bytes.iter_mut().zip(head.into_iter().chain(sum.to_le_bytes())) {
            *byte = value;
        }
        self.bytes
    }
}

/// The framed value of `payload` for `key`.
pub(crate) fn seal(kind: Kind, key: &[u8], payload: &[u8]) -> Vec<u8> {
    let mut builder = Builder::new(kind, payload.len());
    builder.payload().extend_from_slice(payload);
    builder.seal(key)
}

/// The payload of the value `bytes` at `key`; the error says what is wrong with it.
pub(crate) fn open<'a>(kind: Kind, key: &[u8], bytes: &'a [u8]) -> Result<&'a [u8], String> {
    let Some((head, payload)) = bytes.split_first_chunk::<HEAD>() else {
        return Err(format!("the value has {} bytes, expected at least {HEAD}", bytes.len()));
    };
    let [k, version, f0, f1, l0, l1, l2, l3, c0, c1, c2, c3, c4, c5, c6, c7] = *head;
    let length = u32::from_le_bytes([l0, l1, l2, l3]);
    if payload.len() != length as usize {
        return Err(format!("the payload has {} bytes, expected {length}", payload.len()));
    }
    let sum = checksum(&[k, version, f0, f1, l0, l1, l2, l3], key, payload);
    if sum != u64::from_le_bytes([c0, c1, c2, c3, c4, c5, c6, c7]) {
        return Err("the checksum does not match".into());
    }
    if k != kind as u8 || version != kind.version() || f0 != 0 || f1 != 0 {
        return Err(format!(
            "the value has kind {k} version {version}, expected kind {} version {}",
            kind as u8,
            kind.version()
        ));
    }
    Ok(payload)
}

/// XXH3-64 (seed 0) over the first half of the head, the key and the payload.
fn checksum(head: &[u8; 8], key: &[u8], payload: &[u8]) -> u64 {
    let mut hasher = Xxh3::new();
    hasher.update(head);
    hasher.update(key);
    hasher.update(payload);
    hasher.digest()
}

/// The checksum of entries that are mostly key (`hashes`, `tags`): the low 32 bits of XXH3-64.
pub(crate) fn short_sum(bytes: &[u8]) -> [u8; 4] {
    (xxhash_rust::xxh3::xxh3_64(bytes) as u32).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_its_golden_bytes() {
        let value = seal(Kind::Record, &7_u64.to_le_bytes(), b"payload");
        assert_eq!(value[..8], [3, 1, 0, 0, 7, 0, 0, 0]);
        assert_eq!(value[8..16], [86, 103, 126, 216, 77, 109, 86, 199]);
        let covered = [&value[..8], &7_u64.to_le_bytes(), b"payload"].concat();
        assert_eq!(value[8..16], xxhash_rust::xxh3::xxh3_64(&covered).to_le_bytes());
        assert_eq!(&value[16..], b"payload");
    }

    #[test]
    fn every_flipped_bit_and_every_other_key_is_detected() {
        let key = 7_u64.to_le_bytes();
        let value = seal(Kind::Record, &key, b"payload");
        assert_eq!(open(Kind::Record, &key, &value), Ok(&b"payload"[..]));
        for bit in 0..value.len() * 8 {
            let mut damaged = value.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(open(Kind::Record, &key, &damaged).is_err(), "bit {bit}");
        }
        for length in 0..value.len() {
            assert!(open(Kind::Record, &key, &value[..length]).is_err(), "length {length}");
        }
        assert!(open(Kind::Record, &8_u64.to_le_bytes(), &value).is_err());
        assert!(open(Kind::Sums, &key, &value).is_err());
    }
}
