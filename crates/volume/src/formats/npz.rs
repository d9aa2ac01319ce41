//! Archives of NumPy arrays, `.npz`: zip files whose entries are arrays. One of them must be a volume.

use std::path::Path;

use super::{Format, FormatInfo, Head, VolumeReader};
use crate::{ReadOptions, VolumeError};

pub(super) struct Npz;

static INFO: FormatInfo = FormatInfo::new(
    "npz",
    "NumPy archive",
    "An archive of arrays, exactly one of which has the axes of a volume; stored or deflated.",
)
.extensions(&[".npz"])
.compressions(&["deflate"])
.feature("npz", cfg!(feature = "npz"));

impl Format for Npz {
    fn info(&self) -> &'static FormatInfo {
        &INFO
    }

    /// A zip file whose first entry is an array.
    fn sniff(&self, head: &Head) -> bool {
        const NAME: usize = 30;
        let head = head.bytes();
        let first_name = || {
            let length = usize::from(u16::from_le_bytes(*head.get(26..)?.first_chunk()?));
            head.get(NAME..NAME + length)
        };
        head.starts_with(b"PK\x03\x04") && first_name().is_some_and(|name| name.ends_with(b".npy"))
    }

    #[cfg(feature = "npz")]
    fn open(&self, path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        archive::open(path, options)
    }

    #[cfg(not(feature = "npz"))]
    fn open(&self, _: &Path, _: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        Err(INFO.disabled())
    }
}

#[cfg(feature = "npz")]
mod archive {
    use std::fs::File;
    use std::io::BufReader;
    use std::path::Path;

    use zip::{CompressionMethod, ZipArchive};

    use super::super::{VolumeReader, npy};
    use crate::layout::{Checksum, DataLayout, Encoding, Start, open_file};
    use crate::npy::NpyHeader;
    use crate::text::{Listed, excerpt};
    use crate::{ReadOptions, VolumeError};

    type Archive = ZipArchive<BufReader<File>>;

    pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
        let mut archive = ZipArchive::new(BufReader::new(open_file(path)?)).map_err(damaged)?;
        let (index, header) = volume(&mut archive, path)?;
        let layout = npy::layout(&header, path, 0, options.max_voxels)?;
        let entry = archive.by_index(index).map_err(damaged)?;
        let start = entry.data_start().unwrap_or(u64::MAX);
        let before = header.header_bytes();
        let checksum = Some(Checksum { crc: entry.crc32(), bytes: entry.size(), before });
        match entry.compression() {
            CompressionMethod::Stored => {
                DataLayout { start: Start::At(start.saturating_add(before)), checksum, ..layout }.open()
            }
            _ => {
                let encoding = Encoding::Deflate(entry.compressed_size());
                DataLayout { start: Start::At(start), encoding, skip: before, checksum, ..layout }.open()
            }
        }
    }

    /// The index and header of the one array that is a volume.
    fn volume(archive: &mut Archive, path: &Path) -> Result<(usize, NpyHeader), VolumeError> {
        let (mut names, mut volumes) = (Vec::new(), Vec::new());
        for index in 0..archive.len() {
            let mut entry = archive.by_index(index).map_err(damaged)?;
            let name = String::from_utf8_lossy(entry.name_raw()).into_owned();
            let Some(name) = name.strip_suffix(".npy") else { continue };
            let header = NpyHeader::read(&mut entry)?;
            names.push(format!("{} of shape {}", excerpt(name), Listed(header.shape())));
            // Without a limit: an array that is too large is still the one that is meant.
            if npy::layout(&header, path, 0, u64::MAX).is_ok() {
                volumes.push((index, header));
            }
        }
        match <[_; 1]>::try_from(volumes) {
            Ok([volume]) => Ok(volume),
            Err(volumes) => Err(not_one(&names, volumes.len())),
        }
    }

    fn not_one(names: &[String], volumes: usize) -> VolumeError {
        const LISTED: usize = 8;
        let mut list = names.iter().take(LISTED).cloned().collect::<Vec<_>>().join(", ");
        if names.len() > LISTED {
            list += &format!(" and {} more", names.len() - LISTED);
        }
        let what = format!("an archive of {volumes} arrays that could be a volume ({list})");
        if volumes > 1 {
            return VolumeError::SeveralVolumes { what };
        }
        VolumeError::Unsupported { what, supported: "archives with one".into() }
    }

    fn damaged(source: zip::result::ZipError) -> VolumeError {
        VolumeError::decode("the zip archive", &source)
    }
}

#[cfg(feature = "npz")]
#[cfg(test)]
mod tests {
    use std::io::Write;

    use zip::write::SimpleFileOptions;

    use crate::testing::{Folder, encode, npy, npy_header, read, samples, transposed, volume};
    use crate::{Endian, SampleType, VolumeError};

    fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        for (name, bytes) in arrays {
            archive.start_file(*name, SimpleFileOptions::default()).unwrap();
            archive.write_all(bytes).unwrap();
        }
        archive.finish().unwrap().into_inner()
    }

    #[test]
    fn the_one_volume_of_an_archive_is_read() {
        let folder = Folder::new();
        let block = npy(&npy_header("<f4", true, "(3, 4, 5)"), &encode(&transposed(), SampleType::F32, Endian::Little));
        let affine = npy(&npy_header("<f8", false, "(4, 4)"), &[0; 128]);
        let name = npy(&npy_header("<U5", false, "()"), &[0; 20]);
        let texts = npy(&npy_header("<U1", false, "(3, 4, 5)"), &[0; 240]);
        let arrays = [
            ("affine.npy", affine.clone()),
            ("note.txt", vec![0]),
            ("name.npy", name),
            ("t.npy", texts),
            ("block.npy", block),
        ];
        let (found, source) = folder.read("some.dat", npz(&arrays)).unwrap();
        assert_eq!((found, source.format), (volume(), "npz"));

        let none = folder.read("none.npz", npz(&[("affine.npy", affine)])).unwrap_err().to_string();
        assert!(none.contains("an archive of 0 arrays that could be a volume (affine of shape [4, 4])"), "{none}");
        let empty = folder.read("empty.npz", npz(&[])).unwrap_err();
        assert!(matches!(empty, VolumeError::Unsupported { .. }), "{empty}");
    }

    #[test]
    fn a_damaged_archive_is_refused() {
        let folder = Folder::new();
        let block = npy(&npy_header("|u1", false, "(3, 4, 5)"), &encode(&samples(), SampleType::U8, Endian::Little));
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        archive
            .start_file("block.npy", SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored))
            .unwrap();
        archive.write_all(&block).unwrap();
        let whole = archive.finish().unwrap().into_inner();
        let path = folder.write("whole.npz", &whole);
        assert_eq!(read(&path).unwrap().0, volume());
        let mut flipped = whole.clone();
        let sample = 30 + "block.npy".len() + block.len() - 1;
        flipped[sample] ^= 1;
        assert!(matches!(folder.read("flipped.npz", flipped), Err(VolumeError::Decode { .. })));
        assert!(matches!(folder.read("cut.npz", &whole[..whole.len() - 9]), Err(VolumeError::Decode { .. })));
        let short = npz(&[("short.npy", block[..block.len() - 5].to_vec())]);
        assert!(matches!(folder.read("short.npz", short), Err(VolumeError::Truncated { expected: 60, found: 55 })));
    }
}
