//! [`Record`]: what is known of one texture, apart from its numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::volume::{Shape, Volume};

/// The identity of a texture's voxels: shape, channels and hash, known together or not at all.
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

    /// The number of voxel bytes: sides times channels; `None` where that is more than this machine can address.
    pub(in crate::store) fn bytes(&self) -> Option<usize> {
        let sides = self.shape.iter().try_fold(u64::from(self.channels), |bytes, &side| bytes.checked_mul(side))?;
        usize::try_from(sides).ok().filter(|&bytes| isize::try_from(bytes).is_ok())
    }

    /// The shape as [`Volume`] has it; `None` where a side is more than this machine can address.
    pub fn volume_shape(&self) -> Option<Shape> {
        let [z, y, x] = self.shape.map(usize::try_from);
        Some([z.ok()?, y.ok()?, x.ok()?])
    }
}

/// Where a texture's samples came from and how they became voxels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// The kind of file or producer: `nrrd`, `tiff`, `synthetic`, ...
    pub kind: String,
    /// The type of the samples in the file: `u8`, `u16`, `f32`, ...
    pub samples: String,
    /// How samples became 256 levels; `None` where they were taken as they are.
    pub mapping: Option<RecordedMapping>,
    /// The distance between voxels along (Z, Y, X), as the file gives it.
    pub spacing: Option<[f64; 3]>,
}

/// The rule that mapped deeper samples to 256 levels, and its numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordedMapping {
    /// The rule as it was given: `full`, `auto`, `LO..HI`.
    pub rule: String,
    /// The sample that became 0.
    pub lo: f64,
    /// The sample that became 255.
    pub hi: f64,
}

/// The place of a texture that was cut out of a larger volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Cut {
    /// The first voxel (Z, Y, X) in the larger volume.
    pub offset: [u64; 3],
    /// The shape (Z, Y, X) of the larger volume.
    pub parent: [u64; 3],
}

/// How a texture's voxels are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredVoxels {
    /// The length of the compressed stream in bytes.
    pub bytes: u64,
    /// The number of pieces it is cut into.
    pub pieces: u32,
    /// What was done to the voxels before compression.
    pub filter: VoxelFilter,
}

/// What is done to voxels before compression, and undone after it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum VoxelFilter {
    /// Nothing: best for labels and masks.
    Plain,
    /// Differences modulo 256 along X, Y and Z: best for smooth grey levels.
    Differences,
}

/// What is known of one texture, apart from its numbers. There are no timestamps: the same inputs make the same store.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The texture's id: from 1, ascending in input order, never used again.
    pub id: u64,
    /// The display name.
    pub name: String,
    /// The path it was read from, as raw bytes ([`path_bytes`]); need not be UTF-8.
    pub path: Option<Vec<u8>>,
    /// Shape, channels and hash; `None` where only moments were imported.
    pub content: Option<Content>,
    /// Where the samples came from; `None` where that is not known.
    pub provenance: Option<Provenance>,
    /// The place in a larger volume, where it was cut from one.
    pub cut: Option<Cut>,
    /// Tags: one value per key.
    pub tags: BTreeMap<String, String>,
    /// How the voxels are kept; `None` where they are not.
    pub voxels: Option<StoredVoxels>,
    /// Whether the exact sums of `full@1` are kept.
    pub has_sums: bool,
}

impl Record {
    /// The path it was read from. Outside Unix what is no UTF-8 comes back with replacement characters.
    pub fn path(&self) -> Option<PathBuf> {
        self.path.as_deref().map(path_from_bytes)
    }
}

/// The record as it lies on disk; the id is the key. The order of the fields is frozen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::store) struct StoredRecord {
    pub(in crate::store) name: String,
    pub(in crate::store) path: Option<Vec<u8>>,
    pub(in crate::store) content: Option<Content>,
    pub(in crate::store) provenance: Option<Provenance>,
    pub(in crate::store) cut: Option<Cut>,
    pub(in crate::store) tags: BTreeMap<String, String>,
    pub(in crate::store) voxels: Option<StoredVoxels>,
    pub(in crate::store) has_sums: bool,
}

impl StoredRecord {
    pub(in crate::store) fn with_id(self, id: u64) -> Record {
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

/// A path as the bytes that a record keeps: on Unix its very bytes, elsewhere UTF-8 with replacement characters.
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
    use crate::store::format::codec;

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
            voxels: Some(StoredVoxels { bytes: 6, pieces: 1, filter: VoxelFilter::Differences }),
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
        assert!(codec::decode::<StoredRecord>(&[&expected[..], &[0]].concat()).is_err(), "a byte is left over");
    }

    #[test]
    fn a_lying_length_takes_no_memory() {
        assert!(codec::decode::<StoredRecord>(&words(&[u64::MAX])).is_err());
        assert!(codec::decode::<StoredRecord>(&words(&[1 << 23])).is_err());
    }

    #[test]
    fn a_monstrous_shape_has_no_size() {
        let content = Content { shape: [1 << 40, 1 << 40, 3], channels: 1, hash: [0; 32] };
        assert_eq!(content.bytes(), None);
    }
}
