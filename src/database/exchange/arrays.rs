//! Numpy arrays in and out: moments and points as other programs read them.

use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use npyz::{DType, WriterBuilder};

use crate::error::Error;
use crate::hlac::MASK_COUNT;
use crate::volume::Volume;

/// Writes a C-ordered array of `f32`, `f64` or another plain type.
///
/// # Errors
/// [`Error::Io`]; [`Error::ArrayShape`] where the values do not fill the shape.
pub fn write_npy<T: npyz::AutoSerialize>(path: &Path, shape: &[usize], values: &[T]) -> Result<(), Error> {
    let mut writer = NpyRows::create(path, shape)?;
    writer.push(values)?;
    writer.finish()
}

/// Writes a volume as `u8`: (Z, Y, X), or (Z, Y, X, 3) for colour.
///
/// # Errors
/// [`Error::Io`].
pub fn write_volume(path: &Path, volume: &Volume) -> Result<(), Error> {
    let failed = |source| Error::file("writing", path, source);
    let mut shape: Vec<u64> = volume.shape().map(|side| side as u64).into();
    if volume.channels() > 1 {
        shape.push(volume.channels() as u64);
    }
    let file = BufWriter::new(File::create(path).map_err(failed)?);
    let options = npyz::WriteOptions::new().default_dtype().shape(&shape).writer(file);
    let mut writer = options.begin_nd().map_err(failed)?;
    writer.extend(volume.voxels().iter().copied()).map_err(failed)?;
    writer.finish().map_err(failed)
}

/// The bytes of a C-ordered numpy array.
pub(crate) fn to_npy<T: npyz::AutoSerialize + Copy>(shape: &[usize], values: &[T]) -> std::io::Result<Vec<u8>> {
    let sides: Vec<u64> = shape.iter().map(|&side| side as u64).collect();
    let mut bytes = Vec::new();
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(&sides).writer(&mut bytes).begin_nd()?;
    writer.extend(values.iter().copied())?;
    writer.finish()?;
    Ok(bytes)
}

/// The bytes of a volume as a numpy array, as [`write_volume`] writes them.
pub(crate) fn volume_to_npy(volume: &Volume) -> std::io::Result<Vec<u8>> {
    let mut shape = volume.shape().to_vec();
    if volume.channels() > 1 {
        shape.push(volume.channels());
    }
    to_npy(&shape, volume.voxels())
}

/// A volume as [`write_volume`] wrote it; else what is wrong with it. Takes no more memory than there are bytes to read.
pub(crate) fn volume_from_npy(reader: impl Read) -> Result<Volume, String> {
    let npy = npyz::NpyFile::new(reader).map_err(|error| format!("its array cannot be read: {error}"))?;
    let (shape, channels) = match *npy.shape() {
        [z, y, x] => ([z, y, x], 1),
        [z, y, x, 3] => ([z, y, x], 3),
        ref other => return Err(format!("its array has the shape {other:?}, expected (Z, Y, X) or (Z, Y, X, 3)")),
    };
    let sides = shape.map(|side| usize::try_from(side).unwrap_or(usize::MAX));
    let expected = sides.iter().try_fold(channels, |bytes: usize, &side| bytes.checked_mul(side));
    if npy.order() != npyz::Order::C {
        return Err("its array is not in C order".into());
    }
    let values = npy.data::<u8>().map_err(|error| format!("its array is not of u8: {error}"))?;
    let voxels: Vec<u8> = values.collect::<Result<_, _>>().map_err(|_| "its array ends early".to_owned())?;
    if expected != Some(voxels.len()) {
        return Err(format!("its array has {} bytes, its shape asks for others", voxels.len()));
    }
    Volume::new(sides, channels, voxels).map_err(|error| error.to_string())
}

/// Rows of moments, (N, 251) `f32`; else what is wrong with them. Takes no more memory than there are bytes to read.
pub(crate) fn moments_from_npy(reader: impl Read) -> Result<Vec<[f32; MASK_COUNT]>, String> {
    let npy = npyz::NpyFile::new(reader).map_err(|error| format!("its array cannot be read: {error}"))?;
    if npy.shape().get(1) != Some(&(MASK_COUNT as u64)) || npy.shape().len() != 2 || npy.order() != npyz::Order::C {
        return Err(format!("its array has the shape {:?}, expected (views, {MASK_COUNT})", npy.shape()));
    }
    let values = npy.data::<f32>().map_err(|error| format!("its array is not of f32: {error}"))?;
    let values: Vec<f32> = values.collect::<Result<_, _>>().map_err(|_| "its array ends early".to_owned())?;
    let (rows, _) = values.as_chunks::<MASK_COUNT>();
    Ok(rows.to_vec())
}

/// An array that is written row by row, in constant memory.
pub struct NpyRows<T: npyz::AutoSerialize> {
    path: PathBuf,
    missing: usize,
    writer: npyz::NpyWriter<T, BufWriter<File>>,
}

impl<T: npyz::AutoSerialize> NpyRows<T> {
    /// Begins an array of the given shape.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn create(path: &Path, shape: &[usize]) -> Result<Self, Error> {
        let failed = |source| Error::file("writing", path, source);
        let sides: Vec<u64> = shape.iter().map(|&side| side as u64).collect();
        let file = BufWriter::new(File::create(path).map_err(failed)?);
        let writer = npyz::WriteOptions::new().default_dtype().shape(&sides).writer(file).begin_nd().map_err(failed)?;
        Ok(Self { missing: shape.iter().product(), writer, path: path.to_owned() })
    }

    /// Appends values.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::ArrayShape`] where there are more than the shape holds.
    pub fn push(&mut self, values: &[T]) -> Result<(), Error> {
        self.missing = self.missing.checked_sub(values.len()).ok_or_else(|| self.wrong("longer"))?;
        let written = values.iter().try_for_each(|value| self.writer.push(value));
        written.map_err(|source| Error::file("writing", &self.path, source))
    }

    /// Ends the array.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::ArrayShape`] where values are missing.
    pub fn finish(self) -> Result<(), Error> {
        if self.missing > 0 {
            return Err(self.wrong("shorter"));
        }
        self.writer.finish().map_err(|source| Error::file("writing", &self.path, source))
    }

    fn wrong(&self, found: &str) -> Error {
        let expected = "as many values as the shape holds".to_owned();
        Error::ArrayShape { path: self.path.clone(), found: format!("{found} than its shape"), expected }
    }
}

/// A numpy array of moments, (N, 251 V) or (251 V,), f32 or f64 of either byte order, read row by row in constant memory:
/// the 251 moments of each of V views, side by side.
pub struct MomentRows {
    path: PathBuf,
    left: u64,
    file: BufReader<File>,
    decode: Decode,
    /// The bytes of one row.
    bytes: Vec<u8>,
}

/// Appends the numbers of some bytes.
type Decode = fn(&[u8], &mut Vec<f32>);

impl MomentRows {
    /// Opens an array of one view and reads its header.
    ///
    /// # Errors
    /// [`Error::Io`]; [`Error::ArrayShape`] where the array is of another shape or type.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::open_views(path, 1)
    }

    /// Opens an array of so many views, at least 1, and reads its header.
    ///
    /// # Errors
    /// As [`MomentRows::open`].
    pub fn open_views(path: &Path, views: usize) -> Result<Self, Error> {
        let failed = |source| Error::file("reading", path, source);
        let mut file = BufReader::with_capacity(1 << 20, File::open(path).map_err(failed)?);
        let header = npyz::NpyHeader::from_reader(&mut file).map_err(failed)?;
        let columns = views * MASK_COUNT;
        let wrong = |found: String| Error::ArrayShape {
            path: path.to_owned(),
            found,
            expected: format!("an array of shape (N, {columns}) or ({columns},) in C order, of f32 or f64"),
        };
        let left = match *header.shape() {
            [found] if found == columns as u64 => 1,
            [rows, found] if found == columns as u64 => rows,
            ref other => return Err(wrong(format!("of shape {other:?}"))),
        };
        if header.order() == npyz::Order::Fortran && left > 1 {
            return Err(wrong("in Fortran order".into()));
        }
        let ty = match header.dtype() {
            DType::Plain(ty) => ty,
            other => return Err(wrong(format!("of type {}", other.descr()))),
        };
        let big = ty.endianness() == npyz::Endianness::Big;
        let (decode, width): (Decode, usize) = match (ty.type_char(), ty.num_bytes(), big) {
            (npyz::TypeChar::Float, Some(4), false) => (|b, out| decode(b, out, f32::from_le_bytes), 4),
            (npyz::TypeChar::Float, Some(4), true) => (|b, out| decode(b, out, f32::from_be_bytes), 4),
            (npyz::TypeChar::Float, Some(8), false) => (|b, out| decode(b, out, |v| f64::from_le_bytes(v) as f32), 8),
            (npyz::TypeChar::Float, Some(8), true) => (|b, out| decode(b, out, |v| f64::from_be_bytes(v) as f32), 8),
            _ => return Err(wrong(format!("of type {ty}"))),
        };
        Ok(Self { path: path.to_owned(), left, file, decode, bytes: vec![0; columns * width] })
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
        self.file.read_exact(&mut self.bytes).map_err(|source| match source.kind() {
            std::io::ErrorKind::UnexpectedEof => Error::ArrayShape {
                path: self.path.clone(),
                found: format!("cut short, {} of its rows are not there", self.left + 1),
                expected: "every row that its header promises (fetch or write the file again)".into(),
            },
            _ => Error::file("reading", &self.path, source),
        })?;
        let mut values = Vec::with_capacity(self.bytes.len() / 4);
        (self.decode)(&self.bytes, &mut values);
        Ok(values.as_chunks().0.to_vec())
    }
}

/// Numbers from their bytes.
fn decode<const N: usize>(bytes: &[u8], out: &mut Vec<f32>, number: impl Fn([u8; N]) -> f32) {
    out.extend(bytes.as_chunks::<N>().0.iter().map(|&bytes| number(bytes)));
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
