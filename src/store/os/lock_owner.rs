//! The process that holds the lock of a store: the one that has the file open and locked for writing.

use std::fs;
use std::path::Path;

/// The id of the process that has the store at `path` open for writing; `None` if that is unknown (a system other than
/// Linux, a process of another user, one that has just ended).
pub(crate) fn of(path: &Path) -> Option<u32> {
    let path = fs::canonicalize(path).ok()?;
    let mut opened = None;
    for process in fs::read_dir("/proc").ok()?.flatten() {
        let Some(id) = process.file_name().to_str().and_then(|name| name.parse().ok()) else { continue };
        let Ok(files) = fs::read_dir(process.path().join("fd")) else { continue };
        for file in files.flatten().filter(|file| fs::read_link(file.path()).is_ok_and(|target| target == path)) {
            let info = fs::read_to_string(process.path().join("fdinfo").join(file.file_name())).unwrap_or_default();
            match writes(&info) {
                Some(true) => return Some(id),
                Some(false) => opened = Some(id),
                None => {}
            }
        }
    }
    opened
}

/// Reads the `fdinfo` of an open file: `None` if it is not open for writing, else whether a lock for writing is held.
fn writes(info: &str) -> Option<bool> {
    let flags = info.lines().find_map(|line| line.strip_prefix("flags:"))?;
    let flags = u32::from_str_radix(flags.trim(), 8).ok()?;
    // The lowest two bits: 0 reading, 1 writing, 2 both.
    (flags & 3 != 0).then(|| info.lines().any(|line| line.starts_with("lock:") && line.contains(" WRITE ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_information_is_parsed() {
        let locked = "pos:\t0\nflags:\t0100002\nmnt_id:\t29\nlock:\t1: OFDLCK ADVISORY  WRITE -1 fe:00:77 0 EOF\n";
        assert_eq!(writes(locked), Some(true));
        assert_eq!(writes("pos:\t0\nflags:\t0100002\n"), Some(false));
        assert_eq!(writes("pos:\t0\nflags:\t0100000\n"), None);
        assert_eq!(writes(""), None);
    }
}
