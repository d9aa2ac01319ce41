//! Prepared textures on their way into transactions.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::ordered::Next;
use super::report::{IngestEvent, IngestReport, IngestStatus};
use crate::database::{Added, Database, PreparedTexture};
use crate::error::Error;
use crate::progress::Progress;

/// A batch is committed when it has this number of textures, ...
const BATCH_TEXTURES: usize = 64;
/// ... or this number of bytes of compressed voxels, ...
const BATCH_BYTES: usize = 64 << 20;
/// ... or when its first texture has waited this long.
pub(super) const BATCH_AGE: Duration = Duration::from_millis(250);

/// What a worker made of one texture.
pub(super) struct Item {
    /// The path as it is reported.
    pub(super) path: PathBuf,
    /// The texture, or why there is none.
    pub(super) prepared: Result<PreparedTexture, Error>,
    /// The number of files that end with this item: 0 for all blocks of a file but the last.
    pub(super) files: u64,
}

/// Textures that are committed together, and the report of all that were.
pub(super) struct Batch<'a> {
    pub(super) database: &'a Database,
    progress: &'a dyn Progress,
    on_event: &'a mut dyn FnMut(&IngestEvent),
    items: Vec<Item>,
    bytes: usize,
    since: Option<Instant>,
    pub(super) report: IngestReport,
    error: Option<Error>,
}

impl<'a> Batch<'a> {
    pub(super) fn new(
        database: &'a Database,
        progress: &'a dyn Progress,
        on_event: &'a mut dyn FnMut(&IngestEvent),
    ) -> Self {
        let report = IngestReport::default();
        Self { database, progress, on_event, items: Vec::new(), bytes: 0, since: None, report, error: None }
    }

    /// Takes the next result, and commits the batch if it is full or old. Breaks if the caller cancelled or a commit failed.
    pub(super) fn take(&mut self, next: Next<Item>) -> ControlFlow<()> {
        if let Next::Result(item) = next {
            self.push(item);
        }
        if self.since.is_some_and(|since| since.elapsed() >= BATCH_AGE) {
            self.commit();
        }
        if self.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Whether the caller cancelled or a commit failed.
    pub(super) fn is_stopped(&self) -> bool {
        self.error.is_some() || self.progress.cancelled()
    }

    pub(super) fn push(&mut self, item: Item) {
        self.bytes += item.prepared.as_ref().map_or(0, PreparedTexture::stored_bytes);
        self.items.push(item);
        self.since.get_or_insert_with(Instant::now);
        if self.items.len() >= BATCH_TEXTURES || self.bytes >= BATCH_BYTES {
            self.commit();
        }
    }

    /// Commits the batch and reports its textures. After an error nothing more is committed.
    fn commit(&mut self) {
        self.since = None;
        self.bytes = 0;
        let items = std::mem::take(&mut self.items);
        if self.error.is_some() || items.is_empty() {
            return;
        }
        let files: u64 = items.iter().map(|item| item.files).sum();
        let mut prepared = Vec::with_capacity(items.len());
        let mut outcomes = Vec::with_capacity(items.len());
        for item in items {
            outcomes.push((item.path, item.prepared.map(|texture| prepared.push(texture))));
        }
        let mut added = match self.database.commit(prepared) {
            Ok(added) => added.into_iter(),
            Err(error) => {
                self.error = Some(error);
                return;
            }
        };
        for (path, outcome) in outcomes {
            let (id, status, error) = match outcome.map(|()| added.next()) {
                Ok(Some(Added::New(id))) => (Some(id), IngestStatus::Added, None),
                Ok(Some(Added::Duplicate(id))) => (Some(id), IngestStatus::Duplicate, None),
                Ok(None) => continue,
                Err(error) => (None, IngestStatus::Failed, Some(error)),
            };
            let event = IngestEvent { id, path, status, error };
            (self.on_event)(&event);
            self.report.count(event);
        }
        self.progress.advance(files);
    }

    /// Commits what is left.
    pub(super) fn finish(mut self) -> Result<IngestReport, Error> {
        self.commit();
        self.report.cancelled = self.progress.cancelled();
        match self.error {
            Some(error) => Err(error),
            None => Ok(self.report),
        }
    }
}
