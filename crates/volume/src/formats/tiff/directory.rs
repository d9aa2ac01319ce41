//! The directories (IFDs) of a TIFF file and their entries, with nothing taken on trust.
//!
//! The decoder of strips and tiles believes what a directory says, so every directory is checked here before it is
//! decoded. The walk ends on every file: the bytes of all directories together may not be more than the file has, which
//! excludes loops and overlaps.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};

use crate::{Endian, VolumeError};

/// More entries than any writer puts into one directory.
const MOST_ENTRIES: u64 = 4096;

/// The bytes of a tag's values that are read at most: a description or the offsets of a page's strips.
const MOST_VALUE_BYTES: u64 = 1 << 24;

/// The number of a tag.
pub(super) type Tag = u16;

/// The description of a page.
pub(super) const DESCRIPTION: Tag = 270;

/// The header of a TIFF file.
#[derive(Clone, Copy)]
pub(super) struct TiffHeader {
    /// The byte order of all numbers, those of samples included.
    pub(super) endian: Endian,
    /// 64-bit offsets (BigTIFF).
    pub(super) big: bool,
    /// Where the first directory is.
    first: u64,
}

impl TiffHeader {
    /// Whether bytes begin a TIFF or BigTIFF file.
    pub(super) fn sniff(head: &[u8]) -> bool {
        matches!(head, [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..])
    }

    fn read(reader: &mut impl Read) -> Result<Self, VolumeError> {
        let mark: [u8; 4] = array(reader)?;
        if !Self::sniff(&mark) {
            return Err(malformed(
                "the file does not begin as a TIFF file does",
                "II*, MM* or a BigTIFF form of them is expected",
            ));
        }
        let endian = if mark.starts_with(b"I") { Endian::Little } else { Endian::Big };
        let big = mark.contains(&43);
        if !big {
            let first = u64::from(u32_of(endian, array(reader)?));
            return Ok(Self { endian, big, first });
        }
        let sizes = if endian == Endian::Big { [0, 8, 0, 0] } else { [8, 0, 0, 0] };
        if array(reader)? != sizes {
            return Err(malformed("the BigTIFF header gives another size of offsets", "it is always 8 bytes"));
        }
        Ok(Self { endian, big, first: u64_of(endian, array(reader)?) })
    }
}

/// One directory: a page, a thumbnail, or a mask.
pub(super) struct Directory {
    entries: BTreeMap<Tag, Entry>,
}

/// One entry: a tag's values, or where they are.
#[derive(Clone, Copy)]
struct Entry {
    kind: u16,
    count: u64,
    /// The values if they fit (4 bytes, BigTIFF 8), else their offset.
    field: [u8; 8],
}

/// Reads directories one after the other.
pub(super) struct Walker<'a, R> {
    reader: &'a mut R,
    pub(super) header: TiffHeader,
    /// Bytes of the whole file.
    pub(super) length: u64,
    next: u64,
    /// Bytes that the directories seen so far occupy.
    occupied: u64,
}

impl<'a, R: Read + Seek> Walker<'a, R> {
    /// Reads the header at the start of the file.
    pub(super) fn new(reader: &'a mut R) -> Result<Self, VolumeError> {
        let length = reader.seek(SeekFrom::End(0)).map_err(header_io)?;
        reader.seek(SeekFrom::Start(0)).map_err(header_io)?;
        let header = TiffHeader::read(reader)?;
        Ok(Self { reader, header, length, next: header.first, occupied: 0 })
    }

    /// Whether another directory follows.
    pub(super) fn more(&self) -> bool {
        self.next != 0
    }

    /// The next directory; `None` after the last.
    pub(super) fn next_directory(&mut self) -> Result<Option<Directory>, VolumeError> {
        if !self.more() {
            return Ok(None);
        }
        let big = self.header.big;
        self.seek(self.next)?;
        let count = if big { self.u64()? } else { u64::from(self.u16()?) };
        let (frame, entry) = if big { (16, 20) } else { (6, 12) };
        self.occupied = self.occupied.saturating_add(count.saturating_mul(entry).saturating_add(frame));
        if count > MOST_ENTRIES || self.occupied > self.length {
            return Err(malformed(
                "the directories of the TIFF file overlap, loop, or claim to be larger than the file",
                "each page has one of its own",
            ));
        }
        let mut entries = BTreeMap::new();
        for _ in 0..count {
            let (tag, kind) = (self.u16()?, self.u16()?);
            let count = if big { self.u64()? } else { u64::from(self.u32()?) };
            let mut field = [0; 8];
            let inline = if big { &mut field[..] } else { &mut field[..4] };
            self.reader.read_exact(inline).map_err(header_io)?;
            if size_of_kind(kind).is_some() {
                entries.insert(tag, Entry { kind, count, field });
            } else if big {
                // The decoder would misread what follows such an entry.
                return Err(malformed(
                    &format!("tag {tag} of the BigTIFF file has the unknown type {kind}"),
                    "the types are 1 to 13 and 16 to 18",
                ));
            }
        }
        self.next = if big { self.u64()? } else { u64::from(self.u32()?) };
        Ok(Some(Directory { entries }))
    }

    /// The text of a tag up to its first NUL, bytes that are not UTF-8 replaced; `None` if it is absent or not a text.
    pub(super) fn text(&mut self, directory: &Directory, tag: Tag) -> Result<Option<String>, VolumeError> {
        let Some(entry) = directory.entries.get(&tag).copied().filter(|entry| entry.kind == 2) else { return Ok(None) };
        let bytes = self.value(tag, entry)?;
        let text = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
        Ok(Some(String::from_utf8_lossy(text).into_owned()))
    }

    /// The bytes of an entry's values.
    fn value(&mut self, tag: Tag, entry: Entry) -> Result<Vec<u8>, VolumeError> {
        let size = size_of_kind(entry.kind).unwrap_or(1);
        let bytes = entry.count.saturating_mul(size);
        let inline = if self.header.big { 8 } else { 4 };
        if bytes <= inline {
            return Ok(entry.field.iter().copied().take(bytes as usize).collect());
        }
        if bytes > MOST_VALUE_BYTES.min(self.length) {
            return Err(malformed(
                &format!("tag {tag} claims {bytes} bytes of values in a file of {} bytes", self.length),
                "the values of a tag are inside the file",
            ));
        }
        let [a, b, c, d, ..] = entry.field;
        let offset = if self.header.big {
            u64_of(self.header.endian, entry.field)
        } else {
            u64::from(u32_of(self.header.endian, [a, b, c, d]))
        };
        self.seek(offset)?;
        let mut value = vec![0; bytes as usize];
        self.reader.read_exact(&mut value).map_err(header_io)?;
        Ok(value)
    }

    fn seek(&mut self, offset: u64) -> Result<(), VolumeError> {
        if offset >= self.length {
            return Err(VolumeError::Truncated { expected: offset.saturating_add(1), found: self.length });
        }
        self.reader.seek(SeekFrom::Start(offset)).map_err(header_io)?;
        Ok(())
    }

    fn u16(&mut self) -> Result<u16, VolumeError> {
        Ok(u16_of(self.header.endian, array(self.reader)?))
    }

    fn u32(&mut self) -> Result<u32, VolumeError> {
        Ok(u32_of(self.header.endian, array(self.reader)?))
    }

    fn u64(&mut self) -> Result<u64, VolumeError> {
        Ok(u64_of(self.header.endian, array(self.reader)?))
    }
}

/// What only the decoder of pages needs.
#[cfg(feature = "tiff")]
impl<R: Read + Seek> Walker<'_, R> {
    /// The whole numbers of a tag; `None` if it is absent.
    pub(super) fn numbers(&mut self, directory: &Directory, tag: Tag) -> Result<Option<Vec<u64>>, VolumeError> {
        let Some(entry) = directory.entries.get(&tag).copied() else { return Ok(None) };
        let endian = self.header.endian;
        let wrong = || {
            malformed(
                &format!("tag {tag} has values of type {}", entry.kind),
                "whole numbers (types 1, 3, 4, 13, 16, 18) are expected",
            )
        };
        let bytes = self.value(tag, entry)?;
        let numbers = match entry.kind {
            1 => bytes.iter().map(|&byte| u64::from(byte)).collect(),
            3 => bytes.as_chunks().0.iter().map(|&bytes| u64::from(u16_of(endian, bytes))).collect(),
            4 | 13 => bytes.as_chunks().0.iter().map(|&bytes| u64::from(u32_of(endian, bytes))).collect(),
            16 | 18 => bytes.as_chunks().0.iter().map(|&bytes| u64_of(endian, bytes)).collect(),
            _ => return Err(wrong()),
        };
        Ok(Some(numbers))
    }

    /// The one whole number of a tag; `None` if it is absent.
    pub(super) fn number(&mut self, directory: &Directory, tag: Tag) -> Result<Option<u64>, VolumeError> {
        match self.numbers(directory, tag)?.as_deref() {
            None => Ok(None),
            Some([number]) => Ok(Some(*number)),
            Some(other) => Err(malformed(&format!("tag {tag} has {} values", other.len()), "one is expected")),
        }
    }

    /// The one fraction of a tag, as a number; `None` if it is absent or something else.
    pub(super) fn fraction(&mut self, directory: &Directory, tag: Tag) -> Result<Option<f64>, VolumeError> {
        let Some(entry) = directory.entries.get(&tag).copied().filter(|entry| entry.kind == 5 && entry.count == 1)
        else {
            return Ok(None);
        };
        let endian = self.header.endian;
        let bytes = self.value(tag, entry)?;
        let [upper, lower] = bytes.as_chunks().0 else { return Ok(None) };
        Ok(Some(f64::from(u32_of(endian, *upper)) / f64::from(u32_of(endian, *lower))))
    }

    /// The number of values of a tag, 0 if it is absent.
    pub(super) fn count(&self, directory: &Directory, tag: Tag) -> u64 {
        directory.entries.get(&tag).map_or(0, |entry| entry.count)
    }
}

/// Bytes of one value of a type; `None` for types that TIFF does not have.
fn size_of_kind(kind: u16) -> Option<u64> {
    match kind {
        1 | 2 | 6 | 7 => Some(1),
        3 | 8 => Some(2),
        4 | 9 | 11 | 13 => Some(4),
        5 | 10 | 12 | 16 | 17 | 18 => Some(8),
        _ => None,
    }
}

fn array<const N: usize>(reader: &mut impl Read) -> Result<[u8; N], VolumeError> {
    let mut bytes = [0; N];
    reader.read_exact(&mut bytes).map_err(header_io)?;
    Ok(bytes)
}

fn u16_of(endian: Endian, bytes: [u8; 2]) -> u16 {
    if endian == Endian::Big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) }
}

fn u32_of(endian: Endian, bytes: [u8; 4]) -> u32 {
    if endian == Endian::Big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) }
}

fn u64_of(endian: Endian, bytes: [u8; 8]) -> u64 {
    if endian == Endian::Big { u64::from_be_bytes(bytes) } else { u64::from_le_bytes(bytes) }
}

fn header_io(source: io::Error) -> VolumeError {
    if source.kind() == io::ErrorKind::UnexpectedEof {
        return malformed("the file ends within its TIFF header", "it should be whole");
    }
    VolumeError::Io { doing: "reading the TIFF header", source }
}

pub(super) fn malformed(found: &str, expected: &str) -> VolumeError {
    VolumeError::malformed(found, expected)
}
