//! How paths appear in answers: relative to the folders that are served.

use std::path::{Path, PathBuf};

use crate::Error;
use crate::volume::display_path;

/// The folders whose files answers may name, by their paths below the folder. Of other files only the name appears.
#[derive(Clone, Debug, Default)]
pub(crate) struct Roots(Vec<PathBuf>);

impl Roots {
    /// These folders; a path in several of them is relative to the first.
    pub(crate) fn new(folders: impl IntoIterator<Item = PathBuf>) -> Self {
        Self(folders.into_iter().filter(|folder| folder.parent().is_some()).collect())
    }

    /// The path below its root; the bare file name of an absolute path outside all roots.
    pub(crate) fn relative(&self, path: &Path) -> PathBuf {
        let below = self.0.iter().find_map(|root| path.strip_prefix(root).ok());
        match below {
            Some(below) if !below.as_os_str().is_empty() => below.to_owned(),
            None if !path.has_root() => path.to_owned(),
            _ => path.file_name().unwrap_or_default().into(),
        }
    }

    /// [`Roots::relative`] as text.
    pub(crate) fn show(&self, path: &Path) -> String {
        display_path(&self.relative(path))
    }

    /// The error with all its paths relative.
    pub(crate) fn error(&self, error: Error) -> Error {
        error.map_paths(&|path| self.relative(path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_relative_to_the_first_root_or_bare_names() {
        let roots = Roots::new(["/data/scans/cores".into(), "/data/scans".into(), "/".into()]);
        for (path, shown) in [
            ("/data/scans/cores/a.npy", "a.npy"),
            ("/data/scans/other/a.npy", "other/a.npy"),
            ("/data/scans", "scans"),
            ("/data/secret/b.npy", "b.npy"),
            ("/", ""),
            ("already/relative.npy", "already/relative.npy"),
        ] {
            assert_eq!(roots.show(Path::new(path)), shown, "{path}");
        }
    }
}
