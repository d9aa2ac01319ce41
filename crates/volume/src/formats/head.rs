//! [`Head`]: what a format is recognised by.

use std::io::Read;
use std::path::Path;

use crate::VolumeError;
use crate::layout::open_file;

/// The bytes of a file that formats are recognised by.
const LENGTH: u64 = 4096;

/// The beginning of a file, or a folder.
#[derive(Debug)]
pub struct Head<'a> {
    path: &'a Path,
    folder: bool,
    bytes: Vec<u8>,
}

impl<'a> Head<'a> {
    /// Reads the beginning of a file, or finds that the path is a folder.
    ///
    /// # Errors
    /// [`VolumeError::Io`]; [`VolumeError::NotAFile`] for a pipe or device.
    pub fn read(path: &'a Path) -> Result<Self, VolumeError> {
        let mut bytes = Vec::new();
        let folder = path.is_dir();
        if !folder {
            let io = |source| VolumeError::Io { doing: "opening the file", source };
            open_file(path)?.take(LENGTH).read_to_end(&mut bytes).map_err(io)?;
        }
        Ok(Self { path, folder, bytes })
    }

    /// The file or folder.
    pub fn path(&self) -> &Path {
        self.path
    }

    /// Whether it is a folder.
    pub fn is_folder(&self) -> bool {
        self.folder
    }

    /// The first 4096 bytes of a file, fewer where it is shorter; none of a folder.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}
