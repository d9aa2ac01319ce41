//! What the tests share: fixtures, and files in a folder that is removed with the test.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// The folder of fixtures.
pub(crate) fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

/// The files and folders in a folder of fixtures, sorted.
pub(crate) fn entries(folder: &str) -> Vec<PathBuf> {
    let list = fs::read_dir(fixtures().join(folder)).unwrap();
    let mut entries: Vec<PathBuf> = list.map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    entries
}

/// Every fixture: files of all formats, folders of slices, and some that are not a volume.
pub(crate) fn all_fixtures() -> Vec<PathBuf> {
    let all = [entries("volumes"), entries("pictures")].concat();
    assert!(all.len() > 100, "the fixtures are there");
    all
}

/// A folder that is removed with the test.
pub(crate) struct Folder(TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(TempDir::new().unwrap())
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    /// Writes a file into the folder.
    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    }
}

/// Bytes as gzip writes them.
pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut encoder, bytes).unwrap();
    encoder.finish().unwrap()
}

/// An error and its causes in one line.
pub(crate) fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text = format!("{text}: {error}");
        cause = error.source();
    }
    text
}

/// Checks that an error is one line of bounded length, its causes included.
pub(crate) fn assert_bounded(error: &dyn std::error::Error) {
    let text = chain(error);
    assert!(text.len() > 20 && text.len() < 1500 && !text.contains('\n'), "{} bytes: {text}", text.len());
}
