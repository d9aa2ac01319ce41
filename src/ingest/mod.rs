//! From files, and from recipes of synthetic textures, to textures in a database.
//!
//! Workers read and describe volumes in parallel; one thread commits them, in input order, in batches of one transaction
//! each. Only what is durable is reported. A few volumes per worker are in memory at a time.
//!
//! A file that cannot be read is reported, and the others are added. Content that is in the store already is left as it is,
//! so an interrupted ingest is completed by running it again.

mod batch;
mod confined;
mod extract;
mod options;
mod ordered;
mod recipes;
mod report;

use std::path::{Path, PathBuf};

pub use confined::resolve_within;
pub use extract::{
    ExtractFileError, ExtractOptions, ExtractReport, ExtractVariant, ExtractedFile, FailedExtraction, SAMPLED_WINDOWS,
    extract_files,
};
pub use options::IngestOptions;
pub use recipes::{SpecimenFormat, write_recipe_files};
pub use report::{FailedFile, IngestEvent, IngestReport, IngestStatus};

use self::batch::{BATCH_AGE, Batch, Item};
use crate::database::{BlockOf, Database, Meta};
use crate::error::{Error, IngestError};
use crate::progress::Progress;
use crate::store::Volumes;
use crate::synth::{Recipe, Specimen};
use crate::volume::{self, ReadError, Shape, VolumeSource};

/// The number of items per worker that may be begun and not yet committed.
const IN_FLIGHT: usize = 3;

/// Reads, describes and adds the volumes at `paths`: files, or folders that are searched in natural order.
///
/// `on_event` is called once per texture, in input order, as soon as the texture is durable or has failed. If `progress`
/// cancels, what was begun is finished, committed and reported.
///
/// # Errors
/// Only what ends the whole ingest: the store cannot be written. A file that cannot be read is an event, not an error.
pub fn ingest(
    database: &Database,
    paths: &[PathBuf],
    options: &IngestOptions,
    progress: &dyn Progress,
    on_event: &mut dyn FnMut(&IngestEvent),
) -> Result<IngestReport, Error> {
    let raw = options.reading.raw.is_some();
    let (files, skipped) = discover_all(paths, raw);
    progress.begin("ingesting", Some(files.len() as u64));
    let pool = workers(options.jobs)?;
    let mut batch = Batch::new(database, progress, on_event);
    batch.report.skipped = skipped;
    match options.block {
        None => {
            let prepare = |file| whole_file(database, file, options);
            let in_flight = IN_FLIGHT * pool.current_num_threads();
            ordered::map(&pool, in_flight, BATCH_AGE, files, prepare, |next| batch.take(next));
        }
        Some(side) => {
            for file in files {
                if batch.is_stopped() {
                    break;
                }
                file_in_blocks(&pool, file, side, options, &mut batch);
            }
        }
    }
    batch.finish()
}

/// Synthesises the textures of a recipe and adds them, as [`ingest`] does with files. They have the tags that the recipe
/// gives them, and a tag `recipe` with its name.
///
/// # Errors
/// As [`ingest`].
pub fn ingest_recipe(
    database: &Database,
    recipe: &Recipe,
    progress: &dyn Progress,
    on_event: &mut dyn FnMut(&IngestEvent),
) -> Result<IngestReport, Error> {
    let specimens = recipe.specimens();
    progress.begin("synthesising", Some(specimens.len() as u64));
    let pool = workers(None)?;
    let prepare = |specimen: Specimen| {
        let mut tags = specimen.tags.clone();
        tags.entry("recipe".into()).or_insert_with(|| recipe.name().to_owned());
        let meta = Meta::named(specimen.name.clone()).tags(tags).source(VolumeSource::SYNTHETIC);
        let prepared = database.prepare(specimen.volume(), meta, Volumes::Keep);
        Item { path: specimen.name.into(), prepared, files: 1 }
    };
    let mut batch = Batch::new(database, progress, on_event);
    let in_flight = IN_FLIGHT * pool.current_num_threads();
    ordered::map(&pool, in_flight, BATCH_AGE, specimens, prepare, |next| batch.take(next));
    batch.finish()
}

/// The volumes of all paths, and the number of files that were skipped.
fn discover_all(paths: &[PathBuf], raw: bool) -> (Vec<Result<PathBuf, ReadError>>, u64) {
    let (mut files, mut skipped) = (Vec::new(), 0);
    for path in paths {
        let mut discovery = volume::discover(path, raw);
        files.extend(discovery.by_ref());
        skipped += discovery.skipped();
    }
    (files, skipped)
}

/// The threads that read and describe: one per core by default.
fn workers(jobs: Option<usize>) -> Result<rayon::ThreadPool, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0)).build();
    pool.map_err(|error| Error::io("starting the worker threads", std::io::Error::other(error)))
}

/// A file as one texture.
fn whole_file(database: &Database, file: Result<PathBuf, ReadError>, options: &IngestOptions) -> Item {
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

fn meta(path: &Path, options: &IngestOptions) -> Meta {
    let path = &options.shown(path);
    let name = path.file_name().map_or(path.as_path(), Path::new);
    Meta::named(volume::display_path(name)).path(path).tags(options.tags.clone())
}

/// A file as blocks: read whole, described block by block in parallel.
fn file_in_blocks(
    pool: &rayon::ThreadPool,
    file: Result<PathBuf, ReadError>,
    side: usize,
    options: &IngestOptions,
    batch: &mut Batch<'_>,
) {
    let failed = |path: &Path, error| Item { path: options.shown(path), prepared: Err(error), files: 1 };
    let path = match file {
        Ok(path) => path,
        Err(error) => return batch.push(failed(&error.path.clone(), options.renamed(error).into())),
    };
    let (volume, source) = match pool.install(|| options.read(&path)) {
        Ok(read) => read,
        Err(error) => return batch.push(failed(&path, error.into())),
    };
    let origins: Vec<_> = volume.block_origins(side).collect();
    let count = origins.len();
    let too_large = || {
        let (path, shape) = (options.shown(&path), volume.shape());
        Error::from(IngestError::BlockTooLarge { path, shape, side })
    };
    if count == 0 {
        return batch.push(failed(&path, too_large()));
    }
    let voxels: usize = volume.shape().iter().product();
    batch.report.left_over += (voxels - count * side.pow(3)) as u64;
    let database = batch.database;
    let prepare = |(number, origin): (usize, Shape)| {
        let prepared = volume.block(origin, [side; 3]).ok_or_else(too_large).and_then(|block| {
            let [z, y, x] = origin;
            let mut meta = meta(&path, options).source(source).block(BlockOf { origin, shape: volume.shape() });
            meta.name = format!("{}[{z},{y},{x}]", meta.name);
            database.prepare(block, meta, options.volumes)
        });
        Item { path: options.shown(&path), prepared, files: u64::from(number + 1 == count) }
    };
    let in_flight = IN_FLIGHT * pool.current_num_threads();
    ordered::map(pool, in_flight, BATCH_AGE, origins.into_iter().enumerate(), prepare, |next| batch.take(next));
}
