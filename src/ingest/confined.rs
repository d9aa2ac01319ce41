//! Paths from untrusted callers, confined to a folder.

use std::path::{Component, Path, PathBuf};

use walkdir::WalkDir;

use crate::error::{Error, IngestError};

/// Resolves a path that an untrusted caller gives relative to `root`, with all links. `root` must be a path without links.
///
/// The result lies in `root`, and so does everything that ingesting it would read: a link that leads out of `root`, anywhere
/// below a folder or beside a file, is an error. This protects against paths, not against somebody who may change the
/// folder.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let root = folder.path().canonicalize()?;
/// std::fs::create_dir(root.join("scans"))?;
/// assert_eq!(hlacdb::ingest::resolve_within(&root, "scans")?, root.join("scans"));
/// assert!(hlacdb::ingest::resolve_within(&root, "../scans").is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`IngestError::OutsideFolder`], [`IngestError::NotFound`].
pub fn resolve_within(root: &Path, path: &str) -> Result<PathBuf, Error> {
    let outside = |path: &Path| Error::from(IngestError::OutsideFolder { path: path.to_owned() });
    let below = Path::new(path);
    let plain = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    if !below.components().all(plain) || path.contains('\0') {
        return Err(outside(below));
    }
    let missing = |source| IngestError::NotFound { path: below.to_owned(), source };
    let resolved = root.join(below).canonicalize().map_err(missing)?;
    if !resolved.starts_with(root) {
        return Err(outside(below));
    }
    let (walked, depth) = if resolved.is_dir() {
        (resolved.as_path(), usize::MAX)
    } else {
        // A header may name a data file beside it.
        (resolved.parent().unwrap_or(root), 1)
    };
    for entry in WalkDir::new(walked).max_depth(depth).follow_links(true) {
        // What cannot be listed cannot be read either: ingesting reports it.
        let Ok(entry) = entry else { continue };
        let inside = || entry.path().canonicalize().map_or(true, |target| target.starts_with(root));
        if entry.path_is_symlink() && !inside() {
            return Err(outside(entry.path().strip_prefix(root).unwrap_or(below)));
        }
    }
    Ok(resolved)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    #[test]
    fn no_path_and_no_link_leads_out() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().canonicalize().unwrap();
        let root = place.join("root");
        fs::create_dir_all(root.join("good/deep")).unwrap();
        fs::create_dir_all(root.join("bad/deep")).unwrap();
        fs::create_dir_all(root.join("linked")).unwrap();
        fs::create_dir_all(place.join("secret")).unwrap();
        fs::write(place.join("secret/a.npy"), b"").unwrap();
        fs::write(root.join("good/deep/a.npy"), b"").unwrap();
        symlink("deep", root.join("good/within")).unwrap();
        symlink("../nowhere", root.join("good/dangling")).unwrap();
        symlink(place.join("secret/a.npy"), root.join("bad/deep/a.npy")).unwrap();
        symlink(place.join("secret"), root.join("linked/out")).unwrap();
        symlink("..", root.join("good/loop")).unwrap_or(());
        assert_eq!(resolve_within(&root, "good/deep").unwrap(), root.join("good/deep"));
        assert_eq!(resolve_within(&root, "./good/deep/a.npy").unwrap(), root.join("good/deep/a.npy"));
        let absolute = root.join("good").display().to_string();
        for trick in [
            "..",
            "good/../../secret",
            "/etc",
            &absolute,
            "bad",
            "bad/deep/a.npy",
            "linked",
            "linked/out",
            "linked/out/a.npy",
            "a\0b",
        ] {
            let error = resolve_within(&root, trick).unwrap_err();
            assert!(matches!(error, Error::Ingest(IngestError::OutsideFolder { .. })), "{trick:?}: {error}");
            assert!(!crate::chain(&error).contains("secret/a"), "{error}");
        }
        assert!(matches!(resolve_within(&root, "none"), Err(Error::Ingest(IngestError::NotFound { .. }))));
        fs::remove_file(root.join("good/loop")).unwrap();
        assert!(resolve_within(&root, "good").is_ok());
        assert!(
            matches!(resolve_within(&root, ""), Err(Error::Ingest(IngestError::OutsideFolder { .. }))),
            "a link in the root leads out"
        );
    }
}
