//! [`IngestOptions`].

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::store::Volumes;
use crate::volume::{self, ReadError, ReadOptions, Volume, VolumeSource};

/// How files are read, cut, tagged and stored.
///
/// ```
/// use hlacdb::ingest::IngestOptions;
/// let options = IngestOptions::new().tag("rock", "ketton").block(64);
/// # let _ = options;
/// ```
#[derive(Clone, Debug, Default)]
pub struct IngestOptions {
    pub(super) reading: ReadOptions,
    pub(super) tags: BTreeMap<String, String>,
    pub(super) block: Option<usize>,
    pub(super) jobs: Option<usize>,
    pub(super) volumes: Volumes,
    pub(super) relative_to: Option<PathBuf>,
}

impl IngestOptions {
    /// Whole volumes, with their voxels, without tags, by all cores.
    pub fn new() -> Self {
        Self::default()
    }

    /// How files are read.
    #[must_use]
    pub fn reading(mut self, reading: ReadOptions) -> Self {
        self.reading = reading;
        self
    }

    /// Adds a tag for every texture, in place of one with the same key.
    #[must_use]
    pub fn tag(mut self, key: impl Into<String>, value: impl Into<String>) -> Self {
        self.tags.insert(key.into(), value.into());
        self
    }

    /// Sets all tags of every texture.
    #[must_use]
    pub fn tags(mut self, tags: BTreeMap<String, String>) -> Self {
        self.tags = tags;
        self
    }

    /// Cuts each volume into cubes with this side, at least 3 voxels. Voxels at the far borders that do not fill a cube
    /// are not used.
    #[must_use]
    pub fn block(mut self, side: usize) -> Self {
        self.block = Some(side);
        self
    }

    /// The number of threads that read and describe. The default is one per core.
    #[must_use]
    pub fn jobs(mut self, jobs: usize) -> Self {
        self.jobs = Some(jobs);
        self
    }

    /// Whether voxels are stored.
    #[must_use]
    pub fn volumes(mut self, volumes: Volumes) -> Self {
        self.volumes = volumes;
        self
    }

    /// Records and reports files inside this folder by their path relative to it. By default, paths are used as the caller
    /// gives them.
    #[must_use]
    pub fn relative_to(mut self, folder: impl Into<PathBuf>) -> Self {
        self.relative_to = Some(folder.into());
        self
    }

    /// A path as it is recorded and reported.
    pub(super) fn shown(&self, path: &Path) -> PathBuf {
        let Some(below) = self.relative_to.as_deref().and_then(|folder| path.strip_prefix(folder).ok()) else {
            return path.to_path_buf();
        };
        // The folder itself goes by its name.
        let itself = below.as_os_str().is_empty();
        if itself { path.file_name().unwrap_or_default().into() } else { below.to_path_buf() }
    }

    /// Reads a file. An error has the path as it is reported.
    pub(super) fn read(&self, path: &Path) -> Result<(Volume, VolumeSource), ReadError> {
        volume::read(path, &self.reading).map_err(|error| self.renamed(error))
    }

    /// The error with the path as it is reported.
    pub(super) fn renamed(&self, mut error: ReadError) -> ReadError {
        error.path = self.shown(&error.path);
        error
    }
}
