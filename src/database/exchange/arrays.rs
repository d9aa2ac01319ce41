//! NumPy arrays in and out: moments and points, as other programs read and write them.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use crate::error::{Error, ExchangeError};
use crate::hlac::MASK_COUNT;
use crate::volume::npy::{NpyElement, NpyReader, NpyWriter};
use crate::volume::{ReadError, SampleType, Volume, VolumeError, formats};

/// Writes a C-ordered array of `f32`, `f64` or another type of numbers.
///
/// # Errors
/// [`Error::Io`]; [`ExchangeError::Array`] where the values do not fill the shape.
pub fn write_npy<T: NpyElement>(path: &Path, shape: &[usize], values: &[T]) -> Result<(), Error> {
    let mut writer = NpyRows::create(path, shape)?;
    writer.push(values)?;
    writer.finish()
}

/// Writes a volume as `u8`: (Z, Y, X), or (Z, Y, X, 3) for colour.
///
/// # Errors
/// [`Error::Io`].
pub fn write_volume(path: &Path, volume: &Volume) -> Result<(), Error> {
    let written = NpyWriter::create(path, &shape_of(volume)).and_then(|writer| writer.finish_with(volume.voxels()));
    written.map(drop).map_err(|source| Error::file("writing", path, source))
}

/// The bytes of a C-ordered array.
pub(crate) fn to_npy<T: NpyElement>(shape: &[usize], values: &[T]) -> std::io::Result<Vec<u8>> {
    NpyWriter::new(Vec::new(), shape)?.finish_with(values)
}

/// The bytes of a volume as an array, as [`write_volume`] writes them.
pub(crate) fn volume_to_npy(volume: &Volume) -> std::io::Result<Vec<u8>> {
    to_npy(&shape_of(volume), volume.voxels())
}

/// The axis lengths of a volume's array.
fn shape_of(volume: &Volume) -> Vec<usize> {
    let mut shape = volume.shape().to_vec();
    if volume.channels() > 1 {
        shape.push(volume.channels());
    }
    shape
}

/// A volume as [`write_volume`] wrote it; else what is wrong with it. Takes no more memory than there are bytes to read.
pub(crate) fn volume_from_npy(reader: impl Read) -> Result<Volume, String> {
    let mut reader = c_ordered(reader)?;
    let (shape, channels) = match *reader.header().shape() {
        [z, y, x] => ([z, y, x], 1),
        [z, y, x, 3] => ([z, y, x], 3),
        _ => return Err(format!("{}, expected (Z, Y, X) or (Z, Y, X, 3)", has_shape(&reader))),
    };
    let sides = shape.map(|side| usize::try_from(side).unwrap_or(usize::MAX));
    let voxels = reader.read_all::<u8>(u64::MAX).map_err(unreadable)?;
    Volume::new(sides, channels, voxels).map_err(|error| error.to_string())
}

/// Rows of moments, (N, 251) `f32`; else what is wrong with them. Takes no more memory than there are bytes to read.
pub(crate) fn moments_from_npy(reader: impl Read) -> Result<Vec<[f32; MASK_COUNT]>, String> {
    let mut reader = c_ordered(reader)?;
    match *reader.header().shape() {
        [_, columns] if columns == MASK_COUNT as u64 => {}
        _ => return Err(format!("{}, expected (views, {MASK_COUNT})", has_shape(&reader))),
    }
    let values = reader.read_all::<f32>(u64::MAX).map_err(unreadable)?;
    Ok(values.as_chunks().0.to_vec())
}

/// The array of a stream, which must be in C order.
fn c_ordered<R: Read>(reader: R) -> Result<NpyReader<R>, String> {
    let reader = NpyReader::new(reader).map_err(unreadable)?;
    if reader.header().is_fortran_order() { Err("its array is not in C order".into()) } else { Ok(reader) }
}

fn has_shape<R: Read>(reader: &NpyReader<R>) -> String {
    format!("its array has the shape {}", reader.header().shape_text())
}

fn unreadable(error: VolumeError) -> String {
    format!("its array cannot be read: {error}")
}

/// An array that is written row by row, in constant memory.
pub struct NpyRows<T: NpyElement> {
    path: PathBuf,
    writer: NpyWriter<T, BufWriter<File>>,
}

impl<T: NpyElement> NpyRows<T> {
    /// Begins an array of the given shape.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn create(path: &Path, shape: &[usize]) -> Result<Self, Error> {
        let writer = NpyWriter::create(path, shape).map_err(|source| Error::file("writing", path, source))?;
        Ok(Self { path: path.to_owned(), writer })
    }

    /// Appends values.
    ///
    /// # Errors
    /// [`Error::Io`]; [`ExchangeError::Array`] where there are more than the shape holds.
    pub fn push(&mut self, values: &[T]) -> Result<(), Error> {
        if values.len() as u64 > self.writer.missing() {
            return Err(self.wrong("longer"));
        }
        self.writer.push(values).map_err(|source| Error::file("writing", &self.path, source))
    }

    /// Ends the array.
    ///
    /// # Errors
    /// [`Error::Io`]; [`ExchangeError::Array`] where values are missing.
    pub fn finish(self) -> Result<(), Error> {
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

/// An array of moments, (N, 251 V) or (251 V,), f32 or f64 of either byte order, read row by row in constant memory:
/// the 251 moments of each of V views, side by side.
pub struct MomentRows {
    path: PathBuf,
    left: u64,
    reader: NpyReader<BufReader<File>>,
    /// Values of a row.
    columns: u64,
    /// Values are `f64`, else `f32`.
    double: bool,
}

impl MomentRows {
    /// Opens an array of one view and reads its header.
    ///
    /// # Errors
    /// [`IngestError::Read`](crate::IngestError::Read) where the file is not an array; [`ExchangeError::Array`] where it has another shape or type.
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
        let left = match *header.shape() {
            [found] if found == columns => 1,
            [rows, found] if found == columns => rows,
            _ => return Err(wrong(format!("an array of shape {}", header.shape_text())).into()),
        };
        if header.is_fortran_order() && left > 1 {
            return Err(wrong("an array in Fortran order".into()).into());
        }
        let double = match reader.element_type() {
            Ok(SampleType::F32) => false,
            Ok(SampleType::F64) => true,
            _ => return Err(wrong(format!("an array of type {}", header.type_text())).into()),
        };
        Ok(Self { path: path.to_owned(), left, reader, columns, double })
    }

    /// How many rows are still to come.
    pub fn len(&self) -> u64 {
        self.left
    }

    /// True once every row was read.
    pub fn is_empty(&self) -> bool {
        self.left == 0
    }

    fn row(&mut self) -> Result<Vec<[f32; MASK_COUNT]>, Error> {
        let values = if self.double {
            let values = self.reader.read::<f64>(self.columns);
            values.map(|values| values.into_iter().map(|value| value as f32).collect())
        } else {
            self.reader.read::<f32>(self.columns)
        };
        let values = values.map_err(|error| match error {
            VolumeError::Truncated { .. } => Error::from(ExchangeError::Array {
                path: self.path.clone(),
                found: format!("an array without its last {} rows", self.left + 1),
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

/// The moments of a row, view after view.
impl Iterator for MomentRows {
    type Item = Result<Vec<[f32; MASK_COUNT]>, Error>;

    fn next(&mut self) -> Option<Self::Item> {
        self.left = self.left.checked_sub(1)?;
        let row = self.row();
        if row.is_err() {
            self.left = 0;
        }
        Some(row)
    }
}

/// A whole array of moments of one view.
///
/// # Errors
/// As [`MomentRows`].
pub fn read_moments(path: &Path) -> Result<Vec<[f32; MASK_COUNT]>, Error> {
    MomentRows::open(path)?.map(|row| Ok(row?.first().copied().unwrap_or([0.0; MASK_COUNT]))).collect()
}

/// Writes a text file whole.
///
/// # Errors
/// [`Error::Io`].
pub fn write_text(path: &Path, text: &str) -> Result<(), Error> {
    let written = File::create(path).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|source| Error::file("writing", path, source))
}
