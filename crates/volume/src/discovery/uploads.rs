//! The volumes among uploaded files, none of which may be skipped silently.

use std::collections::HashSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::{COMPRESSED, discover, folder_parts, is_data_file, natural_cmp};
use crate::formats::{self, has_ending};

/// The volumes in a folder of uploaded files: those that [`discover`] finds, and every other file too, so that reading it
/// says why it is not a volume. Left out are only the slices of a volume and the data files of headers. In natural order.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// for name in ["core.nhdr", "core.raw", "notes.md"] {
///     std::fs::write(folder.path().join(name), "")?;
/// }
/// let found = hlacdb_volume::uploaded_volumes(folder.path())?;
/// assert!(found[0].ends_with("core.nhdr") && found[1].ends_with("notes.md"));
/// # Ok::<(), std::io::Error>(())
/// ```
///
/// # Errors
/// If the folder cannot be read.
pub fn uploaded_volumes(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found: Vec<PathBuf> = discover(folder, false).filter_map(Result::ok).collect();
    let known: HashSet<&Path> = found.iter().map(PathBuf::as_path).collect();
    let parts: HashSet<PathBuf> =
        found.iter().filter(|path| path.is_dir()).flat_map(|path| folder_parts(path)).collect();
    let mut others = Vec::new();
    for file in files(folder)? {
        let has_header = || known.iter().any(|path| path.parent() == file.parent() && is_header(path));
        let is_data = has_ending(&file, COMPRESSED) || is_data_file(&file);
        let belongs = parts.contains(&file) || is_data && has_header();
        if !belongs && !known.contains(file.as_path()) {
            others.push(file);
        }
    }
    found.extend(others);
    found.sort_by(|a, b| natural_cmp(a.as_os_str(), b.as_os_str()));
    Ok(found)
}

/// Whether a file has the name of a header whose samples may be in another file, compressed or not.
fn is_header(path: &Path) -> bool {
    let plain = if has_ending(path, COMPRESSED) { path.with_extension("") } else { path.to_path_buf() };
    formats::infos().any(|info| has_ending(&plain, info.detached_headers))
}

/// Every file of a folder and of the folders in it.
fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() { files.extend(self::files(&entry.path())?) } else { files.push(entry.path()) }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_slices_and_data_files_are_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let names = |given: &[&str]| {
            let place = tempfile::tempdir_in(&folder).unwrap();
            for name in given {
                fs::create_dir_all(place.path().join(name).parent().unwrap()).unwrap();
                fs::write(place.path().join(name), b"").unwrap();
            }
            let found = uploaded_volumes(place.path()).unwrap();
            let below =
                found.iter().map(|path| path.strip_prefix(place.path()).unwrap().to_string_lossy().into_owned());
            below.collect::<Vec<_>>()
        };
        assert_eq!(names(&["s10.npy", "s9.npy", "notes.txt"]), ["notes.txt", "s9.npy", "s10.npy"]);
        assert_eq!(names(&["a.nhdr", "a.raw"]), ["a.nhdr"]);
        assert_eq!(names(&["a.hdr.gz", "a.img.gz"]), ["a.hdr.gz"]);
        assert_eq!(names(&["a.raw", "b.png"]), ["a.raw", "b.png"]);
        assert_eq!(names(&["1.png", "2.png", "3.png"]), [""], "slices are their folder");
        assert_eq!(names(&["2/a.npy", "a.npy"]), ["2/a.npy", "a.npy"]);
    }
}
