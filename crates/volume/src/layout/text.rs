//! Samples written as text: numbers apart by white space, or bytes as hexadecimal digits.

use std::io::{self, BufReader, Read};

use crate::text::excerpt;
use crate::{SampleType, VolumeError};

/// The longest number.
const LONGEST_WORD: usize = 64;

/// Numbers apart by white space or commas, as the little-endian bytes of their type.
pub(super) struct TextSamples<R> {
    bytes: io::Bytes<BufReader<R>>,
    ty: SampleType,
    /// Bytes of a sample that did not fit into a buffer.
    pending: Vec<u8>,
}

impl<R: Read> TextSamples<R> {
    pub(super) fn new(reader: R, ty: SampleType) -> Self {
        Self { bytes: BufReader::new(reader).bytes(), ty, pending: Vec::new() }
    }

    /// The next word, cut after [`LONGEST_WORD`] bytes; empty at the end.
    fn word(&mut self) -> io::Result<String> {
        let mut word = String::new();
        for byte in self.bytes.by_ref() {
            let byte = byte?;
            if byte.is_ascii_whitespace() || byte == b',' {
                if !word.is_empty() {
                    break;
                }
                continue;
            }
            word.push(char::from(byte));
            if word.len() > LONGEST_WORD {
                break;
            }
        }
        Ok(word)
    }
}

impl<R: Read> Read for TextSamples<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while let Some(place) = buffer.get_mut(filled..).filter(|place| !place.is_empty()) {
            if self.pending.is_empty() {
                let word = self.word()?;
                if word.is_empty() {
                    break;
                }
                let malformed = || {
                    let found = format!("the samples contain \"{}\"", excerpt(&word));
                    VolumeError::malformed(found, format!("the header promises numbers of type {}", self.ty))
                };
                self.pending = sample(&word, self.ty).ok_or_else(|| io::Error::other(malformed()))?;
            }
            let count = self.pending.len().min(place.len());
            for (place, byte) in place.iter_mut().zip(self.pending.drain(..count)) {
                *place = byte;
            }
            filled += count;
        }
        Ok(filled)
    }
}

/// The little-endian bytes of a number; `None` if the word is not a number of the type.
fn sample(word: &str, ty: SampleType) -> Option<Vec<u8>> {
    Some(match ty {
        SampleType::U8 => vec![word.parse().ok()?],
        SampleType::I8 => word.parse::<i8>().ok()?.to_le_bytes().into(),
        SampleType::U16 => word.parse::<u16>().ok()?.to_le_bytes().into(),
        SampleType::I16 => word.parse::<i16>().ok()?.to_le_bytes().into(),
        SampleType::U32 => word.parse::<u32>().ok()?.to_le_bytes().into(),
        SampleType::I32 => word.parse::<i32>().ok()?.to_le_bytes().into(),
        SampleType::U64 => word.parse::<u64>().ok()?.to_le_bytes().into(),
        SampleType::I64 => word.parse::<i64>().ok()?.to_le_bytes().into(),
        SampleType::F16 => half::f16::from_f64(word.parse().ok()?).to_le_bytes().into(),
        SampleType::F32 => word.parse::<f32>().ok()?.to_le_bytes().into(),
        SampleType::F64 => word.parse::<f64>().ok()?.to_le_bytes().into(),
    })
}

/// Bytes written as pairs of hexadecimal digits, with white space anywhere.
pub(super) struct HexBytes<R> {
    bytes: io::Bytes<BufReader<R>>,
}

impl<R: Read> HexBytes<R> {
    pub(super) fn new(reader: R) -> Self {
        Self { bytes: BufReader::new(reader).bytes() }
    }

    /// The next digit; `None` at the end.
    fn digit(&mut self) -> io::Result<Option<u8>> {
        for byte in self.bytes.by_ref() {
            let byte = byte?;
            if byte.is_ascii_whitespace() {
                continue;
            }
            let digit = char::from(byte).to_digit(16).ok_or_else(|| {
                let found = format!("the samples contain the character '{}'", byte.escape_ascii());
                io::Error::other(VolumeError::malformed(found, "the header promises hexadecimal digits"))
            })?;
            return Ok(Some(digit as u8));
        }
        Ok(None)
    }
}

impl<R: Read> Read for HexBytes<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        for (filled, place) in buffer.iter_mut().enumerate() {
            let (Some(high), Some(low)) = (self.digit()?, self.digit()?) else { return Ok(filled) };
            *place = high << 4 | low;
        }
        Ok(buffer.len())
    }
}

#[cfg(test)]
mod tests {
    use super::super::bytes::exactly;
    use super::*;

    fn numbers(text: &str, count: u64, ty: SampleType) -> Result<Vec<u8>, VolumeError> {
        exactly(TextSamples::new(text.as_bytes(), ty), count * ty.size() as u64, false)
    }

    #[test]
    fn numbers_are_apart_by_white_space_or_commas() {
        assert_eq!(numbers(" 1 2,3\n\n255 rest", 4, SampleType::U8).unwrap(), [1, 2, 3, 255]);
        assert_eq!(numbers("-1 256", 2, SampleType::I16).unwrap(), [255, 255, 0, 1]);
        let floats = [0.5_f32.to_le_bytes(), 1e3_f32.to_le_bytes()].concat();
        assert_eq!(numbers("0.5 1e3", 2, SampleType::F32).unwrap(), floats);
        for bad in ["256", "x", "-1", "1.5", &"9".repeat(1000)] {
            let error = numbers(bad, 1, SampleType::U8).unwrap_err();
            assert!(matches!(error, VolumeError::Malformed { .. }), "{bad}");
            assert!(error.to_string().len() < 300, "{error}");
        }
        let short = numbers("1 2", 1 << 37, SampleType::F64);
        assert!(matches!(short, Err(VolumeError::Truncated { found: 16, .. })), "{short:?}");
    }

    #[test]
    fn bytes_are_pairs_of_digits() {
        let hex = |text: &str, count| exactly(HexBytes::new(text.as_bytes()), count, false);
        assert_eq!(hex("00 fF\n1 0rest", 3).unwrap(), [0, 255, 16]);
        assert!(matches!(hex("00 f", 2), Err(VolumeError::Truncated { expected: 2, found: 1 })));
        assert!(matches!(hex("0g", 1), Err(VolumeError::Malformed { .. })));
    }
}
