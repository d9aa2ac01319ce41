//! What an ingest reports: an event per texture, and a summary.

use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use crate::TextureId;
use crate::error::{Error, chain};
use crate::volume::display_path;

/// What became of one texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum IngestStatus {
    /// It is in the store, durably.
    Added,
    /// The same content was in the store already.
    Duplicate,
    /// It could not be read.
    Failed,
}

/// What became of one texture, reported once it is durable.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct IngestEvent {
    /// The texture's id; `None` if it failed.
    pub id: Option<TextureId>,
    /// The file or folder it came from; for a synthetic texture, its name.
    #[serde(serialize_with = "path_text")]
    pub path: PathBuf,
    /// What became of it.
    pub status: IngestStatus,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "optional_error_text")]
    pub error: Option<Error>,
}

/// A file that gave no texture.
#[derive(Debug, Serialize)]
#[non_exhaustive]
pub struct FailedFile {
    /// The file or folder.
    #[serde(serialize_with = "path_text")]
    pub path: PathBuf,
    /// Why it failed.
    #[serde(serialize_with = "error_text")]
    pub error: Error,
}

/// What an ingest did.
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
pub struct IngestReport {
    /// The number of textures that were added.
    pub added: u64,
    /// The number of textures that were in the store already.
    pub duplicates: u64,
    /// Files that gave no texture.
    pub failed: Vec<FailedFile>,
    /// The number of files in folders that were skipped because no format has such a name.
    pub skipped: u64,
    /// The number of voxels of cut volumes that are in no block.
    #[serde(skip_serializing_if = "is_zero")]
    pub left_over: u64,
    /// The ids of all textures in input order, including those that were in the store already.
    pub ids: Vec<TextureId>,
    /// True if the caller cancelled. What is reported as added is durable; the rest was not begun.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub cancelled: bool,
}

impl IngestReport {
    pub(super) fn count(&mut self, event: IngestEvent) {
        match event.status {
            IngestStatus::Added => self.added += 1,
            IngestStatus::Duplicate => self.duplicates += 1,
            IngestStatus::Failed => {}
        }
        self.failed.extend(event.error.map(|error| FailedFile { path: event.path, error }));
        self.ids.extend(event.id);
    }
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

fn path_text<S: Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&display_path(path))
}

fn error_text<S: Serializer>(error: &Error, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&chain(error))
}

fn optional_error_text<S: Serializer>(error: &Option<Error>, serializer: S) -> Result<S::Ok, S::Error> {
    error.as_ref().map(|error| chain(error)).serialize(serializer)
}
