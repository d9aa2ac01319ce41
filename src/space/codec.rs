//! The binary form of statistics, spaces and priors.
//!
//! ```text
//! magic      4 bytes: what the bytes hold
//! version    u16
//! content
//! checksum   u64: XXH3-64 of all bytes before
//! ```
//!
//! All numbers are little-endian. A list is its length (u32) and its items. A list of large integers is packed: its
//! length (u32), the width in bytes (u8, 1 to 16) that the largest item needs, and each item in two's complement of
//! this width.

use xxhash_rust::xxh3::xxh3_64;

use super::{FeatureForm, FeatureSet, SpaceError};
use crate::hlac::View;

/// Identifies what the bytes hold.
#[derive(Clone, Copy)]
pub(super) struct Header {
    /// Its name in errors.
    pub(super) what: &'static str,
    pub(super) magic: [u8; 4],
    pub(super) version: u16,
}

/// Writes a header, content and the checksum.
pub(super) struct Writer(Vec<u8>);

impl Writer {
    pub(super) fn new(header: Header) -> Self {
        let mut bytes = header.magic.to_vec();
        bytes.extend(header.version.to_le_bytes());
        Self(bytes)
    }

    pub(super) fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn u64(&mut self, value: u64) {
        self.0.extend(value.to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.u64(value.to_bits());
    }

    /// The length of a list. All lists are far shorter than 2^32 items.
    fn length(&mut self, length: usize) {
        self.u32(length as u32);
    }

    pub(super) fn bytes(&mut self, bytes: &[u8]) {
        self.length(bytes.len());
        self.0.extend(bytes);
    }

    pub(super) fn f64s(&mut self, values: &[f64]) {
        self.length(values.len());
        values.iter().for_each(|&value| self.f64(value));
    }

    pub(super) fn packed(&mut self, values: &[i128]) {
        // The bits that differ from the sign bit in any value, and one bit for the sign.
        let used = values.iter().fold(0, |used, &value| used | (value ^ (value >> 127)));
        let width = ((129 - used.leading_zeros()).div_ceil(8) as usize).clamp(1, 16);
        self.length(values.len());
        self.u8(width as u8);
        // Each item is written with all its 16 bytes and the next overwrites the upper ones: copies of fixed size are fast.
        let start = self.0.len();
        self.0.resize(start + values.len() * width + 16, 0);
        for (at, value) in values.iter().enumerate() {
            self.0[start + at * width..][..16].copy_from_slice(&value.to_le_bytes());
        }
        self.0.truncate(start + values.len() * width);
    }

    pub(super) fn finish(mut self) -> Vec<u8> {
        let checksum = xxh3_64(&self.0);
        self.u64(checksum);
        self.0
    }
}

/// Reads content of untrusted bytes.
pub(super) struct Reader<'a> {
    header: Header,
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// Checks magic, version and checksum.
    pub(super) fn new(header: Header, bytes: &'a [u8]) -> Result<Self, SpaceError> {
        let damaged = |found| SpaceError::Damaged { what: header.what, found };
        let (content, checksum) = bytes.split_last_chunk::<8>().ok_or(damaged("it is too short"))?;
        let (magic, rest) = content.split_first_chunk::<4>().ok_or(damaged("it is too short"))?;
        let (version, rest) = rest.split_first_chunk::<2>().ok_or(damaged("it is too short"))?;
        if *magic != header.magic {
            return Err(damaged("it has another magic number"));
        }
        // Checked before the checksum, so that a later version may define another checksum.
        let version = u16::from_le_bytes(*version);
        if version != header.version {
            return Err(SpaceError::Version { what: header.what, found: version, supported: header.version });
        }
        if u64::from_le_bytes(*checksum) != xxh3_64(content) {
            return Err(damaged("its checksum does not match"));
        }
        Ok(Self { header, rest })
    }

    pub(super) fn damaged(&self, found: &'static str) -> SpaceError {
        SpaceError::Damaged { what: self.header.what, found }
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], SpaceError> {
        let (taken, rest) = self.rest.split_at_checked(length).ok_or(self.damaged("it ends too early"))?;
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], SpaceError> {
        let (taken, rest) = self.rest.split_first_chunk::<N>().ok_or(self.damaged("it ends too early"))?;
        self.rest = rest;
        Ok(*taken)
    }

    pub(super) fn u8(&mut self) -> Result<u8, SpaceError> {
        Ok(u8::from_le_bytes(self.array()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32, SpaceError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, SpaceError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    /// A finite number.
    pub(super) fn f64(&mut self) -> Result<f64, SpaceError> {
        let value = f64::from_le_bytes(self.array()?);
        if value.is_finite() { Ok(value) } else { Err(self.damaged("a number in it is not finite")) }
    }

    pub(super) fn bytes(&mut self) -> Result<&'a [u8], SpaceError> {
        let length = self.u32()?;
        self.take(length as usize)
    }

    fn length(&mut self, expected: usize) -> Result<(), SpaceError> {
        if self.u32()? as usize == expected { Ok(()) } else { Err(self.damaged("a list in it has the wrong length")) }
    }

    pub(super) fn f64s(&mut self, length: usize) -> Result<Vec<f64>, SpaceError> {
        self.length(length)?;
        (0..length).map(|_| self.f64()).collect()
    }

    pub(super) fn packed(&mut self, length: usize) -> Result<Vec<i128>, SpaceError> {
        self.length(length)?;
        let width = usize::from(self.u8()?);
        if !(1..=16).contains(&width) {
            return Err(self.damaged("an integer in it has an impossible width"));
        }
        let size = length.checked_mul(width).ok_or(self.damaged("a list in it is too long"))?;
        // Each item is read as 16 bytes; shifting left drops those that follow it, shifting right extends the sign.
        let mut bytes = self.take(size)?.to_vec();
        bytes.resize(size + 16, 0);
        let unpack = |at: usize| {
            let (wide, _) = bytes[at * width..].split_first_chunk().unwrap_or((&[0; 16], &[]));
            i128::from_le_bytes(*wide) << (128 - 8 * width) >> (128 - 8 * width)
        };
        Ok((0..length).map(unpack).collect())
    }

    /// Refuses bytes after the content.
    pub(super) fn finish(self) -> Result<(), SpaceError> {
        if self.rest.is_empty() { Ok(()) } else { Err(self.damaged("something follows its end")) }
    }
}

/// Writes a feature set: form u8, views as a list of u8 codes.
pub(super) fn write_feature_set(writer: &mut Writer, feature_set: &FeatureSet) {
    writer.u8(feature_set.form().code());
    writer.bytes(&feature_set.views().iter().map(|view| view.code()).collect::<Vec<_>>());
}

/// Reads what [`write_feature_set`] wrote.
pub(super) fn read_feature_set(reader: &mut Reader<'_>) -> Result<FeatureSet, SpaceError> {
    let form = FeatureForm::from_code(reader.u8()?).ok_or(reader.damaged("it names an unknown form"))?;
    let views: Option<Vec<_>> = reader.bytes()?.iter().map(|&code| View::from_code(code)).collect();
    let views = views.ok_or(reader.damaged("it names an unknown view"))?;
    // Views are ordered by code, so that equal feature sets have equal bytes.
    let feature_set = FeatureSet::new(form, &views).ok().filter(|feature_set| feature_set.views() == views);
    feature_set.ok_or(reader.damaged("its views are not in order"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HEADER: Header = Header { what: "test", magic: *b"test", version: 3 };

    proptest! {
        #![proptest_config(hlacdb_testing::cases(256))]

        #[test]
        fn packed_integers_come_back(values in proptest::collection::vec(any::<i128>(), 0..20), shift in 0..128_u32) {
            let values: Vec<i128> = values.iter().map(|value| value >> shift).collect();
            let mut writer = Writer::new(HEADER);
            writer.packed(&values);
            let bytes = writer.finish();
            let mut reader = Reader::new(HEADER, &bytes).unwrap();
            prop_assert_eq!(reader.packed(values.len()).unwrap(), values);
            prop_assert!(reader.finish().is_ok());
        }
    }

    #[test]
    fn the_bytes_are_frozen() {
        let mut writer = Writer::new(HEADER);
        writer.u8(7);
        writer.packed(&[-1, 127, -129]);
        writer.f64s(&[1.5]);
        let bytes = writer.finish();
        let expected = [
            b"test\x03\x00\x07".as_slice(),
            &[3, 0, 0, 0, 2, 0xff, 0xff, 0x7f, 0, 0x7f, 0xff],
            &[1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xf8, 0x3f],
        ]
        .concat();
        assert_eq!(bytes[..bytes.len() - 8], expected);
    }

    #[test]
    fn damage_of_any_kind_is_an_error() {
        let mut writer = Writer::new(HEADER);
        writer.f64s(&[f64::NAN]);
        let bytes = writer.finish();
        for length in 0..bytes.len() {
            assert!(Reader::new(HEADER, &bytes[..length]).is_err());
        }
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 4;
            assert!(Reader::new(HEADER, &flipped).is_err());
        }
        assert!(Reader::new(HEADER, &bytes).unwrap().f64s(1).is_err());
        assert!(Reader::new(HEADER, &bytes).unwrap().f64s(2).is_err());
        assert!(Reader::new(HEADER, &bytes).unwrap().finish().is_err());
        let newer = Header { version: 4, ..HEADER };
        assert!(matches!(Reader::new(newer, &bytes), Err(SpaceError::Version { found: 3, supported: 4, .. })));
    }
}
