//! Stored voxels: one zstd stream, cut into [chunks](super::chunks).
//!
//! Before compression, voxels may be replaced by their differences along all three axes. This halves the stream for grey
//! levels that change smoothly and lengthens it for labels, so both are tried and the shorter stream is kept.

use crate::store::error::StoreError;
use crate::store::format::chunks;
use crate::store::format::frame::{self, Kind};
use crate::store::format::keys;
use crate::store::format::record::{Content, StoredVoxels, VoxelFilter};
use crate::volume::Volume;

/// The zstd level. Level 1 is the fastest, and the smallest on differences (docs/format.md has the figures).
const LEVEL: i32 = 1;

/// The compressed voxels of a volume and their identity. Compress on a worker thread, before the transaction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CompressedVoxels {
    content: Content,
    filter: VoxelFilter,
    stream: Vec<u8>,
}

impl CompressedVoxels {
    /// Compresses and hashes `volume`. Uses about three times its size in memory.
    ///
    /// # Errors
    /// [`StoreError::Engine`] if zstd fails (out of memory).
    pub fn new(volume: &Volume) -> Result<Self, StoreError> {
        Self::with_content(volume, Content::of(volume))
    }

    /// Compresses `volume`, whose identity is known to be `content`.
    ///
    /// # Errors
    /// As [`CompressedVoxels::new`].
    pub(crate) fn with_content(volume: &Volume, content: Content) -> Result<Self, StoreError> {
        let failed = |error| StoreError::Engine { doing: "compressing voxels", source: Box::new(error) };
        let plain = zstd::bulk::compress(volume.voxels(), LEVEL).map_err(failed)?;
        let mut voxels = volume.voxels().to_vec();
        for stride in strides(&content) {
            differences(&mut voxels, stride);
        }
        let filtered = zstd::bulk::compress(&voxels, LEVEL).map_err(failed)?;
        let (filter, stream) = match filtered.len() < plain.len() {
            true => (VoxelFilter::Differences, filtered),
            false => (VoxelFilter::Plain, plain),
        };
        Ok(Self { content, filter, stream })
    }

    /// Shape, channels and content hash of the volume.
    pub fn content(&self) -> &Content {
        &self.content
    }

    /// The length of the compressed stream in bytes.
    pub fn bytes(&self) -> u64 {
        self.stream.len() as u64
    }

    /// What the record stores about them.
    pub(in crate::store) fn stored(&self) -> StoredVoxels {
        StoredVoxels { bytes: self.bytes(), chunks: self.chunks().len() as u32, filter: self.filter }
    }

    /// The chunks of the stream, in order.
    pub(in crate::store) fn chunks(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        let mut rest = &self.stream[..];
        chunks::cut(self.stream.len(), 0).into_iter().map(move |length| {
            let (chunk, after) = rest.split_at_checked(length).unwrap_or((rest, &[]));
            rest = after;
            chunk
        })
    }
}

/// The value of the `n`-th chunk of the texture `id`.
pub(crate) fn seal_chunk(id: u64, n: u32, chunk: &[u8]) -> Vec<u8> {
    frame::seal(Kind::Voxels, &keys::chunk(id, n), chunk)
}

/// The bytes of the `n`-th chunk of the texture `id`; the error says what is wrong with the value.
pub(crate) fn open_chunk(id: u64, n: u32, value: &[u8]) -> Result<&[u8], String> {
    frame::open(Kind::Voxels, &keys::chunk(id, n), value)
}

/// Decompresses a volume; the error says what is wrong with the stream.
pub(crate) fn expand(content: &Content, filter: VoxelFilter, stream: &[u8]) -> Result<Volume, String> {
    let (Some(bytes), Some(shape)) = (content.byte_count(), content.volume_shape()) else {
        return Err(format!("the shape {:?} exceeds the address space", content.shape));
    };
    let mut voxels = Vec::new();
    voxels.try_reserve_exact(bytes).map_err(|_| format!("{bytes} bytes of voxels do not fit in memory"))?;
    voxels.resize(bytes, 0);
    let expanded = zstd::bulk::decompress_to_buffer(stream, &mut voxels[..])
        .map_err(|error| format!("zstd cannot decompress the voxels: {error}"))?;
    if expanded != bytes {
        return Err(format!("the stream holds {expanded} bytes of voxels, the shape requires {bytes}"));
    }
    if filter == VoxelFilter::Differences {
        for stride in strides(content) {
            running_sums(&mut voxels, stride);
        }
    }
    Volume::new(shape, usize::from(content.channels), voxels).map_err(|error| error.to_string())
}

/// The distance in memory of neighbours along X, Y and Z. The volume must fit in memory.
fn strides(content: &Content) -> [usize; 3] {
    let [_, y, x] = content.shape.map(|side| side as usize);
    let channels = usize::from(content.channels);
    [channels, x * channels, y * x * channels]
}

/// Each byte becomes its difference, modulo 256, from the one `stride` before it; the first `stride` bytes stay.
fn differences(voxels: &mut [u8], stride: usize) {
    for i in (stride..voxels.len()).rev() {
        voxels[i] = voxels[i].wrapping_sub(voxels[i - stride]);
    }
}

/// Undoes [`differences`]. Both are linear, so the order of the strides does not matter.
fn running_sums(voxels: &mut [u8], stride: usize) {
    for i in stride..voxels.len() {
        voxels[i] = voxels[i].wrapping_add(voxels[i - stride]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round_trip(volume: &Volume) -> CompressedVoxels {
        let compressed = CompressedVoxels::new(volume).unwrap();
        let back = expand(compressed.content(), compressed.filter, &compressed.stream);
        assert_eq!(back.as_ref(), Ok(volume));
        compressed
    }

    #[test]
    fn smooth_levels_are_stored_as_differences_and_labels_unchanged() {
        let smooth = |z: usize, y: usize, x: usize| ((z * z + 3 * y + x * y / 2) / 3) as u8;
        let smooth = round_trip(&Volume::from_fn([20, 21, 22], smooth).unwrap());
        assert_eq!(smooth.filter, VoxelFilter::Differences);
        let labels = |z: usize, y: usize, x: usize| if (z * 7 + y * 5 + x * 3) % 31 < 15 { 255 } else { 0 };
        let labels = round_trip(&Volume::from_fn([20, 21, 22], labels).unwrap());
        assert_eq!(labels.filter, VoxelFilter::Plain);
        let colours = (0..3 * 4 * 5 * 3).map(|i| (i * i) as u8).collect();
        round_trip(&Volume::new([3, 4, 5], 3, colours).unwrap());
    }

    #[test]
    fn differences_are_as_the_format_says() {
        // Shape (3, 3, 3): one voxel is set, at (1, 1, 1), so eight values of alternating sign follow it.
        let mut voxels = [0; 27];
        voxels[13] = 1;
        [1, 3, 9].into_iter().for_each(|stride| differences(&mut voxels, stride));
        let mut expected = [0; 27];
        for (offset, value) in [(0, 1), (1, 255), (3, 255), (4, 1), (9, 255), (10, 1), (12, 1), (13, 255)] {
            expected[13 + offset] = value;
        }
        assert_eq!(voxels, expected);
    }

    #[test]
    fn a_stream_of_another_length_is_refused() {
        let volume = Volume::from_fn([3, 4, 5], |z, y, x| (z + y + x) as u8).unwrap();
        let compressed = CompressedVoxels::new(&volume).unwrap();
        for shape in [[3, 4, 4], [3, 4, 6], [1 << 40, 1 << 20, 3]] {
            let content = Content { shape, ..compressed.content().clone() };
            assert!(expand(&content, compressed.filter, &compressed.stream).is_err(), "{shape:?}");
        }
        let truncated = &compressed.stream[..compressed.stream.len() - 1];
        assert!(expand(compressed.content(), compressed.filter, truncated).is_err());
    }
}
