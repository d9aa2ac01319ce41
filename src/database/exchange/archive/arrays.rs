//! The arrays of an archive, as streams of bytes.

use std::io::Read;

use crate::database::exchange::arrays::volume_shape;
use crate::hlac::MASK_COUNT;
use crate::volume::npy::{NpyElement, NpyReader, NpyWriter};
use crate::volume::{Volume, VolumeError};

/// The bytes of an array in C order.
pub(super) fn to_npy<T: NpyElement>(shape: &[usize], values: &[T]) -> std::io::Result<Vec<u8>> {
    NpyWriter::new(Vec::new(), shape)?.finish_with(values)
}

/// The bytes of a volume's array.
pub(super) fn volume_to_npy(volume: &Volume) -> std::io::Result<Vec<u8>> {
    to_npy(&volume_shape(volume), volume.voxels())
}

/// The volume of an array, or what is wrong with it. Takes no more memory than there are bytes to read.
pub(super) fn volume_from_npy(reader: impl Read) -> Result<Volume, String> {
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

/// The rows of an array of moments, (views, 251), or what is wrong with it. Takes no more memory than there are bytes to read.
pub(super) fn moments_from_npy(reader: impl Read) -> Result<Vec<[f32; MASK_COUNT]>, String> {
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

/// For the fuzzer: both kinds of arrays, from any bytes.
#[cfg(feature = "fuzz")]
pub(super) fn fuzz(bytes: &[u8]) {
    let _ = (volume_from_npy(bytes), moments_from_npy(bytes));
}
