//! Paths that others name: kept inside the folder that they may name something in.

use std::path::{Component, Path, PathBuf};

use walkdir::WalkDir;

use crate::error::{Error, IngestError};

/// The path below `root` (a path with all links resolved) that a stranger names, all links resolved.
///
/// What is named must lie in `root`, and so must everything that a walk through it would find: a link that leads out
/// of `root`, anywhere below what is named or beside a named file, refuses the whole. The folder may be changed afterwards by
/// whoever may write to it; this guards against names, not against them.
///
/// ```
/// let folder = tempfile::tempdir()?;
/// let root = folder.path().canonicalize()?;
/// std::fs::create_dir(root.join("scans"))?;
/// assert_eq!(hlacdb::ingest::confined(&root, "scans")?, root.join("scans"));
/// assert!(hlacdb::ingest::confined(&root, "../scans").is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`IngestError::OutsideFolder`], [`IngestError::NotFound`].
pub fn confined(root: &Path, named: &str) -> Result<PathBuf, Error> {
    let outside = |path: &Path| Error::from(IngestError::OutsideFolder { path: path.to_owned() });
    let below = Path::new(named);
    let plain = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    if !below.components().all(plain) || named.contains('\0') {
        return Err(outside(below));
    }
    let missing = |source| IngestError::NotFound { path: below.to_owned(), source };
    let path = root.join(below).canonicalize().map_err(missing)?;
    if !path.starts_with(root) {
        return Err(outside(below));
    }
    let (walked, depth) = if path.is_dir() {
        (path.as_path(), usize::MAX)
    } else {
        // A header may name data beside it.
        (path.parent().unwrap_or(root), 1)
    };
    for entry in WalkDir::new(walked).max_depth(depth).follow_links(true) {
        // What cannot be looked at cannot be read either; ingesting says so.
        let Ok(entry) = entry else { continue };
        let inside = || entry.path().canonicalize().map_or(true, |target| target.starts_with(root));
        if entry.path_is_symlink() && !inside() {
            return Err(outside(entry.path().strip_prefix(root).unwrap_or(below)));
        }
    }
    Ok(path)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::fs;
    use std::os::unix::fs::symlink;

    #[test]
    fn no_name_and_no_link_leads_out() {
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
        assert_eq!(confined(&root, "good/deep").unwrap(), root.join("good/deep"));
        assert_eq!(confined(&root, "./good/deep/a.npy").unwrap(), root.join("good/deep/a.npy"));
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
            let error = confined(&root, trick).unwrap_err();
            assert!(matches!(error, Error::Ingest(IngestError::OutsideFolder { .. })), "{trick:?}: {error}");
            assert!(!crate::chain(&error).contains("secret/a"), "{error}");
        }
        assert!(matches!(confined(&root, "none"), Err(Error::Ingest(IngestError::NotFound { .. }))));
        fs::remove_file(root.join("good/loop")).unwrap();
        assert!(confined(&root, "good").is_ok());
        assert!(
            matches!(confined(&root, ""), Err(Error::Ingest(IngestError::OutsideFolder { .. }))),
            "the root holds what leads out"
        );
    }
}
