//! Voxels at rest: one zstd stream, cut into pieces.

use super::StoreError;
use super::pieces;
use super::record::Content;
use crate::volume::Volume;

/// The zstd level. Measured on real and synthetic 64^3 textures (docs/format.md): higher levels gain little.
const LEVEL: i32 = 3;

/// A volume's voxels, compressed, with their identity: made on a worker thread, before the transaction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CompressedVoxels {
    content: Content,
    stream: Vec<u8>,
}

impl CompressedVoxels {
    /// Compresses and hashes `volume`.
    ///
    /// # Errors
    /// [`StoreError::Engine`] where zstd fails (out of memory).
    pub fn new(volume: &Volume) -> Result<Self, StoreError> {
        let stream = zstd::bulk::compress(volume.voxels(), LEVEL)
            .map_err(|error| StoreError::Engine { doing: "compressing voxels", source: Box::new(error) })?;
        Ok(Self { content: Content::of(volume), stream })
    }

    /// Shape, channels and hash of the volume.
    pub fn content(&self) -> &Content {
        &self.content
    }

    /// The length of the compressed stream in bytes.
    pub fn bytes(&self) -> u64 {
        self.stream.len() as u64
    }

    /// The pieces of the stream, in order.
    pub(super) fn pieces(&self) -> impl ExactSizeIterator<Item = &[u8]> {
        let mut rest = &self.stream[..];
        pieces::cut(self.stream.len(), 0).into_iter().map(move |length| {
            let (piece, after) = rest.split_at_checked(length).unwrap_or((rest, &[]));
            rest = after;
            piece
        })
    }
}

/// The volume whose compressed stream is given; else what is wrong with it.
pub(super) fn expand(content: &Content, stream: &[u8]) -> Result<Volume, String> {
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
    Volume::new(shape, usize::from(content.channels), voxels).map_err(|error| error.to_string())
}
