//! NumPy arrays of moments and other numbers, as files.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

use crate::error::{Error, ExchangeError};
use crate::hlac::MASK_COUNT;
use crate::volume::npy::{NpyElement, NpyReader, NpyWriter};
use crate::volume::{ReadError, SampleType, Volume, VolumeError, formats};

/// Writes an array of numbers in C order.
///
/// # Errors
/// [`Error::Io`]; [`ExchangeError::Array`] if the number of values is not that of the shape.
pub fn write_npy<T: NpyElement>(path: &Path, shape: &[usize], values: &[T]) -> Result<(), Error> {
    let mut writer = NpyRows::create(path, shape)?;
    writer.push(values)?;
    writer.finish()
}

/// Writes a volume as an array of `u8`: (Z, Y, X), or (Z, Y, X, 3) for colour.
///
/// # Errors
/// [`Error::Io`].
pub fn write_volume(path: &Path, volume: &Volume) -> Result<(), Error> {
    let written = NpyWriter::create(path, &volume_shape(volume)).and_then(|writer| writer.finish_with(volume.voxels()));
    written.map(drop).map_err(|source| Error::file("writing", path, source))
}

/// The axis lengths of a volume's array.
pub(crate) fn volume_shape(volume: &Volume) -> Vec<usize> {
    let mut shape = volume.shape().to_vec();
    if volume.channels() > 1 {
        shape.push(volume.channels());
    }
    shape
}

/// An array that is written row by row, in constant memory.
pub(crate) struct NpyRows<T: NpyElement> {
    path: PathBuf,
    writer: NpyWriter<T, BufWriter<File>>,
}

impl<T: NpyElement> NpyRows<T> {
    /// Creates an array of this shape.
    pub(crate) fn create(path: &Path, shape: &[usize]) -> Result<Self, Error> {
        let writer = NpyWriter::create(path, shape).map_err(|source| Error::file("writing", path, source))?;
        Ok(Self { path: path.to_owned(), writer })
    }

    /// Appends values.
    pub(crate) fn push(&mut self, values: &[T]) -> Result<(), Error> {
        if values.len() as u64 > self.writer.missing() {
            return Err(self.wrong("longer"));
        }
        self.writer.push(values).map_err(|source| Error::file("writing", &self.path, source))
    }

    /// Ends the array, which must be complete.
    pub(crate) fn finish(self) -> Result<(), Error> {
        if self.writer.missing() > 0 {
            return Err(self.wrong("shorter"));
        }
        self.writer.finish().map(drop).map_err(|source| Error::file("writing", &self.path, source))
    }

    fn wrong(&self, found: &str) -> Error {
        let expected = "as many values as the shape holds".to_owned();
        ExchangeError::Array { path: self.path.clone(), found: format!("an array {found} than its shape"), expected }
            .into()
    }
}

/// An array of moments, read row by row in constant memory: the 251 moments of each of V views side by side, as an array of
/// shape (N, 251 V) or (251 V,), `f32` or `f64` of either byte order.
pub struct MomentRows {
    path: PathBuf,
    remaining: u64,
    reader: NpyReader<BufReader<File>>,
    /// The number of values of a row.
    columns: u64,
    /// Whether values are `f64` and not `f32`.
    is_double: bool,
}

impl MomentRows {
    /// Opens an array of one view and reads its header.
    ///
    /// # Errors
    /// [`IngestError::Read`](crate::IngestError::Read) if the file is not an array; [`ExchangeError::Array`] if it has another
    /// shape or type.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::open_views(path, 1)
    }

    /// Opens an array of `views` views, at least 1, and reads its header.
    ///
    /// # Errors
    /// As [`MomentRows::open`].
    pub fn open_views(path: &Path, views: usize) -> Result<Self, Error> {
        let reader = NpyReader::open(path).map_err(|error| not_an_array(path, error))?;
        let header = reader.header();
        let columns = (views * MASK_COUNT) as u64;
        let wrong = |found: String| ExchangeError::Array {
            path: path.to_owned(),
            found,
            expected: format!("an array of shape (N, {columns}) or ({columns},) in C order, of f32 or f64"),
        };
        let remaining = match *header.shape() {
            [found] if found == columns => 1,
            [rows, found] if found == columns => rows,
            _ => return Err(wrong(format!("an array of shape {}", header.shape_text())).into()),
        };
        if header.is_fortran_order() && remaining > 1 {
            return Err(wrong("an array in Fortran order".into()).into());
        }
        let is_double = match reader.element_type() {
            Ok(SampleType::F32) => false,
            Ok(SampleType::F64) => true,
            _ => return Err(wrong(format!("an array of type {}", header.type_text())).into()),
        };
        Ok(Self { path: path.to_owned(), remaining, reader, columns, is_double })
    }

    /// The number of rows that were not read yet.
    pub fn len(&self) -> u64 {
        self.remaining
    }

    /// True if every row was read.
    pub fn is_empty(&self) -> bool {
        self.remaining == 0
    }

    fn row(&mut self) -> Result<Vec<[f32; MASK_COUNT]>, Error> {
        let values = if self.is_double {
            let values = self.reader.read::<f64>(self.columns);
            values.map(|values| values.into_iter().map(|value| value as f32).collect())
        } else {
            self.reader.read::<f32>(self.columns)
        };
        let values = values.map_err(|error| match error {
            VolumeError::Truncated { .. } => Error::from(ExchangeError::Array {
                path: self.path.clone(),
                found: format!("an array without its last {} rows", self.remaining + 1),
                expected: "every row that its header promises".into(),
            }),
            error => not_an_array(&self.path, error),
        })?;
        Ok(values.as_chunks().0.to_vec())
    }
}

fn not_an_array(path: &Path, error: VolumeError) -> Error {
    let error = ReadError::new(path, error);
    Error::from(match formats::find("npy") {
        Some(format) => error.with_format(format.info()),
        None => error,
    })
}

/// The moments of each row, by view.
impl Iterator for MomentRows {
    type Item = Result<Vec<[f32; MASK_COUNT]>, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.remaining = self.remaining.checked_sub(1)?;
        let row = self.row();
        if row.is_err() {
            self.remaining = 0;
        }
        Some(row)
    }
}

/// Reads an array of moments of one view.
///
/// # Errors
/// As [`MomentRows`].
pub fn read_moments(path: &Path) -> Result<Vec<[f32; MASK_COUNT]>, Error> {
    MomentRows::open(path)?.map(|row| Ok(row?.first().copied().unwrap_or([0.0; MASK_COUNT]))).collect()
}
