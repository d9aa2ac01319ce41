//! What is recorded of textures.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use crate::TextureId;
use crate::store::{Cut, NewTexture, Provenance, Record, RecordedMapping, path_bytes};
use crate::volume::{Shape, VolumeSource, display_path};

/// The position of a texture that was cut from a larger volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct BlockOf {
    /// The first voxel (Z, Y, X) in the larger volume.
    pub origin: Shape,
    /// The shape (Z, Y, X) of the larger volume.
    pub shape: Shape,
}

/// What is recorded of a texture when it is added: its name, tags and origin.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Meta {
    /// The name that answers show. It need not be unique.
    pub name: String,
    /// The file or folder it was read from.
    pub path: Option<PathBuf>,
    /// One value per key.
    pub tags: BTreeMap<String, String>,
    /// The file format, the samples and how they were mapped to 256 levels.
    pub source: Option<VolumeSource>,
    /// Its position, if it was cut from a larger volume.
    pub block: Option<BlockOf>,
}

impl Meta {
    /// A texture with this name.
    pub fn named(name: impl Into<String>) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Adds a tag, in place of one with the same key.
    #[must_use]
    pub fn tag(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.tags.insert(key.into(), value.into());
        self
    }

    /// Sets all tags.
    #[must_use]
    pub fn tags(mut self, tags: BTreeMap<String, String>) -> Self {
        self.tags = tags;
        self
    }

    /// Sets the path it was read from.
    #[must_use]
    pub fn path(mut self, path: impl AsRef<Path>) -> Self {
        self.path = Some(path.as_ref().to_path_buf());
        self
    }

    /// Sets where the voxels came from.
    #[must_use]
    pub fn source(mut self, source: VolumeSource) -> Self {
        self.source = Some(source);
        self
    }

    /// Sets the position in a larger volume.
    #[must_use]
    pub fn block(mut self, block: BlockOf) -> Self {
        self.block = Some(block);
        self
    }

    pub(crate) fn into_texture(self) -> NewTexture {
        let provenance = self.source.map(|source| Provenance {
            kind: source.format.to_owned(),
            samples: source.samples.name().to_owned(),
            mapping: source.mapping.map(|mapping| RecordedMapping {
                rule: mapping.rule.to_string(),
                lo: mapping.lo,
                hi: mapping.hi,
            }),
            spacing: source.spacing.map(|spacing| spacing.zyx),
        });
        let wide = |shape: Shape| shape.map(|side| side as u64);
        NewTexture {
            name: self.name,
            path: self.path.as_deref().map(path_bytes),
            tags: self.tags,
            provenance,
            cut: self.block.map(|block| Cut { offset: wide(block.origin), parent: wide(block.shape) }),
            ..NewTexture::default()
        }
    }
}

/// The hash of a texture's shape, channels and voxels; see [`Volume::content_hash`](crate::volume::Volume::content_hash).
/// It is written as 64 hexadecimal digits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ContentHash(pub [u8; 32]);

impl fmt::Display for ContentHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl Serialize for ContentHash {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// What is recorded of a texture: everything but its voxels, sums and moments.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Texture {
    /// Its id.
    pub id: TextureId,
    /// Its name.
    pub name: String,
    /// Axis lengths (Z, Y, X) in voxels; `None` if only moments were imported.
    pub shape: Option<Shape>,
    /// 1 (grey) or 3 (RGB); 0 if only moments were imported.
    pub channels: u8,
    /// One value per key.
    pub tags: BTreeMap<String, String>,
    /// The hash of its content; `None` if only moments were imported.
    pub content: Option<ContentHash>,
    /// The file or folder it was read from.
    #[serde(serialize_with = "path_text")]
    pub path: Option<PathBuf>,
    /// Where its voxels came from.
    pub source: Option<Provenance>,
    /// Its position, if it was cut from a larger volume.
    pub block: Option<BlockOf>,
    /// The compressed size of its voxels in bytes; `None` if they are not stored.
    pub stored_bytes: Option<u64>,
}

fn path_text<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    path.as_deref().map(display_path).serialize(serializer)
}

impl From<Record> for Texture {
    fn from(record: Record) -> Self {
        let narrow = |shape: [u64; 3]| shape.map(|side| usize::try_from(side).unwrap_or(usize::MAX));
        Self {
            id: record.id.into(),
            shape: record.content.as_ref().map(|content| narrow(content.shape)),
            channels: record.content.as_ref().map_or(0, |content| content.channels),
            content: record.content.as_ref().map(|content| ContentHash(content.hash)),
            path: record.path(),
            block: record.cut.map(|cut| BlockOf { origin: narrow(cut.offset), shape: narrow(cut.parent) }),
            stored_bytes: record.voxels.map(|voxels| voxels.bytes),
            name: record.name,
            tags: record.tags,
            source: record.provenance,
        }
    }
}
