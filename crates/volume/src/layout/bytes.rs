//! [`SampleBytes`]: the decoded bytes of samples, by their place.
//!
//! No more bytes are decoded than the header promises, and memory grows with the bytes that arrive, so a small file that
//! promises a huge volume costs little before it is refused. After the last promised byte one more is read, which makes a
//! decoder verify the checksum of its stream. Data beyond the promise are ignored, in every format.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};

#[cfg(feature = "npz")]
use super::data_layout::Checksum;
use super::data_layout::{DataLayout, Encoding, Start};
use super::decode::{self, open_file};
use crate::VolumeError;

/// The most memory that is taken ahead of the bytes that fill it.
const AHEAD: u64 = 16 << 20;

/// The decoded bytes of the samples of a layout.
pub(super) struct SampleBytes {
    file: File,
    layout: DataLayout,
    /// Where in the file the (encoded) samples begin.
    start: u64,
    /// Bytes of the file.
    pub(super) length: u64,
    stream: Option<Stream>,
}

/// The decoder of a file, and how many bytes it has yielded.
struct Stream {
    reader: Box<dyn Read + Send>,
    position: u64,
}

impl SampleBytes {
    /// Opens the file. Samples that are not compressed must all be there.
    pub(super) fn open(layout: DataLayout) -> Result<Self, VolumeError> {
        let file = open_file(&layout.file)?;
        let length = file.metadata().map_err(finding)?.len();
        let expected = layout.bytes();
        let start = match layout.start {
            Start::At(start) => start,
            Start::FromEnd => length.checked_sub(expected).ok_or(VolumeError::Truncated { expected, found: length })?,
        };
        let found = length.saturating_sub(start);
        if layout.encoding == Encoding::Raw && found < expected {
            return Err(VolumeError::Truncated { expected, found });
        }
        let mut bytes = Self { file, layout, start: start.min(length), length, stream: None };
        // A decoder that this build lacks is an error of the header.
        if !bytes.is_direct() {
            bytes.stream = Some(bytes.begin()?);
        }
        Ok(bytes)
    }

    pub(super) fn layout(&self) -> &DataLayout {
        &self.layout
    }

    /// Whether any bytes can be read without decoding those before them.
    pub(super) fn is_direct(&self) -> bool {
        self.layout.encoding == Encoding::Raw
    }

    /// Appends the `count` bytes from `offset` on, which must lie within the samples.
    pub(super) fn append(&mut self, offset: u64, count: u64, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        let in_order = offset == self.stream.as_ref().map_or(0, |stream| stream.position);
        if self.is_direct() && !(self.has_checksum() && (in_order || offset == 0)) {
            return self.append_direct(offset, count, out);
        }
        let mut stream = match self.stream.take() {
            Some(stream) if stream.position <= offset => stream,
            _ => self.begin()?,
        };
        let (data, expected) = (self.layout.encoding.data(), self.layout.bytes());
        let skipped = io::copy(&mut stream.reader.by_ref().take(offset - stream.position), &mut io::sink());
        stream.position += skipped.map_err(|source| failed(source, data, expected, stream.position))?;
        if stream.position < offset {
            return Err(VolumeError::Truncated { expected, found: stream.position });
        }
        stream.position += append_promised(&mut stream.reader, count, out, data, expected, stream.position)?;
        let checked = self.layout.encoding.is_compressed() || self.has_checksum();
        if checked && stream.position == expected {
            let beyond = stream.reader.by_ref().take(1).read_to_end(&mut Vec::new());
            beyond.map_err(|source| failed(source, data, expected, expected))?;
        }
        self.stream = Some(stream);
        Ok(())
    }

    /// As [`append`](Self::append), by seeking.
    fn append_direct(&mut self, offset: u64, count: u64, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        // The stream shares the position in the file.
        self.stream = None;
        self.file.seek(SeekFrom::Start(self.start + offset)).map_err(finding)?;
        let (data, expected) = (self.layout.encoding.data(), self.layout.bytes());
        append_promised(&mut self.file, count, out, data, expected, offset).map(drop)
    }

    /// A new decoder, positioned at the first sample.
    fn begin(&mut self) -> Result<Stream, VolumeError> {
        let mut file = self.file.try_clone().map_err(finding)?;
        // A checksum of samples that are not compressed covers bytes before them too.
        let before = self.covered_before();
        let skip = self.layout.skip + before;
        file.seek(SeekFrom::Start(self.start - before)).map_err(finding)?;
        let reader = decode::decoder(self.layout.encoding, BufReader::new(file), self.layout.samples)?;
        #[cfg(feature = "npz")]
        let reader: Box<dyn Read + Send> = match self.layout.checksum {
            Some(checksum) => Box::new(Checked { reader, checksum, crc: flate2::Crc::new(), read: 0 }),
            None => reader,
        };
        let mut reader = reader;
        let skipped = io::copy(&mut reader.by_ref().take(skip), &mut io::sink());
        let skipped = skipped.map_err(|source| failed(source, self.layout.encoding.data(), skip, 0))?;
        if skipped < skip {
            return Err(VolumeError::Truncated { expected: skip, found: skipped });
        }
        Ok(Stream { reader, position: 0 })
    }

    /// Bytes before raw samples that their checksum covers.
    fn covered_before(&self) -> u64 {
        #[cfg(feature = "npz")]
        if let Some(checksum) = self.layout.checksum.filter(|_| self.is_direct()) {
            return checksum.before.min(self.start);
        }
        0
    }

    fn has_checksum(&self) -> bool {
        #[cfg(feature = "npz")]
        return self.layout.checksum.is_some();
        #[cfg(not(feature = "npz"))]
        false
    }
}

fn finding(source: io::Error) -> VolumeError {
    VolumeError::Io { doing: "finding the samples", source }
}

/// Appends the next `count` bytes of a reader and returns `count`. `data` names their encoding in errors, of which
/// `expected` bytes are promised and `found` were read before.
pub(crate) fn append_promised(
    reader: &mut impl Read,
    count: u64,
    out: &mut Vec<u8>,
    data: &'static str,
    expected: u64,
    found: u64,
) -> Result<u64, VolumeError> {
    let mut read = 0;
    while read < count {
        // Doubling, so that the bytes are moved few times, but never beyond the promise.
        let more = (count - read).min((out.len() as u64).max(AHEAD));
        reserve(out, more)?;
        let before = out.len();
        let result = reader.by_ref().take(more).read_to_end(out);
        read += (out.len() - before) as u64;
        if result.map_err(|source| failed(source, data, expected, found + read))? == 0 {
            return Err(VolumeError::Truncated { expected, found: found + read });
        }
    }
    Ok(read)
}

/// Takes memory for `more` bytes.
fn reserve(bytes: &mut Vec<u8>, more: u64) -> Result<(), VolumeError> {
    let none = || VolumeError::Io { doing: "taking memory for the samples", source: ErrorKind::OutOfMemory.into() };
    bytes.try_reserve_exact(usize::try_from(more).map_err(|_| none())?).map_err(|_| none())
}

/// Memory for `count` zeros, which is used only as it is written to.
pub(super) fn zeros(count: usize) -> Result<Vec<u8>, VolumeError> {
    reserve(&mut Vec::new(), count as u64)?;
    Ok(vec![0; count])
}

/// Tells the end of the data, damage, and a refusal of the system apart.
fn failed(source: io::Error, data: &'static str, expected: u64, found: u64) -> VolumeError {
    match source.kind() {
        ErrorKind::UnexpectedEof => VolumeError::Truncated { expected, found },
        ErrorKind::InvalidData | ErrorKind::InvalidInput => VolumeError::decode(data, &source),
        _ => match source.downcast::<VolumeError>() {
            Ok(error) => error,
            Err(source) => VolumeError::Io { doing: "reading the samples", source },
        },
    }
}

/// Reads an entry to its end, where its bytes must have the checksum.
#[cfg(feature = "npz")]
struct Checked<R> {
    reader: R,
    checksum: Checksum,
    crc: flate2::Crc,
    read: u64,
}

#[cfg(feature = "npz")]
impl<R: Read> Read for Checked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let left = usize::try_from(self.checksum.bytes - self.read).unwrap_or(usize::MAX);
        let length = buffer.len().min(left);
        let buffer = buffer.get_mut(..length).unwrap_or_default();
        let read = if buffer.is_empty() { 0 } else { self.reader.read(buffer)? };
        self.crc.update(buffer.get(..read).unwrap_or_default());
        self.read += read as u64;
        if read == 0 && self.crc.sum() != self.checksum.crc {
            return Err(io::Error::new(ErrorKind::InvalidData, "the checksum is wrong"));
        }
        Ok(read)
    }
}

/// Exactly `expected` bytes of a reader; with `checked`, one byte more is read, as of data with a checksum.
#[cfg(test)]
pub(super) fn exactly(mut reader: impl Read, expected: u64, checked: bool) -> Result<Vec<u8>, VolumeError> {
    let mut bytes = Vec::new();
    append_promised(&mut reader, expected, &mut bytes, "the data", expected, 0)?;
    if checked {
        let beyond = reader.take(1).read_to_end(&mut Vec::new());
        beyond.map_err(|source| failed(source, "the data", expected, expected))?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_taken_as_bytes_arrive() {
        struct Meter(u64);
        impl Read for Meter {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                assert!(buffer.len() as u64 <= AHEAD.max(self.0), "no more ahead than what has come");
                let read = buffer.len().min(100_000).min((40 << 20) - self.0 as usize);
                self.0 += read as u64;
                Ok(read)
            }
        }
        let short = exactly(Meter(0), 1 << 50, true);
        assert!(matches!(short, Err(VolumeError::Truncated { found, .. }) if found == 40 << 20), "{short:?}");
    }
}
