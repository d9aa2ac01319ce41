//! Shared helpers: where the optional real files are.

use std::path::PathBuf;

/// A file of the folder of real volumes and reference figures, `None` (and a word on stderr) where it is absent.
pub(crate) fn shared(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: no shared data ({name})");
    None
}
