//! [`NpyWriter`]: an array in C order, value by value.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::marker::PhantomData;
use std::path::Path;

use super::{NpyElement, NpyHeader};

/// Writes an array of a known shape in C order, in constant memory. [`finish`](Self::finish) ends it; an array that is
/// dropped before is incomplete.
///
/// The bytes depend on the shape and the values only: version 1 of the format, little-endian, values from a multiple of 64
/// bytes on.
#[derive(Debug)]
pub struct NpyWriter<T, W> {
    writer: W,
    /// Values still to come.
    missing: u64,
    buffer: Vec<u8>,
    of: PhantomData<T>,
}

impl<T: NpyElement> NpyWriter<T, BufWriter<File>> {
    /// Creates a file, or empties the one that is there, and writes the header.
    ///
    /// # Errors
    /// [`io::Error`].
    pub fn create(path: &Path, shape: &[usize]) -> io::Result<Self> {
        Self::new(BufWriter::new(File::create(path)?), shape)
    }
}

impl<T: NpyElement, W: Write> NpyWriter<T, W> {
    /// Writes the header of an array of these axis lengths.
    ///
    /// # Errors
    /// [`io::Error`] of the writer; of kind [`InvalidInput`](io::ErrorKind::InvalidInput) for more than 32 axes, which
    /// NumPy does not read.
    pub fn new(mut writer: W, shape: &[usize]) -> io::Result<Self> {
        if shape.len() > 32 {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "an array has at most 32 axes"));
        }
        writer.write_all(&NpyHeader::write(T::TYPE, shape))?;
        let missing = shape.iter().fold(1_u64, |count, &length| count.saturating_mul(length as u64));
        Ok(Self { writer, missing, buffer: Vec::new(), of: PhantomData })
    }

    /// Values still to come.
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// Appends values.
    ///
    /// # Errors
    /// [`io::Error`] of the writer; of kind [`InvalidInput`](io::ErrorKind::InvalidInput), with nothing written, if there
    /// are more than the shape holds.
    pub fn push(&mut self, values: &[T]) -> io::Result<()> {
        const CHUNK: usize = 8192;
        let more = || io::Error::new(io::ErrorKind::InvalidInput, "more values than the shape of the array holds");
        self.missing = self.missing.checked_sub(values.len() as u64).ok_or_else(more)?;
        for values in values.chunks(CHUNK) {
            self.buffer.clear();
            values.iter().for_each(|value| value.append_to(&mut self.buffer));
            self.writer.write_all(&self.buffer)?;
        }
        Ok(())
    }

    /// Ends the array, flushes the writer and returns it.
    ///
    /// # Errors
    /// [`io::Error`] of the writer; of kind [`InvalidInput`](io::ErrorKind::InvalidInput) if values are missing.
    pub fn finish(mut self) -> io::Result<W> {
        if self.missing > 0 {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "fewer values than the shape of the array holds"));
        }
        self.writer.flush()?;
        Ok(self.writer)
    }

    /// Appends values and ends the array.
    ///
    /// # Errors
    /// Those of [`push`](Self::push) and [`finish`](Self::finish).
    pub fn finish_with(mut self, values: &[T]) -> io::Result<W> {
        self.push(values)?;
        self.finish()
    }
}
