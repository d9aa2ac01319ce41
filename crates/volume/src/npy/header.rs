//! [`NpyHeader`]: the type, order and shape of an array.

use std::io::{self, ErrorKind, Read};

use super::element::{descr, parse_descr};
use crate::text::{Listed, excerpt, excerpt_bytes};
use crate::{Endian, SampleType, VolumeError};

/// The longest header that is read. NumPy itself refuses headers of more than 10 000 bytes.
const LONGEST_HEADER: u32 = 1 << 16;

/// The first bytes of an array.
const MAGIC: &[u8] = b"\x93NUMPY";

/// The header of an array.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NpyHeader {
    descr: String,
    /// Type, byte order, and whether values are truth values; `None` for types that are not read.
    ty: Option<(SampleType, Endian, bool)>,
    fortran_order: bool,
    shape: Vec<u64>,
    length: u64,
}

impl NpyHeader {
    /// Whether bytes begin an array.
    pub(crate) fn sniff(bytes: &[u8]) -> bool {
        bytes.starts_with(MAGIC)
    }

    /// Reads the header at the start of a stream, which is left at the first value.
    ///
    /// # Errors
    /// [`VolumeError::Malformed`], [`VolumeError::Unsupported`] for other format versions than 1 to 3 and for headers of
    /// more than 65 536 bytes, [`VolumeError::Io`].
    pub fn read(reader: &mut impl Read) -> Result<Self, VolumeError> {
        let ended = |source: io::Error| match source.kind() {
            ErrorKind::UnexpectedEof => {
                VolumeError::malformed("the file ends within the header of the array", "values should follow it")
            }
            ErrorKind::InvalidData | ErrorKind::InvalidInput => VolumeError::decode("the header of the array", &source),
            _ => VolumeError::Io { doing: "reading the header of the array", source },
        };
        let mut start = [0; 8];
        reader.read_exact(&mut start).map_err(ended)?;
        let [magic @ .., major, _] = &start;
        if magic != MAGIC {
            let found = format!("the array begins with \"{}\"", excerpt_bytes(magic));
            return Err(VolumeError::malformed(found, "a NumPy array begins with \"\\x93NUMPY\""));
        }
        let mut length = [0; 4];
        let width = if *major == 1 { 2 } else { 4 };
        reader.read_exact(&mut length[..width]).map_err(ended)?;
        let bytes = u32::from_le_bytes(length);
        if !(1..=3).contains(major) || bytes > LONGEST_HEADER {
            return Err(VolumeError::Unsupported {
                what: format!("a NumPy array of format version {major} with a header of {bytes} bytes"),
                supported: format!("versions 1 to 3 with headers of up to {LONGEST_HEADER} bytes"),
            });
        }
        let mut text = vec![0; bytes as usize];
        reader.read_exact(&mut text).map_err(ended)?;
        let text = String::from_utf8_lossy(&text);
        let length = start.len() as u64 + width as u64 + u64::from(bytes);
        Self::parse(&text, length).unwrap_or_else(|| {
            Err(VolumeError::malformed(
                format!("the header of the array is \"{}\"", excerpt(text.trim())),
                "it should be a dictionary of 'descr', 'fortran_order' and 'shape'",
            ))
        })
    }

    /// The header of a text such as `{'descr': '<f4', 'fortran_order': False, 'shape': (64, 64, 64), }`; `None` if it is
    /// not a dictionary of these keys.
    fn parse(text: &str, length: u64) -> Option<Result<Self, VolumeError>> {
        let mut rest = text.trim().strip_prefix('{')?.strip_suffix('}')?.trim();
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        while !rest.is_empty() {
            let (key, after) = rest.split_once(':')?;
            let end = end_of_value(after);
            let value = after.get(..end)?.trim();
            match unquoted(key.trim())? {
                "descr" => descr = Some(unquoted(value).unwrap_or(value).to_owned()),
                "fortran_order" => match truth(value) {
                    Some(truth) => fortran_order = Some(truth),
                    None => return Some(Err(odd("fortran_order", value, "it should be True or False"))),
                },
                "shape" => match lengths(value) {
                    Some(lengths) => shape = Some(lengths),
                    None => return Some(Err(odd("shape", value, "it should be a tuple of whole numbers from 0 on"))),
                },
                _ => {}
            }
            rest = after.get(end..)?.trim_start_matches(',').trim();
        }
        let descr: String = descr?;
        Some(Ok(Self { ty: parse_descr(&descr), descr, fortran_order: fortran_order?, shape: shape?, length }))
    }

    /// The axis lengths, the first axis first; empty for a single value.
    pub fn shape(&self) -> &[u64] {
        &self.shape
    }

    /// The axis lengths as an error shows them: `[3, 4, 5]`, cut after a few.
    pub fn shape_text(&self) -> String {
        Listed(&self.shape).to_string()
    }

    /// The type as the file writes it and as an error shows it: escaped, and cut after a few characters.
    pub fn type_text(&self) -> String {
        excerpt(&self.descr)
    }

    /// Whether the first axis is the fastest. If not, the last one is (C order).
    pub fn is_fortran_order(&self) -> bool {
        self.fortran_order
    }

    /// The type of the values and their byte order. Truth values are `u8`.
    ///
    /// # Errors
    /// [`VolumeError::Unsupported`] for other types than numbers of up to 64 bits.
    pub fn element_type(&self) -> Result<(SampleType, Endian), VolumeError> {
        self.ty.map(|(ty, endian, _)| (ty, endian)).ok_or_else(|| VolumeError::Unsupported {
            what: format!("an array of type {}", excerpt(&self.descr)),
            supported: "bool, i1 to i8, u1 to u8, f2, f4 and f8".into(),
        })
    }

    /// Whether the values are truth values.
    pub fn is_boolean(&self) -> bool {
        self.ty.is_some_and(|(_, _, boolean)| boolean)
    }

    /// The number of values; `None` if it does not fit 64 bits.
    pub fn count(&self) -> Option<u64> {
        self.shape.iter().try_fold(1_u64, |count, &length| count.checked_mul(length))
    }

    /// Bytes of the header in its file.
    pub fn header_bytes(&self) -> u64 {
        self.length
    }

    /// The header of an array in C order, as bytes. The values begin at a multiple of 64 bytes.
    pub(super) fn write(ty: SampleType, shape: &[usize]) -> Vec<u8> {
        const ALIGNMENT: usize = 64;
        let lengths: String = shape.iter().map(|length| format!("{length}, ")).collect();
        let text = format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({lengths}), }}", descr(ty));
        // Version 1 has two bytes for the length of the text; arrays have few enough axes for that.
        let before = MAGIC.len() + 4;
        let padded = (before + text.len() + 1).next_multiple_of(ALIGNMENT) - before;
        let text = format!("{text:<width$}\n", width = padded - 1);
        [MAGIC, &[1, 0], &(text.len() as u16).to_le_bytes(), text.as_bytes()].concat()
    }
}

/// An entry of the header that is not what it should be.
fn odd(key: &str, value: &str, expected: &str) -> VolumeError {
    VolumeError::malformed(format!("the header of the array says '{key}': {}", excerpt(value)), expected)
}

/// Where a value ends: at the first comma outside brackets and quotes, or at the end of the text.
fn end_of_value(text: &str) -> usize {
    let (mut depth, mut quote) = (0_usize, None);
    for (index, byte) in text.bytes().enumerate() {
        match (byte, quote) {
            (_, Some(open)) if byte == open => quote = None,
            (_, Some(_)) => {}
            (b'\'' | b'"', None) => quote = Some(byte),
            (b'(' | b'[' | b'{', None) => depth += 1,
            (b')' | b']' | b'}', None) => depth = depth.saturating_sub(1),
            (b',', None) if depth == 0 => return index,
            _ => {}
        }
    }
    text.len()
}

fn unquoted(text: &str) -> Option<&str> {
    let between = |quote| text.strip_prefix(quote)?.strip_suffix(quote);
    between('\'').or_else(|| between('"'))
}

fn truth(text: &str) -> Option<bool> {
    match text {
        "True" => Some(true),
        "False" => Some(false),
        _ => None,
    }
}

/// The numbers of a tuple, which old writers end with `L`.
fn lengths(text: &str) -> Option<Vec<u64>> {
    let inner = text.strip_prefix('(')?.strip_suffix(')')?.trim();
    let inner = inner.strip_suffix(',').unwrap_or(inner);
    if inner.is_empty() {
        return Some(Vec::new());
    }
    inner.split(',').map(|number| number.trim().trim_end_matches('L').parse().ok()).collect()
}
