//! Files of stores: opening one that is there, and creating one under a temporary name.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::store::error::StoreError;
use crate::store::open_error::OpenError;

/// The first bytes of every file of the engine.
const ENGINE_MAGIC: [u8; 9] = *b"redb\x1A\x0A\xA9\x0D\x0A";

/// Opens the file at `path` if it begins as a file of the engine does. Creates nothing.
pub(crate) fn open(path: &Path, writing: bool) -> Result<File, OpenError> {
    let io = |source| OpenError::Io { doing: "opening", path: path.into(), source };
    let foreign = |found: String| OpenError::NotAStore { path: path.into(), found };
    // Opening a FIFO would block, so its type is checked first.
    let kind = fs::metadata(path).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => OpenError::NoStore { path: path.into() },
        _ => io(source),
    })?;
    if kind.is_dir() {
        return Err(foreign("a folder".into()));
    }
    if !kind.is_file() {
        return Err(foreign("not a regular file".into()));
    }
    let mut file = OpenOptions::new().read(true).write(writing).open(path).map_err(io)?;
    let mut head = Vec::new();
    Read::by_ref(&mut file).take(ENGINE_MAGIC.len() as u64).read_to_end(&mut head).map_err(io)?;
    if head.is_empty() {
        return Err(foreign("an empty file".into()));
    }
    if head != ENGINE_MAGIC {
        return Err(foreign(format!("a file that begins with \"{}\"", head.escape_ascii())));
    }
    Ok(file)
}

/// Creates the file at `path`, where nothing may exist, under a temporary name beside it. It gets its own name once `fill`
/// has succeeded, and is removed if `fill` or the renaming fails, so that a file is never seen half written.
pub(crate) fn create_whole<T, E: From<StoreError>>(
    path: &Path,
    fill: impl FnOnce(File) -> Result<T, E>,
) -> Result<T, E> {
    let exists = || StoreError::from(OpenError::Exists { path: path.into() });
    let io = |source| StoreError::from(OpenError::Io { doing: "creating", path: path.into(), source });
    if path.symlink_metadata().is_ok() {
        return Err(exists().into());
    }
    let temporary = temporary_name(path);
    let file = OpenOptions::new().read(true).write(true).create_new(true).open(&temporary).map_err(io)?;
    let made = fill(file).and_then(|made| match give_name(&temporary, path) {
        Ok(()) => Ok(made),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(exists().into()),
        Err(source) => Err(io(source).into()),
    });
    if made.is_err() {
        // The error matters more; a temporary file that cannot be removed is harmless.
        let _ = fs::remove_file(&temporary);
    }
    made
}

/// The temporary name of a store that is being created: in the same folder, so that both names are on one file system.
fn temporary_name(path: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.creating", std::process::id()));
    path.with_file_name(name)
}

/// Gives the file its final name, unless something has that name already.
fn give_name(temporary: &Path, path: &Path) -> io::Result<()> {
    match fs::hard_link(temporary, path) {
        Ok(()) => fs::remove_file(temporary)?,
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Err(error),
        // The file system has no hard links: the check in `create_whole` must suffice.
        Err(_) => fs::rename(temporary, path)?,
    }
    // The new name must survive a power failure too. Not every system lets a folder be opened or synced.
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match File::open(folder) {
        Ok(folder) => folder.sync_all().or(Ok(())),
        Err(_) => Ok(()),
    }
}
