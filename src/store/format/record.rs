//! [`Record`]: what is known of one texture apart from its numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::store::damage::{Damage, DamageKey};
use crate::store::format::codec;
use crate::store::format::frame::{self, Kind};
use crate::store::format::tables::TEXTURES;
use crate::volume::{Shape, Volume};

/// The identity of a texture's voxels: shape, channels and hash.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Content {
    /// Axis lengths (Z, Y, X) in voxels.
    pub shape: [u64; 3],
    /// 1 (grey) or 3 (RGB).
    pub channels: u8,
    /// [`Volume::content_hash`].
    pub hash: [u8; 32],
}

#[cfg(test)]
thread_local!(static HASHES: std::cell::Cell<u64> = const { std::cell::Cell::new(0) });

/// The number of volumes that this thread has hashed.
#[cfg(test)]
pub(crate) fn hashes_made() -> u64 {
    HASHES.with(std::cell::Cell::get)
}

impl Content {
    /// The identity of `volume`; reads every voxel once.
    pub fn of(volume: &Volume) -> Self {
        #[cfg(test)]
        HASHES.with(|hashes| hashes.set(hashes.get() + 1));
        Self {
            shape: volume.shape().map(|side| side as u64),
            channels: volume.channels() as u8,
            hash: volume.content_hash(),
        }
    }

    /// The number of voxel bytes, Z * Y * X * channels; `None` if that is more than this machine can address.
    pub(in crate::store) fn byte_count(&self) -> Option<usize> {
        let sides = self.shape.iter().try_fold(u64::from(self.channels), |bytes, &side| bytes.checked_mul(side))?;
        usize::try_from(sides).ok().filter(|&bytes| isize::try_from(bytes).is_ok())
    }

    /// The shape as a [`Volume`] has it; `None` if a side is more than this machine can address.
    pub fn volume_shape(&self) -> Option<Shape> {
        let [z, y, x] = self.shape.map(usize::try_from);
        Some([z.ok()?, y.ok()?, x.ok()?])
    }
}

/// Where the samples of a texture came from, and how they were mapped to voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// The file format or the producer: `nrrd`, `tiff`, `synthetic`, ...
    pub kind: String,
    /// The type of the samples in the file: `u8`, `u16`, `f32`, ...
    pub samples: String,
    /// How samples were mapped to 256 levels; `None` if they are stored unchanged.
    pub mapping: Option<RecordedMapping>,
    /// The distance between voxels along (Z, Y, X), in the unit of the file.
    pub spacing: Option<[f64; 3]>,
}

/// The rule that mapped samples to 256 levels, and its parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedMapping {
    /// The rule: `full`, `auto` or `LO..HI`.
    pub rule: String,
    /// The sample value that is mapped to 0.
    pub lo: f64,
    /// The sample value that is mapped to 255.
    pub hi: f64,
}

/// The position of a texture that was cut from a larger volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cut {
    /// The position (Z, Y, X) of its first voxel in the larger volume.
    pub offset: [u64; 3],
    /// The shape (Z, Y, X) of the larger volume.
    pub parent: [u64; 3],
}

/// How the voxels of a texture are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredVoxels {
    /// The length of the compressed stream in bytes.
    pub bytes: u64,
    /// The number of chunks that the stream is cut into.
    pub chunks: u32,
    /// The filter that was applied before compression.
    pub filter: VoxelFilter,
}

/// A reversible filter that is applied to voxels before compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum VoxelFilter {
    /// None: best for labels.
    Plain,
    /// Differences modulo 256 along X, Y and Z: best for smooth grey levels.
    Differences,
}

/// What is known of one texture apart from its numbers. It has no timestamps, so that the same inputs make the same store.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The id of the texture: ids start at 1, ascend in input order and are never reused.
    pub id: u64,
    /// The display name.
    pub name: String,
    /// The path that it was read from, as raw bytes ([`path_bytes`]) which need not be UTF-8.
    pub path: Option<Vec<u8>>,
    /// Shape, channels and hash; `None` if only moments were imported.
    pub content: Option<Content>,
    /// Where the samples came from; `None` if that is unknown.
    pub provenance: Option<Provenance>,
    /// The position in a larger volume; `None` if it was not cut from one.
    pub cut: Option<Cut>,
    /// The tags: one value per key.
    pub tags: BTreeMap<String, String>,
    /// How the voxels are stored; `None` if they are not.
    pub voxels: Option<StoredVoxels>,
    /// Whether the exact sums of `full@1` are stored.
    pub has_sums: bool,
}

impl Record {
    /// The path that it was read from. On systems other than Unix, bytes that are not UTF-8 become replacement characters.
    pub fn path(&self) -> Option<PathBuf> {
        self.path.as_deref().map(path_from_bytes)
    }
}

/// The record as it is on disk; the id is its key. The order of the fields is frozen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct StoredRecord {
    pub(crate) name: String,
    pub(crate) path: Option<Vec<u8>>,
    pub(crate) content: Option<Content>,
    pub(crate) provenance: Option<Provenance>,
    pub(crate) cut: Option<Cut>,
    pub(crate) tags: BTreeMap<String, String>,
    pub(crate) voxels: Option<StoredVoxels>,
    pub(crate) has_sums: bool,
}

impl StoredRecord {
    /// The value of the record of texture `id`; `None` if it is longer than a record may be.
    pub(crate) fn seal(&self, id: u64) -> Option<Vec<u8>> {
        Some(frame::seal(Kind::Record, &id.to_le_bytes(), &codec::encode(self)?))
    }

    /// The record of texture `id`.
    pub(crate) fn open(id: u64, value: &[u8]) -> Result<Record, Damage> {
        frame::open(Kind::Record, &id.to_le_bytes(), value)
            .and_then(codec::decode::<Self>)
            .map(|record| record.with_id(id))
            .map_err(|what| Damage::new(TEXTURES.name, DamageKey::Texture(id), what))
    }

    fn with_id(self, id: u64) -> Record {
        let Self { name, path, content, provenance, cut, tags, voxels, has_sums } = self;
        Record { id, name, path, content, provenance, cut, tags, voxels, has_sums }
    }
}

impl From<Record> for StoredRecord {
    fn from(record: Record) -> Self {
        let Record { id: _, name, path, content, provenance, cut, tags, voxels, has_sums } = record;
        Self { name, path, content, provenance, cut, tags, voxels, has_sums }
    }
}

/// A path as a record stores it: its raw bytes on Unix, elsewhere UTF-8 with replacement characters.
pub fn path_bytes(path: &Path) -> Vec<u8> {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        path.as_os_str().as_bytes().to_vec()
    }
    #[cfg(not(unix))]
    {
        path.to_string_lossy().into_owned().into_bytes()
    }
}

fn path_from_bytes(bytes: &[u8]) -> PathBuf {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt;
        PathBuf::from(std::ffi::OsStr::from_bytes(bytes))
    }
    #[cfg(not(unix))]
    {
        PathBuf::from(String::from_utf8_lossy(bytes).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full() -> StoredRecord {
        StoredRecord {
            name: "ab".into(),
            path: Some(vec![b'/', 0xFF]),
            content: Some(Content { shape: [3, 4, 5], channels: 1, hash: [7; 32] }),
            provenance: Some(Provenance {
                kind: "nrrd".into(),
                samples: "u16".into(),
                mapping: Some(RecordedMapping { rule: "full".into(), lo: 0.0, hi: 1.0 }),
                spacing: Some([1.0, 0.0, 0.0]),
            }),
            cut: Some(Cut { offset: [1, 2, 3], parent: [9, 9, 9] }),
            tags: [("k".to_owned(), "v".to_owned())].into(),
            voxels: Some(StoredVoxels { bytes: 6, chunks: 1, filter: VoxelFilter::Differences }),
            has_sums: true,
        }
    }

    /// Little-endian `u64`s.
    fn words(words: &[u64]) -> Vec<u8> {
        words.iter().flat_map(|word| word.to_le_bytes()).collect()
    }

    #[test]
    fn a_record_has_its_golden_bytes() {
        let one = 1.0_f64.to_bits();
        let expected = [
            &words(&[2])[..],
            b"ab\x01",
            &words(&[2]),
            b"/\xFF\x01",
            &words(&[3, 4, 5]),
            &[1],
            &[7; 32],
            &[1],
            &words(&[4]),
            b"nrrd",
            &words(&[3]),
            b"u16\x01",
            &words(&[4]),
            b"full",
            &words(&[0, one]),
            &[1],
            &words(&[one, 0, 0]),
            &[1],
            &words(&[1, 2, 3, 9, 9, 9]),
            &words(&[1, 1]),
            b"k",
            &words(&[1]),
            b"v\x01",
            &words(&[6]),
            &[1, 0, 0, 0, 1, 0, 0, 0, 1],
        ]
        .concat();
        assert_eq!(codec::encode(&full()), Some(expected.clone()));
        assert_eq!(codec::decode(&expected), Ok(full()));
        for length in 0..expected.len() {
            assert!(codec::decode::<StoredRecord>(&expected[..length]).is_err());
        }
        assert!(codec::decode::<StoredRecord>(&[&expected[..], &[0]].concat()).is_err(), "a byte too many");
    }

    #[test]
    fn a_false_length_allocates_nothing() {
        assert!(codec::decode::<StoredRecord>(&words(&[u64::MAX])).is_err());
        assert!(codec::decode::<StoredRecord>(&words(&[1 << 23])).is_err());
    }

    #[test]
    fn a_shape_beyond_the_address_space_has_no_byte_count() {
        let content = Content { shape: [1 << 40, 1 << 40, 3], channels: 1, hash: [0; 32] };
        assert_eq!(content.byte_count(), None);
    }
}
