//! What was handed over: files that somebody put together, of which none may be passed over in silence.

use std::collections::HashSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::{discover, natural_cmp};

/// The ends of the names of data files, and of the headers that describe them.
const DATA: &[&str] = &["raw", "zraw", "img", "gz", "bz2", "bin", "dat", "txt", "hex"];
const HEADERS: &[&str] = &["nhdr", "mhd", "hdr"];

/// The volumes of a folder whose files were handed over by somebody: those that [`discover`] finds, and every other file
/// too, so that reading it says why it is no volume. Only the slices of a stack and the data of detached headers stand
/// for nothing of their own. In natural order.
///
/// # Errors
/// Where the folder cannot be read.
pub fn gather(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found: Vec<PathBuf> = discover(folder, false).filter_map(Result::ok).collect();
    let known: HashSet<&Path> = found.iter().map(PathBuf::as_path).collect();
    let stacks: Vec<&Path> = found.iter().map(PathBuf::as_path).filter(|path| path.is_dir()).collect();
    let mut others = Vec::new();
    for file in files(folder)? {
        let ending = |path: &Path| path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
        let ends = |endings: &[&str]| ending(&file).is_some_and(|ending| endings.contains(&ending.as_str()));
        let in_stack =
            stacks.iter().any(|&stack| file.parent() == Some(stack)) && ends(&["png", "jpg", "jpeg", "tif", "tiff"]);
        let headed = || known.iter().any(|path| path.parent() == file.parent() && is_header(path));
        let belongs = in_stack || ends(DATA) && headed();
        if !belongs && !known.contains(file.as_path()) {
            others.push(file);
        }
    }
    found.extend(others);
    found.sort_by(|a, b| natural_cmp(a.as_os_str(), b.as_os_str()));
    Ok(found)
}

fn is_header(path: &Path) -> bool {
    // `a.hdr.gz` too.
    let name = path.file_name().map(|name| name.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    HEADERS.iter().any(|ending| name.ends_with(&format!(".{ending}")))
}

/// Every file of a folder and of those in it.
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
    fn nothing_is_passed_over_but_what_belongs_to_something() {
        let folder = tempfile::tempdir().unwrap();
        let names = |given: &[&str]| {
            let place = tempfile::tempdir_in(&folder).unwrap();
            for name in given {
                fs::create_dir_all(place.path().join(name).parent().unwrap()).unwrap();
                fs::write(place.path().join(name), b"").unwrap();
            }
            let found = gather(place.path()).unwrap();
            let below =
                found.iter().map(|path| path.strip_prefix(place.path()).unwrap().to_string_lossy().into_owned());
            below.collect::<Vec<_>>()
        };
        assert_eq!(names(&["s10.npy", "s9.npy", "notes.txt"]), ["notes.txt", "s9.npy", "s10.npy"]);
        assert_eq!(names(&["a.nhdr", "a.raw"]), ["a.nhdr"]);
        assert_eq!(names(&["a.hdr.gz", "a.img.gz"]), ["a.hdr.gz"]);
        assert_eq!(names(&["a.raw", "b.png"]), ["a.raw", "b.png"]);
        assert_eq!(names(&["1.png", "2.png", "3.png"]), [""], "a stack is its folder");
        assert_eq!(names(&["2/a.npy", "a.npy"]), ["2/a.npy", "a.npy"]);
    }
}
