//! What all requests share.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use axum::body::Bytes;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use tokio::sync::watch;

use super::jobs::Jobs;
use super::limits::Lane;
use super::metrics::Metrics;
use super::problem::Problem;
use super::reply::{self, Keep};
use super::settings::{ServeError, Settings};
use super::upload_cache::Uploads;
use crate::volume::{Volume, display_path};
use crate::{Catalogue, Database, Error};

/// So many forms are taken in at once.
const FORMS: usize = 16;
/// The memory that encoded pictures and maps may take.
const PICTURE_BYTES: u64 = 96 << 20;
/// The memory that volumes may take which were looked at last.
const VOLUME_BYTES: u64 = 256 << 20;

/// What all requests share.
pub(crate) struct App {
    pub(crate) database: Database,
    pub(crate) settings: Settings,
    /// Short questions: a few milliseconds at most.
    pub(crate) quick: Lane,
    /// Whatever reads or writes volumes.
    pub(crate) heavy: Lane,
    /// Forms being taken in: what waits on the disk is bounded.
    pub(crate) forms: Lane,
    /// Encoded answers by what they show.
    pub(crate) pictures: Cache<String, Bytes, Bytewise>,
    /// Volumes by their content.
    pub(crate) volumes: Cache<[u8; 32], Arc<Volume>, Bytewise>,
    pub(crate) uploads: Uploads,
    pub(crate) jobs: Jobs,
    pub(crate) metrics: Metrics,
    /// The ingest folder, all links in its path resolved.
    pub(crate) ingest_root: Option<PathBuf>,
    /// Becomes true when the server ends.
    pub(crate) stopping: watch::Receiver<bool>,
    /// Tells this run of the server from every other one: revisions of stores are small numbers.
    pub(crate) run: String,
    /// The revision of the last change that a request made.
    changed: AtomicU64,
}

/// Weighs by bytes.
#[derive(Clone)]
pub(crate) struct Bytewise;

impl Weighter<String, Bytes> for Bytewise {
    fn weight(&self, key: &String, value: &Bytes) -> u64 {
        (key.len() + value.len()) as u64
    }
}

impl Weighter<[u8; 32], Arc<Volume>> for Bytewise {
    fn weight(&self, _: &[u8; 32], volume: &Arc<Volume>) -> u64 {
        volume.voxels().len() as u64
    }
}

impl App {
    pub(crate) fn new(
        database: Database,
        settings: Settings,
        stopping: watch::Receiver<bool>,
    ) -> Result<Self, ServeError> {
        let ingest_root = match &settings.ingest_folder {
            Some(path) => {
                let folder = path.canonicalize().and_then(|root| std::fs::read_dir(&root).map(|_| root));
                Some(folder.map_err(|source| ServeError::IngestFolder { path: path.clone(), source })?)
            }
            None => None,
        };
        Ok(Self {
            quick: Lane::new(settings.lanes()),
            heavy: Lane::new(settings.lanes()),
            forms: Lane::new(FORMS),
            pictures: Cache::with_weighter(2048, PICTURE_BYTES, Bytewise),
            volumes: Cache::with_weighter(64, VOLUME_BYTES, Bytewise),
            uploads: Uploads::default(),
            jobs: Jobs::default(),
            metrics: Metrics::new(),
            ingest_root,
            stopping,
            run: format!("{:016x}", rand_run()),
            changed: AtomicU64::new(0),
            database,
            settings,
        })
    }

    /// Work on the database, on a thread that may block.
    pub(crate) async fn quick<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&Self) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        self.work(&self.quick, work).await
    }

    /// The same for what takes longer, or much memory.
    pub(crate) async fn heavy<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&Self) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        self.work(&self.heavy, work).await
    }

    async fn work<T: Send + 'static>(
        self: &Arc<Self>,
        lane: &Lane,
        work: impl FnOnce(&Self) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let place = lane.place().await?;
        let app = Arc::clone(self);
        let done = tokio::task::spawn_blocking(move || {
            let _place = place;
            work(&app)
        });
        match done.await {
            Ok(result) => result.map_err(|problem| problem.map(|text| self.shown(text))),
            Err(error) => {
                tracing::error!(%error, "a request's thread died");
                Err(Problem::internal())
            }
        }
    }

    /// The list of all textures, every change that a request made included.
    pub(crate) fn catalogue(&self) -> Result<Arc<Catalogue>, Error> {
        self.database.catalogue(self.changed.load(Ordering::Acquire))
    }

    /// A JSON answer that costs some work: made once for each tag.
    pub(crate) fn kept(
        &self,
        headers: &HeaderMap,
        tag: &str,
        make: impl FnOnce() -> Result<Bytes, Problem>,
    ) -> Result<Response, Problem> {
        reply::tagged(headers, tag, Keep::Check, reply::JSON, || {
            if let Some(bytes) = self.pictures.get(tag) {
                return Ok(bytes);
            }
            let bytes = make()?;
            self.pictures.insert(tag.to_owned(), bytes.clone());
            Ok(bytes)
        })
    }

    /// Reads what the first requests would wait for.
    pub(crate) fn warm_up(&self) {
        let read = self.catalogue().and_then(|_| self.database.space(crate::DEFAULT_SPACE));
        if let Err(error) = read {
            tracing::warn!(error = crate::chain(&error), "the store could not be read ahead");
        }
    }

    /// To be called after every change: lists that are asked for from now on show it.
    pub(crate) fn note_change(&self) -> Result<(), Error> {
        self.changed.fetch_max(self.database.revision()?, Ordering::AcqRel);
        Ok(())
    }

    /// Refuses to change a store that is only to be looked at.
    pub(crate) fn may_change(&self) -> Result<(), Problem> {
        if self.settings.read_only {
            let sentence = "this server shows the store and does not change it: start it without --read-only to do so";
            return Err(Problem::new(StatusCode::FORBIDDEN, sentence));
        }
        Ok(())
    }

    /// A text of the library without the machine's own paths: the store is called by its name, and files by their path below
    /// the folder they are ingested from.
    pub(crate) fn shown(&self, text: &str) -> String {
        let mut text = text.to_owned();
        if let Some(root) = &self.ingest_root {
            text = without(&text, root);
        }
        match self.database.path().parent().filter(|folder| folder.is_absolute()) {
            Some(folder) => without(&text, folder),
            None => text,
        }
    }
}

/// The text without this folder's path before what is in it.
fn without(text: &str, folder: &Path) -> String {
    let folder = display_path(folder);
    if folder == "/" { text.to_owned() } else { text.replace(&format!("{folder}/"), "") }
}

/// A number that no other run has.
fn rand_run() -> u64 {
    use std::hash::{BuildHasher, RandomState};
    RandomState::new().hash_one(std::process::id())
}
