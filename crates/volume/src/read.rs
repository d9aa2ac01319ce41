//! One door for every kind of file: the kind is told by content first, then by name.

use std::io::Read;
use std::path::Path;

use super::planes::Planes;
use super::{FileKind, RawLayout, ReadError, ReadOptions, Source, Volume, VolumeError};
use super::{decode, metaimage, nifti, npy, nrrd, raw, slices, tiff, vox};

/// The bytes from the start of a file by which its kind is told.
const HEAD: u64 = 4096;

/// The kinds that [`read`] knows, as an error names them.
const KNOWN: &str = "npy, npz, NRRD, MetaImage, NIfTI, TIFF, MagicaVoxel, and folders of PNG, JPEG or TIFF slices";

/// One kind of file: how it is told and how it is read.
struct Reader {
    kind: FileKind,
    /// The ends of names that are of this kind where the content tells nothing; lower case.
    endings: &'static [&'static str],
    /// Whether a file that begins so is of this kind.
    sniff: fn(&[u8]) -> bool,
    read: ReadFile,
}

type ReadFile = fn(&Path, &ReadOptions) -> Result<(Volume, Source), VolumeError>;

/// Every reader of single files, the first that knows the content reads it.
const READERS: &[Reader] = &[
    Reader { kind: FileKind::Npy, endings: &[".npy"], sniff: npy::sniff, read: npy::read },
    Reader { kind: FileKind::Npz, endings: &[".npz"], sniff: npy::sniff_archive, read: npy::read_archive },
    Reader { kind: FileKind::Nrrd, endings: &[".nrrd", ".nhdr"], sniff: nrrd::sniff, read: nrrd::read },
    Reader { kind: FileKind::MetaImage, endings: &[".mha", ".mhd"], sniff: metaimage::sniff, read: metaimage::read },
    Reader { kind: FileKind::Nifti, endings: NIFTI, sniff: nifti::sniff, read: nifti::read },
    Reader { kind: FileKind::Tiff, endings: &[".tif", ".tiff"], sniff: tiff::sniff, read: tiff::read },
    Reader { kind: FileKind::Vox, endings: &[".vox"], sniff: vox::sniff, read: vox::read },
];

const NIFTI: &[&str] = &[".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"];

/// The ends of names that promise bare samples: where a layout is given, what such a file begins with means nothing.
const BARE: &[&str] = &[".raw", ".bin", ".dat"];

/// The volume in a file, and what is known of its origin.
///
/// The kind is told by the content first and by the name only where the content tells nothing. Axes come out as
/// (Z, Y, X) with X fastest, whatever the format's own order.
///
/// # Errors
/// [`ReadError`] names the file and says what was found, what was expected and what to do. A file that is read without
/// one held everything that its header promises; no more than that is ever decoded.
pub fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), ReadError> {
    read_any(path, options).map_err(|error| ReadError { path: path.into(), error })
}

fn read_any(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    match find(path, options)? {
        Found::Slices => slices::read(path, options),
        Found::Bare(layout) => raw::read(path, &layout, options),
        Found::File(reader) => (reader.read)(path, options),
    }
}

/// What a path was found to be.
enum Found {
    Slices,
    Bare(RawLayout),
    File(&'static Reader),
}

fn find(path: &Path, options: &ReadOptions) -> Result<Found, VolumeError> {
    if path.is_dir() {
        return Ok(Found::Slices);
    }
    let head = head(path)?;
    if let Some(layout) = options.raw.filter(|_| named(path, BARE)) {
        return Ok(Found::Bare(layout));
    }
    let by_content = READERS.iter().find(|reader| (reader.sniff)(&head));
    let by_name = || READERS.iter().find(|reader| named(path, reader.endings));
    match (by_content.or_else(by_name), options.raw) {
        (Some(reader), _) => {
            tracing::debug!(kind = reader.kind.name(), path = %path.display(), "reading");
            Ok(Found::File(reader))
        }
        (None, Some(layout)) => Ok(Found::Bare(layout)),
        (None, None) => Err(VolumeError::UnknownKind { start: printable(&head), known: KNOWN }),
    }
}

/// What a path holds for reading it plane by plane, its header read and checked; `None` where the file does not have its
/// samples in the order of Z, or in an encoding that is only read whole.
pub(super) fn planes(path: &Path, options: &ReadOptions) -> Result<Option<Planes>, VolumeError> {
    let kind = match find(path, options)? {
        Found::Slices => return Ok(Some(Planes::Slices(slices::Stack::open(path, options)?))),
        Found::Bare(layout) => return Ok(Planes::of_extent(raw::extent(path, &layout, options)?, false)),
        Found::File(reader) => reader.kind,
    };
    Ok(match kind {
        FileKind::Npy => {
            let array = npy::extent(path, options)?;
            Planes::of_extent(array.extent, array.truth)
        }
        FileKind::Nrrd => Planes::of_extent(nrrd::extent(path, options)?, false),
        FileKind::MetaImage => Planes::of_extent(metaimage::extent(path, options)?, false),
        FileKind::Nifti => Planes::of_extent(nifti::extent(path, options)?, false),
        FileKind::Tiff => Some(Planes::Tiff(Box::new(tiff::Pages::open(path, options)?))),
        _ => None,
    })
}

/// The first bytes of a file, fewer where it is shorter.
fn head(path: &Path) -> Result<Vec<u8>, VolumeError> {
    let io = |source| VolumeError::Io { doing: "opening the file", source };
    let mut head = Vec::new();
    decode::open(path)?.take(HEAD).read_to_end(&mut head).map_err(io)?;
    Ok(head)
}

fn named(path: &Path, endings: &[&str]) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    endings.iter().any(|ending| name.ends_with(ending))
}

/// The first bytes as an error shows them.
fn printable(head: &[u8]) -> String {
    if head.is_empty() {
        return "nothing: it is empty".into();
    }
    format!("\"{}\"", head[..head.len().min(8)].escape_ascii())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Folder, encode, gzip, samples, volume};
    use crate::{Endian, SampleType};

    fn nrrd() -> Vec<u8> {
        let header = b"NRRD0001\ntype: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\n\n";
        [&header[..], &encode(&samples(), SampleType::U8, Endian::Little)].concat()
    }

    #[test]
    fn content_goes_before_the_name() {
        let folder = Folder::new();
        for name in ["a.nrrd", "a.npy", "a.nii.gz", "a.xyz", "a", "a.mha", ".hidden"] {
            let (found, source) = folder.read(name, nrrd()).unwrap();
            assert_eq!((found, source.kind), (volume(), FileKind::Nrrd), "{name}");
        }
    }

    #[test]
    fn where_content_tells_nothing_the_name_says_what_was_expected() {
        let folder = Folder::new();
        for (name, expected) in [
            ("a.npy", "a numpy array begins with"),
            ("a.NPZ", "the zip archive cannot be decoded"),
            ("a.nrrd", "a NRRD begins with"),
            ("a.mha", "every line of it should be `Key = value`"),
            ("a.nii", "a NIfTI header begins with"),
            ("a.txt", "the kind of file is not known (it begins with \"some tex\")"),
        ] {
            let error = folder.read(name, b"some text\n\n").unwrap_err().to_string();
            assert!(error.contains(expected), "{name}: {error}");
        }
        let empty = folder.read("empty", b"").unwrap_err().to_string();
        assert!(empty.contains("nothing: it is empty"), "{empty}");
        assert!(matches!(folder.read("a.gz", gzip(b"no NIfTI")), Err(VolumeError::UnknownKind { .. })));
    }

    #[test]
    fn an_error_names_the_file_and_its_causes() {
        let folder = Folder::new();
        let error = read(&folder.path().join("none\n.npy"), &ReadOptions::default()).unwrap_err();
        assert!(error.to_string().ends_with("none\\n.npy: opening the file failed"), "{error}");
        let cause = std::error::Error::source(&error).unwrap();
        assert!(cause.downcast_ref::<std::io::Error>().is_some(), "{cause}");
    }

    #[test]
    fn the_limit_is_the_callers() {
        let folder = Folder::new();
        let path = folder.write("a.nrrd", nrrd());
        let limited = |max_voxels| read(&path, &ReadOptions { max_voxels, ..ReadOptions::default() });
        assert!(limited(60).is_ok());
        let error = limited(59).unwrap_err().error;
        assert!(matches!(error, VolumeError::TooLarge { voxels: 60, limit: 59 }), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_regular_file_is_refused_without_waiting() {
        let folder = Folder::new();
        let pipe = folder.path().join("pipe.npy");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        if made.is_ok_and(|status| status.success()) {
            let error = read(&pipe, &ReadOptions::default()).unwrap_err().error;
            assert!(matches!(error, VolumeError::Unsupported { .. }), "{error}");
        }
        let error = read(Path::new("/dev/zero"), &ReadOptions::default()).unwrap_err().error;
        assert!(matches!(error, VolumeError::Unsupported { .. }), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_is_not_utf_8_is_a_name() {
        use std::os::unix::ffi::OsStrExt;
        let folder = Folder::new();
        let odd = std::ffi::OsStr::from_bytes(b"odd\xff.nhdr");
        let path = folder.path().join(odd);
        std::fs::write(&path, nrrd()).unwrap();
        assert_eq!(read(&path, &ReadOptions::default()).unwrap().0, volume());
        let error = read(&path.with_extension("none"), &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("odd\\xff.none"), "{error}");
    }
}
