//! Voxels at rest: one zstd stream, cut into pieces.
//!
//! Before compression, voxels may be replaced by their differences along all three axes. For grey levels that change
//! smoothly this halves the stream; for labels and masks it does harm, so both are tried and the shorter is kept.

use crate::store::error::StoreError;
use crate::store::format::chunks;
use crate::store::format::record::{Content, StoredVoxels, VoxelFilter};
use crate::volume::Volume;

/// The zstd level. On differences, level 1 is both the fastest and the smallest (docs/format.md has the figures).
const LEVEL: i32 = 1;

/// A volume's voxels, compressed, with their identity: made on a worker thread, before the transaction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CompressedVoxels {
    content: Content,
    filter: VoxelFilter,
    stream: Vec<u8>,
}

impl CompressedVoxels {
    /// Compresses and hashes `volume`. Takes about three times its bytes of memory while it works.
    ///
    /// # Errors
    /// [`StoreError::Engine`] where zstd fails (out of memory).
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

    /// Shape, channels and hash of the volume.
    pub fn content(&self) -> &Content {
        &self.content
    }

    /// The length of the compressed stream in bytes.
    pub fn bytes(&self) -> u64 {
        self.stream.len() as u64
    }

    /// What the record says of them.
    pub(in crate::store) fn stored(&self) -> StoredVoxels {
        StoredVoxels { bytes: self.bytes(), pieces: self.pieces().len() as u32, filter: self.filter }
    }

    /// The pieces of the stream, in order.
    pub(in crate::store) fn pieces(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        let mut rest = &self.stream[..];
        chunks::cut(self.stream.len(), 0).into_iter().map(move |length| {
            let (piece, after) = rest.split_at_checked(length).unwrap_or((rest, &[]));
            rest = after;
            piece
        })
    }
}

/// The volume whose compressed stream is given; else what is wrong with it.
pub(in crate::store) fn expand(content: &Content, filter: VoxelFilter, stream: &[u8]) -> Result<Volume, String> {
    let (Some(bytes), Some(shape)) = (content.bytes(), content.volume_shape()) else {
        return Err(format!("the shape {:?} is beyond this machine", content.shape));
    };
    let mut voxels = Vec::new();
    voxels.try_reserve_exact(bytes).map_err(|_| format!("{bytes} bytes of voxels do not fit in memory"))?;
    voxels.resize(bytes, 0);
    let expanded = zstd::bulk::decompress_to_buffer(stream, &mut voxels[..])
        .map_err(|error| format!("zstd refuses the voxels: {error}"))?;
    if expanded != bytes {
        return Err(format!("the stream holds {expanded} bytes of voxels, the shape asks for {bytes}"));
    }
    if filter == VoxelFilter::Differences {
        for stride in strides(content) {
            running_sums(&mut voxels, stride);
        }
    }
    Volume::new(shape, usize::from(content.channels), voxels).map_err(|error| error.to_string())
}

/// How far apart neighbours along X, Y and Z are in memory. Only called for content that has been in memory as a whole.
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

    fn there_and_back(volume: &Volume) -> CompressedVoxels {
        let compressed = CompressedVoxels::new(volume).unwrap();
        let back = expand(compressed.content(), compressed.filter, &compressed.stream);
        assert_eq!(back.as_ref(), Ok(volume));
        compressed
    }

    #[test]
    fn smooth_levels_are_kept_as_differences_and_labels_as_they_are() {
        let smooth = |z: usize, y: usize, x: usize| ((z * z + 3 * y + x * y / 2) / 3) as u8;
        let smooth = there_and_back(&Volume::from_fn([20, 21, 22], smooth).unwrap());
        assert_eq!(smooth.filter, VoxelFilter::Differences);
        let labels = |z: usize, y: usize, x: usize| if (z * 7 + y * 5 + x * 3) % 31 < 15 { 255 } else { 0 };
        let labels = there_and_back(&Volume::from_fn([20, 21, 22], labels).unwrap());
        assert_eq!(labels.filter, VoxelFilter::Plain);
        let colours = (0..3 * 4 * 5 * 3).map(|i| (i * i) as u8).collect();
        there_and_back(&Volume::new([3, 4, 5], 3, colours).unwrap());
    }

    #[test]
    fn differences_are_as_the_format_says() {
        // Shape (3, 3, 3): only the corner (1, 1, 1) is set, so eight signs alternate from there on.
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
        let bitten = &compressed.stream[..compressed.stream.len() - 1];
        assert!(expand(compressed.content(), compressed.filter, bitten).is_err());
    }
}
