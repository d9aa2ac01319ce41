//! [`NpyReader`]: the values of an array, in the order of its file.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use super::{NpyElement, NpyHeader};
use crate::layout::{append_promised, open_file};
use crate::{SampleType, VolumeError};

/// Reads an array: its header, then values in the order of the file.
#[derive(Debug)]
pub struct NpyReader<R> {
    reader: R,
    header: NpyHeader,
    /// Values read so far.
    read: u64,
}

impl NpyReader<BufReader<File>> {
    /// Opens a file and reads its header.
    ///
    /// # Errors
    /// Those of [`new`](Self::new); [`VolumeError::NotAFile`] for a folder, pipe or device.
    pub fn open(path: &Path) -> Result<Self, VolumeError> {
        Self::new(BufReader::with_capacity(1 << 20, open_file(path)?))
    }
}

impl<R: Read> NpyReader<R> {
    /// Reads the header at the start of a stream.
    ///
    /// # Errors
    /// Those of [`NpyHeader::read`].
    pub fn new(mut reader: R) -> Result<Self, VolumeError> {
        let header = NpyHeader::read(&mut reader)?;
        Ok(Self { reader, header, read: 0 })
    }

    /// The header.
    pub fn header(&self) -> &NpyHeader {
        &self.header
    }

    /// The next `count` values. Memory grows with the bytes that arrive.
    ///
    /// # Errors
    /// [`VolumeError::Unsupported`] if the array is of another type than `T`; [`VolumeError::Truncated`] if the stream ends
    /// before that many values, or the array has fewer; [`VolumeError::Io`].
    pub fn read<T: NpyElement>(&mut self, count: u64) -> Result<Vec<T>, VolumeError> {
        let (ty, endian) = self.header.element_type()?;
        if ty != T::TYPE || self.header.is_boolean() {
            return Err(VolumeError::Unsupported {
                what: format!("an array of {}", if self.header.is_boolean() { "bool" } else { ty.name() }),
                supported: T::TYPE.name().into(),
            });
        }
        let size = ty.size() as u64;
        let promised = self.header.count().unwrap_or(u64::MAX);
        let [expected, found] = [promised, self.read].map(|values| values.saturating_mul(size));
        if count > promised - self.read {
            return Err(VolumeError::Truncated {
                expected: found.saturating_add(count.saturating_mul(size)),
                found: expected,
            });
        }
        let mut bytes = Vec::new();
        append_promised(&mut self.reader, count.saturating_mul(size), &mut bytes, "the array", expected, found)?;
        self.read += count;
        Ok(bytes.chunks_exact(ty.size()).map(|bytes| T::from_bytes(bytes, endian)).collect())
    }

    /// All values that are left. An array of more than `limit` values is refused before any is read.
    ///
    /// # Errors
    /// Those of [`read`](Self::read); [`VolumeError::Unsupported`] beyond the limit.
    pub fn read_all<T: NpyElement>(&mut self, limit: u64) -> Result<Vec<T>, VolumeError> {
        let count = self.header.count().unwrap_or(u64::MAX);
        if count > limit {
            return Err(VolumeError::Unsupported {
                what: format!("an array of {count} values"),
                supported: format!("up to {limit} values"),
            });
        }
        self.read(count - self.read)
    }

    /// The type of the values; see [`NpyHeader::element_type`].
    ///
    /// # Errors
    /// [`VolumeError::Unsupported`].
    pub fn element_type(&self) -> Result<SampleType, VolumeError> {
        Ok(self.header.element_type()?.0)
    }
}
