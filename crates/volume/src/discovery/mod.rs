//! Which volumes a path stands for: a file for itself, a folder for all that are in it.

mod natural;
mod uploads;

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use walkdir::{DirEntry, WalkDir};

use crate::formats::{self, has_ending};
use crate::{ReadError, VolumeError};

pub use natural::natural_cmp;
pub use uploads::uploaded_volumes;

/// The volumes that a path stands for, in natural order of their names.
///
/// A path that is not a folder is yielded as it is, whatever its name. A folder is walked to its full depth, symbolic links
/// followed:
/// - a folder that is a volume itself (three or more PNG, JPEG or single-page TIFF slices) is yielded before the volumes
///   in it;
/// - files with an extension of the [registry](crate::formats::registry) are yielded, raw samples (`.raw`, `.bin`, `.dat`)
///   only if `raw` is set; files of samples that a header of the same name describes are not;
/// - hidden files and folders and all other files are skipped, with a trace event.
///
/// What cannot be read is an error in its place, once, and the walk goes on: a missing path, a folder without permission, a
/// dangling link, a link to a folder above it. A file that two links lead to is yielded twice.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// for name in ["s10.npy", "s9.npy", "notes.txt"] {
///     std::fs::write(folder.path().join(name), "")?;
/// }
/// let mut discovery = hlacdb_volume::discover(folder.path(), false);
/// let found: Vec<_> = discovery.by_ref().collect::<Result<_, _>>()?;
/// assert!(found[0].ends_with("s9.npy") && found[1].ends_with("s10.npy"));
/// assert_eq!(discovery.skipped(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn discover(path: &Path, raw: bool) -> Discovery {
    let (single, walk) = match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => (None, Some(Walk::new(path, raw))),
        Ok(_) => (Some(Ok(path.to_path_buf())), None),
        Err(source) => {
            let error = VolumeError::Io { doing: "looking for the file", source };
            (Some(Err(ReadError::new(path, error))), None)
        }
    };
    Discovery { single, walk }
}

/// The iterator over the volumes of [`discover`].
#[derive(Debug)]
pub struct Discovery {
    single: Option<Result<PathBuf, ReadError>>,
    walk: Option<Walk>,
}

impl Discovery {
    /// The number of files skipped so far because no format has their extension. Hidden files, slices and the data files of
    /// headers do not count.
    pub fn skipped(&self) -> u64 {
        self.walk.as_ref().map_or(0, |walk| walk.skipped)
    }
}

impl Iterator for Discovery {
    type Item = Result<PathBuf, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.single.take().or_else(|| self.walk.as_mut()?.next())
    }
}

/// A walk through a folder.
#[derive(Debug)]
struct Walk {
    root: PathBuf,
    entries: walkdir::IntoIter,
    raw: bool,
    /// The number of files that are neither volumes nor parts of one.
    skipped: u64,
    /// For every folder from the root down to the current one, the files that make it a volume.
    parts: Vec<HashSet<PathBuf>>,
}

impl Walk {
    fn new(root: &Path, raw: bool) -> Self {
        let walk = WalkDir::new(root).follow_links(true).sort_by(|a, b| natural_cmp(a.file_name(), b.file_name()));
        Self { root: root.into(), entries: walk.into_iter(), raw, skipped: 0, parts: Vec::new() }
    }

    /// What an entry is: nothing, a volume, or an error.
    fn visit(&mut self, entry: Result<DirEntry, walkdir::Error>) -> Option<Result<PathBuf, ReadError>> {
        let entry = match entry {
            Ok(entry) => entry,
            Err(error) => return self.unreadable(error).map(Err),
        };
        if entry.depth() > 0 && is_hidden(entry.file_name()) {
            if entry.file_type().is_dir() {
                self.entries.skip_current_dir();
            }
            return None;
        }
        let found = if entry.file_type().is_dir() { self.enter(&entry) } else { self.is_volume(&entry) };
        if !found && entry.file_type().is_file() && !self.is_part(&entry) {
            self.skipped += u64::from(!is_store(&entry));
            tracing::debug!(path = %entry.path().display(), "skipped: no format has this extension");
        }
        found.then(|| Ok(entry.into_path()))
    }

    /// Whether a folder is a volume; remembers its parts.
    fn enter(&mut self, folder: &DirEntry) -> bool {
        let parts = folder_parts(folder.path());
        let found = !parts.is_empty();
        self.parts.truncate(folder.depth());
        self.parts.push(parts);
        found
    }

    fn is_volume(&self, entry: &DirEntry) -> bool {
        if !entry.file_type().is_file() || self.is_part(entry) {
            return false;
        }
        let readable = |info: &&formats::FormatInfo| self.raw || !info.needs_layout;
        formats::infos().filter(readable).any(|info| has_ending(entry.path(), info.extensions))
    }

    /// Whether a file belongs to a volume of another name: a part of its folder, or the samples of a header of the same
    /// name.
    fn is_part(&self, entry: &DirEntry) -> bool {
        let folder = entry.depth().checked_sub(1).and_then(|depth| self.parts.get(depth));
        folder.is_some_and(|parts| parts.contains(entry.path())) || has_header(entry.path())
    }

    /// The error of an entry that cannot be read; `None` for hidden ones.
    fn unreadable(&self, error: walkdir::Error) -> Option<ReadError> {
        let path = error.path().unwrap_or(&self.root).to_path_buf();
        if error.depth() > 0 && path.file_name().is_some_and(is_hidden) {
            return None;
        }
        let doing = match error.loop_ancestor() {
            Some(_) => "following the link, which leads back to a folder above it,",
            None => "reading the folder",
        };
        // The error of the system alone: that of the walk repeats the path.
        let text = error.to_string();
        let source = error.into_io_error().unwrap_or_else(|| io::Error::other(text));
        Some(ReadError::new(path, VolumeError::Io { doing, source }))
    }
}

impl Iterator for Walk {
    type Item = Result<PathBuf, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        while let Some(entry) = self.entries.next() {
            if let Some(found) = self.visit(entry) {
                return Some(found);
            }
        }
        None
    }
}

/// The files that make a folder a volume; none if it is not one, or cannot be listed, which the walk reports.
fn folder_parts(folder: &Path) -> HashSet<PathBuf> {
    let mut parts = formats::registry().iter().map(|format| format.folder_parts(folder).unwrap_or_default());
    parts.find(|parts| !parts.is_empty()).unwrap_or_default().into_iter().collect()
}

/// Whether a file has the name of samples and a header of the same name beside it.
fn has_header(path: &Path) -> bool {
    let compressed = has_ending(path, COMPRESSED);
    let plain = if compressed { path.with_extension("") } else { path.to_path_buf() };
    let headers = || formats::infos().flat_map(|info| info.detached_headers);
    is_data_file(&plain) && headers().any(|header| plain.with_extension(header.trim_start_matches('.')).is_file())
}

/// Whether a file has the name of samples that a header may describe.
fn is_data_file(path: &Path) -> bool {
    formats::infos().any(|info| has_ending(path, info.data_files))
}

/// The extensions that compressed files have after their own.
const COMPRESSED: &[&str] = &[".gz", ".bz2"];

/// Whether a file is named like a store of hlacdb or a file beside one, as there often is in the folder that is ingested.
fn is_store(entry: &DirEntry) -> bool {
    entry.file_name().to_string_lossy().contains(".hlacdb")
}

fn is_hidden(name: &OsStr) -> bool {
    name.as_encoded_bytes().starts_with(b".")
}
