//! Which volumes a path stands for: a file for itself, a folder for all that is in it.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use walkdir::{DirEntry, WalkDir};

use super::{MIN_SIDE, ReadError, VolumeError, natural_cmp, slices};

/// The ends of the names of volume files, lower case. (Pictures are slices, not volumes.)
const VOLUMES: &[&str] =
    &[".npy", ".npz", ".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".nii.gz", ".hdr", ".hdr.gz", ".tif", ".tiff", ".vox"];

/// The ends of the names of bare samples, which are volumes only where the caller knows their layout.
const RAW: &[&str] = &[".raw", ".bin", ".dat"];

/// The ends of the names of samples that a detached header may describe.
const SAMPLES: &[&str] = &["raw", "bin", "dat", "img", "zraw"];

/// The ends of the names of headers whose samples are in a file of the same name beside them.
const DETACHED: &[&str] = &["mhd", "nhdr", "hdr"];

/// The volumes that a path stands for, in natural order of their names.
///
/// A path that is no folder is yielded as it is, whatever its name. A folder is walked to its depth, symbolic links
/// followed:
/// - a folder that itself holds three slices or more (PNG, JPEG, single-page TIFF) is one volume, yielded as that folder
///   before what else is in it;
/// - files with the name of a volume are yielded; where `raw` is set, bare samples too (`.raw`, `.bin`, `.dat`),
///   except those that a detached header of the same name describes;
/// - hidden files and folders, and all other files, are passed over (a trace event tells).
///
/// What cannot be looked at is an error in its place, once, and the walk goes on: a missing path, a folder that may not be
/// read, a dangling link, a link that leads back to a folder above it. The same file reached by two links is yielded twice.
pub fn discover(path: &Path, raw: bool) -> Discovery {
    let (single, walk) = match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => (None, Some(Walk::new(path, raw))),
        Ok(_) => (Some(Ok(path.to_path_buf())), None),
        Err(source) => {
            let error = VolumeError::Io { doing: "looking for the file", source };
            (Some(Err(ReadError { path: path.into(), error })), None)
        }
    };
    Discovery { single, walk }
}

/// The volumes of [`discover`], one after the other.
pub struct Discovery {
    single: Option<Result<PathBuf, ReadError>>,
    walk: Option<Walk>,
}

impl Discovery {
    /// How many files were passed over so far because no volume has such a name. Hidden files, slices and the data files of
    /// detached headers do not count.
    pub fn passed_over(&self) -> u64 {
        self.walk.as_ref().map_or(0, |walk| walk.passed_over)
    }
}

impl Iterator for Discovery {
    type Item = Result<PathBuf, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.single.take().or_else(|| self.walk.as_mut()?.next())
    }
}

/// A walk through a folder.
struct Walk {
    root: PathBuf,
    entries: walkdir::IntoIter,
    raw: bool,
    /// Files that are neither volumes nor parts of one.
    passed_over: u64,
    /// Of every folder from the root down to the current one, the files that are its slices.
    stacks: Vec<HashSet<PathBuf>>,
}

impl Walk {
    fn new(root: &Path, raw: bool) -> Self {
        let walk = WalkDir::new(root).follow_links(true).sort_by(|a, b| natural_cmp(a.file_name(), b.file_name()));
        Self { root: root.into(), entries: walk.into_iter(), raw, passed_over: 0, stacks: Vec::new() }
    }

    /// What an entry adds: nothing, a volume, or an error.
    fn look(&mut self, entry: Result<DirEntry, walkdir::Error>) -> Option<Result<PathBuf, ReadError>> {
        let entry = match entry {
            Ok(entry) => entry,
            Err(error) => return self.unlooked(error).map(Err),
        };
        if entry.depth() > 0 && is_hidden(entry.file_name()) {
            if entry.file_type().is_dir() {
                self.entries.skip_current_dir();
            }
            return None;
        }
        let found = if entry.file_type().is_dir() { self.enter(&entry) } else { self.is_volume(&entry) };
        if !found && entry.file_type().is_file() && !self.is_part(&entry) {
            self.passed_over += u64::from(!is_store(&entry));
            tracing::debug!(path = %entry.path().display(), "passed over: no volume by its name");
        }
        found.then(|| Ok(entry.into_path()))
    }

    /// Whether a folder is a stack; remembers its slices.
    fn enter(&mut self, folder: &DirEntry) -> bool {
        // A folder that cannot be listed is reported when the walk tries it.
        let mut stack: HashSet<_> = slices::of_folder(folder.path()).unwrap_or_default().into_iter().collect();
        if stack.len() < MIN_SIDE {
            stack.clear();
        }
        let found = !stack.is_empty();
        self.stacks.truncate(folder.depth());
        self.stacks.push(stack);
        found
    }

    fn is_volume(&self, entry: &DirEntry) -> bool {
        if !entry.file_type().is_file() || self.is_part(entry) {
            return false;
        }
        let name = entry.file_name().to_string_lossy().to_ascii_lowercase();
        let ends = |endings: &[&str]| endings.iter().any(|ending| name.ends_with(ending));
        ends(VOLUMES) || self.raw && ends(RAW)
    }

    /// Whether a file belongs to a volume that is yielded by another name: a slice of its folder, or the samples that a
    /// detached header of the same name describes.
    fn is_part(&self, entry: &DirEntry) -> bool {
        let path = entry.path();
        let stack = entry.depth().checked_sub(1).and_then(|depth| self.stacks.get(depth));
        if stack.is_some_and(|stack| stack.contains(path)) {
            return true;
        }
        let has = |path: &Path, endings: &[&str]| {
            path.extension().is_some_and(|found| endings.iter().any(|ending| found.eq_ignore_ascii_case(ending)))
        };
        let plain = if has(path, &["gz", "bz2"]) { path.with_extension("") } else { path.to_path_buf() };
        has(&plain, SAMPLES) && DETACHED.iter().any(|header| plain.with_extension(header).is_file())
    }

    /// The error of an entry that could not be looked at; `None` for hidden ones.
    fn unlooked(&self, error: walkdir::Error) -> Option<ReadError> {
        let path = error.path().unwrap_or(&self.root).to_path_buf();
        if error.depth() > 0 && path.file_name().is_some_and(is_hidden) {
            return None;
        }
        let doing = match error.loop_ancestor() {
            Some(_) => "following the link, which leads back to a folder above it,",
            None => "looking into the folder",
        };
        // The system's own words: the walk's would name path and cause once more.
        let text = error.to_string();
        let source = error.into_io_error().unwrap_or_else(|| io::Error::other(text));
        Some(ReadError { path, error: VolumeError::Io { doing, source } })
    }
}

impl Iterator for Walk {
    type Item = Result<PathBuf, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        while let Some(entry) = self.entries.next() {
            if let Some(found) = self.look(entry) {
                return Some(found);
            }
        }
        None
    }
}

/// Whether a file is, by its name, a store (or lies beside one and belongs to it): in the folder that is ingested there is
/// often the one that it goes into.
fn is_store(entry: &DirEntry) -> bool {
    entry.file_name().to_string_lossy().contains(".hlacdb")
}

fn is_hidden(name: &OsStr) -> bool {
    name.as_encoded_bytes().starts_with(b".")
}
