//! What all requests share.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use axum::body::Bytes;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use tokio::sync::watch;

use super::jobs::{Job, JobKind, JobOutcome, JobReport, Jobs};
use super::limits::ConcurrencyLimit;
use super::metrics::Metrics;
use super::options::{ServeError, ServerOptions};
use super::paths::Roots;
use super::problem::Problem;
use super::reply::{self, CachePolicy};
use super::tokens::random_token;
use super::upload_cache::UploadCache;
use crate::volume::Volume;
use crate::{Catalogue, Database, Error};

/// How many forms may be received at once.
const FORMS: usize = 16;
/// The size of the cache of encoded pictures and JSON documents, in bytes.
const RESPONSE_CACHE_BYTES: u64 = 96 << 20;
/// The size of the cache of volumes, in bytes.
const VOLUME_CACHE_BYTES: u64 = 256 << 20;

/// What all requests share.
pub(crate) struct App {
    pub(crate) database: Database,
    pub(crate) options: ServerOptions,
    /// Limits queries of a few milliseconds.
    quick_limit: ConcurrencyLimit,
    /// Limits work that reads, describes or writes volumes.
    heavy_limit: ConcurrencyLimit,
    /// Limits forms being received, and so what waits on the disk.
    pub(crate) form_limit: ConcurrencyLimit,
    /// Encoded pictures and documents by their entity tags.
    responses: Cache<String, Bytes, ByBytes>,
    /// Volumes by their content hash.
    pub(crate) volumes: Cache<[u8; 32], Arc<Volume>, ByBytes>,
    pub(crate) uploads: UploadCache,
    pub(crate) jobs: Jobs,
    pub(crate) metrics: Metrics,
    /// The folder to ingest from, links resolved.
    pub(crate) ingest_root: Option<PathBuf>,
    /// The folders whose files answers may name: the one to ingest from, and that of the store.
    pub(crate) roots: Roots,
    /// Becomes true when the server is to stop.
    pub(crate) stopping: watch::Receiver<bool>,
    /// A random token of this run. It is part of entity tags, because two stores may have the same revision.
    pub(crate) run: String,
    /// The revision after the last change that a request made.
    changed: AtomicU64,
}

/// Weighs cached values by their bytes.
#[derive(Clone)]
pub(crate) struct ByBytes;

impl Weighter<String, Bytes> for ByBytes {
    fn weight(&self, key: &String, value: &Bytes) -> u64 {
        (key.len() + value.len()) as u64
    }
}

impl Weighter<[u8; 32], Arc<Volume>> for ByBytes {
    fn weight(&self, _: &[u8; 32], volume: &Arc<Volume>) -> u64 {
        volume.voxels().len() as u64
    }
}

impl App {
    pub(crate) fn new(
        database: Database,
        options: ServerOptions,
        stopping: watch::Receiver<bool>,
    ) -> Result<Self, ServeError> {
        let ingest_root = match &options.ingest_folder {
            Some(path) => {
                let folder = path.canonicalize().and_then(|root| std::fs::read_dir(&root).map(|_| root));
                Some(folder.map_err(|source| ServeError::IngestFolder { path: path.clone(), source })?)
            }
            None => None,
        };
        let store_folder = database.path().parent().map(PathBuf::from);
        let run = random_token().map_err(|source| ServeError::Io { doing: "drawing random numbers", source })?;
        Ok(Self {
            quick_limit: ConcurrencyLimit::new(options.requests_at_once()),
            heavy_limit: ConcurrencyLimit::new(options.requests_at_once()),
            form_limit: ConcurrencyLimit::new(FORMS),
            responses: Cache::with_weighter(2048, RESPONSE_CACHE_BYTES, ByBytes),
            volumes: Cache::with_weighter(64, VOLUME_CACHE_BYTES, ByBytes),
            uploads: UploadCache::default(),
            jobs: Jobs::default(),
            metrics: Metrics::new(),
            roots: Roots::new(ingest_root.clone().into_iter().chain(store_folder)),
            ingest_root,
            stopping,
            run,
            changed: AtomicU64::new(0),
            database,
            options,
        })
    }

    /// Runs work of a few milliseconds on a thread that may block.
    pub(crate) async fn quick<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&Self) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        self.run(&self.quick_limit, work).await
    }

    /// Runs work that takes longer or much memory on a thread that may block.
    pub(crate) async fn heavy<T: Send + 'static>(
        self: &Arc<Self>,
        work: impl FnOnce(&Self) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        self.run(&self.heavy_limit, work).await
    }

    async fn run<T: Send + 'static>(
        self: &Arc<Self>,
        limit: &ConcurrencyLimit,
        work: impl FnOnce(&Self) -> Result<T, Problem> + Send + 'static,
    ) -> Result<T, Problem> {
        let permit = limit.acquire().await?;
        let app = Arc::clone(self);
        let done = tokio::task::spawn_blocking(move || {
            let _permit = permit;
            work(&app)
        });
        match done.await {
            Ok(result) => result.map_err(|problem| problem.relative_to(&self.roots)),
            Err(error) => {
                tracing::error!(%error, "a request panicked: this is a bug");
                Err(Problem::internal())
            }
        }
    }

    /// The list of all textures. It shows every change that a request has made.
    pub(crate) fn catalogue(&self) -> Result<Arc<Catalogue>, Error> {
        self.database.catalogue(self.changed.load(Ordering::Acquire))
    }

    /// The cached bytes of a response, or those that `make` returns.
    pub(crate) fn cached(&self, tag: &str, make: impl FnOnce() -> Result<Bytes, Problem>) -> Result<Bytes, Problem> {
        if let Some(bytes) = self.responses.get(tag) {
            return Ok(bytes);
        }
        let bytes = make()?;
        self.responses.insert(tag.to_owned(), bytes.clone());
        Ok(bytes)
    }

    /// A JSON response that is computed once for each entity tag.
    pub(crate) fn cached_json(
        &self,
        headers: &HeaderMap,
        tag: &str,
        make: impl FnOnce() -> Result<Bytes, Problem>,
    ) -> Result<Response, Problem> {
        reply::tagged(headers, tag, CachePolicy::Revalidate, reply::JSON, || self.cached(tag, make))
    }

    /// Reads what the first requests would otherwise wait for.
    pub(crate) fn warm_up(&self) {
        let read = self.catalogue().and_then(|_| self.database.space(crate::DEFAULT_SPACE));
        if let Err(error) = read {
            tracing::warn!(error = crate::chain(&error), "reading the store ahead failed");
        }
    }

    /// To be called after every change: makes it visible in the lists of later requests.
    pub(crate) fn note_change(&self) -> Result<(), Error> {
        self.changed.fetch_max(self.database.revision()?, Ordering::AcqRel);
        Ok(())
    }

    /// Refuses changes if the server is read-only.
    pub(crate) fn check_writable(&self) -> Result<(), Problem> {
        if self.options.read_only {
            let detail = "this server is read-only: start it without --read-only to change the store";
            return Err(Problem::new(StatusCode::FORBIDDEN, detail));
        }
        Ok(())
    }

    /// Starts a job on a thread of its own.
    ///
    /// # Errors
    /// 409 if too many jobs are running, or a second reindex is asked for.
    pub(crate) fn start_job(
        self: &Arc<Self>,
        kind: JobKind,
        work: impl FnOnce(&Self, &Job) -> Result<JobOutcome, Problem> + Send + 'static,
    ) -> Result<JobReport, Problem> {
        let job = self.jobs.register(kind, self.stopping.clone())?;
        let (app, running) = (Arc::clone(self), Arc::clone(&job));
        // A thread of the runtime would be joined when the server stops; this one is only asked to stop.
        let started = std::thread::Builder::new().name(kind.name().to_owned()).spawn(move || {
            let work = std::panic::AssertUnwindSafe(|| work(&app, &running));
            let outcome = std::panic::catch_unwind(work).unwrap_or_else(|_| Err(Problem::internal()));
            // What was committed before a failure becomes visible too.
            let _ = app.note_change();
            running.end(outcome.map_err(|problem| problem.relative_to(&app.roots)));
        });
        if let Err(error) = started {
            tracing::error!(%error, "cannot start a thread for a job");
            job.end(Err(Problem::internal()));
        }
        Ok(job.report())
    }
}
