//! From paths to committed textures.
//!
//! Workers read and describe in parallel; one thread commits, in the order of the input, in batches of one
//! transaction each. Only what is durable is reported. At most a few volumes per worker are in memory at a time.
//! A bad file is reported and the rest goes in; what is in the store already (by content) is left as it is, so
//! that an interrupted ingest is completed by running it again.

mod confined;
mod extract;
mod ordered;
pub mod recipes;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

pub use confined::confined;
pub use extract::{
    ExtractFileError, ExtractOptions, ExtractReport, ExtractVariant, ExtractedFile, FailedExtraction, SAMPLED_WINDOWS,
    extract_files,
};

use crate::TextureId;
use crate::database::{Added, BlockOf, Database, Meta, Prepared};
use crate::error::{Error, IngestError, chain};
use crate::progress::Progress;
use crate::store::Volumes;
use crate::synth::{Recipe, Specimen};
use crate::volume::{self, ReadOptions, VolumeSource};

/// How files are read, cut, tagged and kept.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// How files are read.
    pub reading: ReadOptions,
    /// Tags of every texture that is added.
    pub tags: BTreeMap<String, String>,
    /// Cut each volume into cubes of this side (3 or more); what is left over at the far borders is not used.
    pub block: Option<usize>,
    /// How many threads read and describe; all cores unless said.
    pub jobs: Option<usize>,
    /// Whether voxels are kept.
    pub volumes: Volumes,
    /// Files are recorded and told of by their path below this folder, where they lie in it; as they are named unless set.
    pub within: Option<PathBuf>,
}

impl Options {
    /// A path as it is recorded and told of.
    fn shown(&self, path: &Path) -> PathBuf {
        let Some(below) = self.within.as_deref().and_then(|folder| path.strip_prefix(folder).ok()) else {
            return path.to_path_buf();
        };
        // The folder itself goes by its name.
        let itself = below.as_os_str().is_empty();
        if itself { path.file_name().unwrap_or_default().into() } else { below.to_path_buf() }
    }

    /// What was wrong with a file, by its shown path.
    fn read(&self, path: &Path) -> Result<(volume::Volume, VolumeSource), volume::ReadError> {
        volume::read(path, &self.reading).map_err(|error| self.renamed(error))
    }

    fn renamed(&self, error: volume::ReadError) -> volume::ReadError {
        let path = self.shown(&error.path);
        error.with_path(path)
    }
}

/// What became of one texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// It is in the store, durably.
    Added,
    /// The same content was in the store already.
    Duplicate,
    /// It could not be read.
    Failed,
}

/// One texture's outcome, told once it is durable.
#[derive(Debug, Serialize)]
pub struct Event {
    /// The texture's id, `None` where it failed.
    pub id: Option<TextureId>,
    /// The file or folder it came from; for a synthetic texture, its name.
    #[serde(serialize_with = "as_shown")]
    pub path: PathBuf,
    /// What became of it.
    pub status: Status,
    /// Why it failed.
    #[serde(skip_serializing_if = "Option::is_none", serialize_with = "as_chain_if_any")]
    pub error: Option<Error>,
}

/// A file that gave no texture.
#[derive(Debug, Serialize)]
pub struct Failed {
    /// The file or folder.
    #[serde(serialize_with = "as_shown")]
    pub path: PathBuf,
    /// Why.
    #[serde(serialize_with = "as_chain")]
    pub error: Error,
}

fn as_shown<S: serde::Serializer>(path: &Path, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&volume::display_path(path))
}

fn as_chain<S: serde::Serializer>(error: &Error, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(&chain(error))
}

fn as_chain_if_any<S: serde::Serializer>(error: &Option<Error>, serializer: S) -> Result<S::Ok, S::Error> {
    error.as_ref().map(|error| chain(error)).serialize(serializer)
}

/// What an ingest did.
#[derive(Debug, Default, Serialize)]
pub struct Report {
    /// Textures added.
    pub added: u64,
    /// Textures that were in the store already.
    pub duplicates: u64,
    /// Files that gave no texture.
    pub failed: Vec<Failed>,
    /// Files in folders that were passed over because no volume has such a name.
    pub skipped: u64,
    /// Voxels of cut volumes that are in no block: what was left over at far borders.
    #[serde(skip_serializing_if = "is_none")]
    pub left_over: u64,
    /// The ids of all textures given, in input order, those that were there already included.
    pub ids: Vec<TextureId>,
    /// True where the caller stopped it: what is reported as added is safe, the rest was not begun.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub cancelled: bool,
}

fn is_none(count: &u64) -> bool {
    *count == 0
}

impl Report {
    fn count(&mut self, event: Event) {
        match event.status {
            Status::Added => self.added += 1,
            Status::Duplicate => self.duplicates += 1,
            Status::Failed => {
                self.failed.extend(event.error.map(|error| Failed { path: event.path, error }));
            }
        }
        self.ids.extend(event.id);
    }
}

/// A batch is committed once it has so many textures, ...
const BATCH_TEXTURES: usize = 64;
/// ... or so many bytes of compressed voxels, ...
const BATCH_BYTES: usize = 64 << 20;
/// ... or once its first texture has waited so long.
const BATCH_AGE: Duration = Duration::from_millis(250);
/// So many items per worker may be begun and not yet committed.
const IN_FLIGHT: usize = 3;

/// Reads, describes and adds the volumes at `paths` (files, or folders walked in natural order).
///
/// `on_event` is called once per texture, in input order, as soon as it is durable (or has failed). The returned report
/// counts them. Where `progress` cancels, what is begun is finished, committed and reported.
///
/// # Errors
/// Only what ends the whole ingest: the store cannot be written. A bad file is an event, not an error.
pub fn ingest(
    database: &Database,
    paths: &[PathBuf],
    options: &Options,
    progress: &dyn Progress,
    on_event: &mut dyn FnMut(&Event),
) -> Result<Report, Error> {
    let raw = options.reading.raw.is_some();
    let (files, skipped) = discover_all(paths, raw);
    progress.begin("ingesting", Some(files.len() as u64));
    let pool = workers(options.jobs)?;
    let mut batch = Batch::new(database, progress, on_event);
    batch.report.skipped = skipped;
    match options.block {
        None => {
            let read = |file| one_per_file(database, file, options);
            let in_flight = IN_FLIGHT * pool.current_num_threads();
            ordered::map(&pool, in_flight, BATCH_AGE, files, read, |next| batch.take(next));
        }
        Some(side) => {
            for file in files {
                if progress.cancelled() || batch.error.is_some() {
                    break;
                }
                cut(&pool, file, side, options, &mut batch);
            }
        }
    }
    batch.finish()
}

/// The volumes of all paths, and how many files were passed over.
fn discover_all(paths: &[PathBuf], raw: bool) -> (Vec<Result<PathBuf, volume::ReadError>>, u64) {
    let (mut files, mut skipped) = (Vec::new(), 0);
    for path in paths {
        let mut discovery = volume::discover(path, raw);
        files.extend(discovery.by_ref());
        skipped += discovery.skipped();
    }
    (files, skipped)
}

/// Synthesises a recipe's textures and adds them, as [`ingest`] does files. They are tagged as the recipe says, and with
/// `recipe`, its name.
///
/// # Errors
/// Only what ends the whole: the store cannot be written.
pub fn synthesise(
    database: &Database,
    recipe: &Recipe,
    progress: &dyn Progress,
    on_event: &mut dyn FnMut(&Event),
) -> Result<Report, Error> {
    let specimens = recipe.specimens();
    progress.begin("synthesising", Some(specimens.len() as u64));
    let pool = workers(None)?;
    let describe = |specimen: Specimen| {
        let mut tags = specimen.tags.clone();
        tags.entry("recipe".into()).or_insert_with(|| recipe.name().to_owned());
        let meta = Meta::named(specimen.name.clone()).tags(tags).source(VolumeSource::SYNTHETIC);
        let prepared = database.prepare(specimen.volume(), meta, Volumes::Keep);
        Item { path: specimen.name.into(), prepared, files: 1 }
    };
    let mut batch = Batch::new(database, progress, on_event);
    let in_flight = IN_FLIGHT * pool.current_num_threads();
    ordered::map(&pool, in_flight, BATCH_AGE, specimens, describe, |next| batch.take(next));
    batch.finish()
}

/// The threads that read and describe: so many, or one per core.
fn workers(jobs: Option<usize>) -> Result<rayon::ThreadPool, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0)).build();
    pool.map_err(|error| Error::io("starting the worker threads", std::io::Error::other(error)))
}

/// What a worker made of one texture: its path as shown, and what is to be committed, or why there is nothing.
struct Item {
    path: PathBuf,
    prepared: Result<Prepared, Error>,
    /// How many files are done with this item (0 for all but the last block of one).
    files: u64,
}

fn one_per_file(database: &Database, file: Result<PathBuf, volume::ReadError>, options: &Options) -> Item {
    let (path, read) = match file {
        Ok(path) => (path.clone(), options.read(&path).map_err(Error::from)),
        Err(error) => (error.path.clone(), Err(options.renamed(error).into())),
    };
    let prepared = read.and_then(|(volume, source)| {
        let meta = meta(&path, options).source(source);
        database.prepare(volume, meta, options.volumes)
    });
    Item { path: options.shown(&path), prepared, files: 1 }
}

fn meta(path: &Path, options: &Options) -> Meta {
    let path = &options.shown(path);
    let name =
        path.file_name().map_or_else(|| volume::display_path(path), |name| volume::display_path(Path::new(name)));
    Meta::named(name).path(path).tags(options.tags.clone())
}

/// One file as blocks: read whole, described block by block in parallel.
fn cut(
    pool: &rayon::ThreadPool,
    file: Result<PathBuf, volume::ReadError>,
    side: usize,
    options: &Options,
    batch: &mut Batch<'_>,
) {
    let fail = |path: &Path, error| Item { path: options.shown(path), prepared: Err(error), files: 1 };
    let path = match file {
        Ok(path) => path,
        Err(error) => return batch.push(fail(&error.path.clone(), options.renamed(error).into())),
    };
    let (volume, source) = match pool.install(|| options.read(&path)) {
        Ok(read) => read,
        Err(error) => return batch.push(fail(&path, error.into())),
    };
    let origins: Vec<_> = volume.block_origins(side).collect();
    let count = origins.len();
    let too_large = || {
        let (path, shape) = (options.shown(&path), volume.shape());
        Error::from(IngestError::BlockTooLarge { path, shape, side })
    };
    if count == 0 {
        return batch.push(fail(&path, too_large()));
    }
    let whole: usize = volume.shape().iter().product();
    batch.report.left_over += (whole - count * side.pow(3)) as u64;
    let database = batch.database;
    let describe = |(number, origin): (usize, volume::Shape)| {
        let prepared = volume.block(origin, [side; 3]).ok_or_else(too_large).and_then(|block| {
            let [z, y, x] = origin;
            let mut meta = meta(&path, options).source(source).block(BlockOf { origin, shape: volume.shape() });
            meta.name = format!("{}[{z},{y},{x}]", meta.name);
            database.prepare(block, meta, options.volumes)
        });
        Item { path: options.shown(&path), prepared, files: u64::from(number + 1 == count) }
    };
    let in_flight = IN_FLIGHT * pool.current_num_threads();
    ordered::map(pool, in_flight, BATCH_AGE, origins.into_iter().enumerate(), describe, |next| batch.take(next));
}

/// Textures on their way into one transaction.
struct Batch<'a> {
    database: &'a Database,
    progress: &'a dyn Progress,
    on_event: &'a mut dyn FnMut(&Event),
    items: Vec<Item>,
    bytes: usize,
    since: Option<Instant>,
    report: Report,
    error: Option<Error>,
}

impl<'a> Batch<'a> {
    fn new(database: &'a Database, progress: &'a dyn Progress, on_event: &'a mut dyn FnMut(&Event)) -> Self {
        let report = Report::default();
        Self { database, progress, on_event, items: Vec::new(), bytes: 0, since: None, report, error: None }
    }

    /// Takes the next result; commits where the batch is full or old; breaks where the caller or an error stops it.
    fn take(&mut self, next: ordered::Next<Item>) -> ControlFlow<()> {
        if let ordered::Next::Result(item) = next {
            self.push(item);
        }
        if self.since.is_some_and(|since| since.elapsed() >= BATCH_AGE) {
            self.commit();
        }
        if self.error.is_some() || self.progress.cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    fn push(&mut self, item: Item) {
        self.bytes += item.prepared.as_ref().map_or(0, Prepared::stored_bytes);
        self.items.push(item);
        self.since.get_or_insert_with(Instant::now);
        if self.items.len() >= BATCH_TEXTURES || self.bytes >= BATCH_BYTES {
            self.commit();
        }
    }

    /// Commits what is in hand and tells of it; after an error, nothing more is committed.
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
            outcomes.push((item.path, item.prepared.map(|ready| prepared.push(ready))));
        }
        let mut added = match self.database.commit(prepared) {
            Ok(added) => added.into_iter(),
            Err(error) => {
                self.error = Some(error);
                return;
            }
        };
        for (path, outcome) in outcomes {
            let event = match (outcome, &mut added) {
                (Ok(()), added) => match added.next() {
                    Some(Added::New(id)) => Event { id: Some(id), path, status: Status::Added, error: None },
                    Some(Added::Duplicate(id)) => Event { id: Some(id), path, status: Status::Duplicate, error: None },
                    None => continue,
                },
                (Err(error), _) => Event { id: None, path, status: Status::Failed, error: Some(error) },
            };
            (self.on_event)(&event);
            self.report.count(event);
        }
        self.progress.advance(files);
    }

    fn finish(mut self) -> Result<Report, Error> {
        self.commit();
        self.report.cancelled = self.progress.cancelled();
        match self.error {
            Some(error) => Err(error),
            None => Ok(self.report),
        }
    }
}
