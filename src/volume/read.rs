//! One door for every kind of file: the kind is told by content first, then by name.

use std::io::Read;
use std::path::Path;

use super::{FileKind, ReadError, ReadOptions, Source, Volume, VolumeError};
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
    read: fn(&Path, &ReadOptions) -> Result<(Volume, Source), VolumeError>,
}

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
/// [`ReadError`] names the file and says what was found, what was expected and what to do; a file that is read without
/// one was complete, and no more than its header's promise was ever held in memory.
pub fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), ReadError> {
    read_any(path, options).map_err(|error| ReadError { path: path.into(), error })
}

fn read_any(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    if path.is_dir() {
        return slices::read(path, options);
    }
    let head = head(path)?;
    if let Some(layout) = options.raw.filter(|_| named(path, BARE)) {
        return raw::read(path, &layout, options);
    }
    let by_content = READERS.iter().find(|reader| (reader.sniff)(&head));
    let by_name = || READERS.iter().find(|reader| named(path, reader.endings));
    match (by_content.or_else(by_name), options.raw) {
        (Some(reader), _) => {
            tracing::debug!(kind = reader.kind.name(), path = %path.display(), "reading");
            (reader.read)(path, options)
        }
        (None, Some(layout)) => raw::read(path, &layout, options),
        (None, None) => Err(VolumeError::UnknownKind { start: printable(&head), known: KNOWN }),
    }
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
