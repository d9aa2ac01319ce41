//! `hlacdb ingest`.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use hlacdb::ingest::{self, Event, Options, Status};
use hlacdb::volume::display_path;

use super::bars::Bars;
use super::read_arguments::ReadArguments;
use super::remedy::with_remedy;
use super::table::{bytes, count, duration};
use super::tag::{KeyValue, one_value_each};
use super::{Context, Failure, Outcome};

/// Describe volumes (files, folders) and add them to the store
///
/// Files may be .npy, .npz, NRRD, MetaImage, NIfTI, TIFF, MagicaVoxel .vox or bare samples; a folder of PNG, JPEG or
/// TIFF slices is one volume. Folders are walked in natural order. What is already in the store, by content, is
/// left as it is; a bad file is reported and the rest goes in.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb ingest scans/ --tag project=cores
  hlacdb ingest ketton.tif --block 64 --tag rock=ketton      a large volume as 64^3 textures
  hlacdb ingest cores/*.nii.gz --intensity -1000..2000       one window for all CT volumes
  hlacdb ingest dump/ --raw-shape 64,64,64 --raw-type u8
  hlacdb ingest scans/ --stream | while read line; do ...    a JSON line as soon as a texture is safe")]
pub(crate) struct Ingest {
    /// Files and folders
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,

    /// A tag for every texture added (repeatable)
    #[arg(long = "tag", value_name = "KEY=VALUE")]
    tags: Vec<KeyValue>,

    /// Cut each volume into blocks of N x N x N voxels; what is left over at the far borders is not used
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(3..=4096))]
    block: Option<u32>,

    /// How many threads read and describe [default: all cores]
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,

    /// Keep the voxels in the store, or only descriptor and provenance
    #[arg(long, value_enum, default_value_t = Volumes::Keep)]
    volumes: Volumes,

    /// Print one JSON line per texture as soon as it is durable
    #[arg(long)]
    stream: bool,

    #[command(flatten)]
    reading: ReadArguments,
}

#[derive(Clone, Copy, ValueEnum)]
enum Volumes {
    Keep,
    None,
}

impl Ingest {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let tags = one_value_each(self.tags)?;
        let is_there = |path: &PathBuf| path.symlink_metadata().is_ok();
        if !context.store.exists() && !self.paths.iter().any(is_there) {
            let shown: Vec<String> = self.paths.iter().map(|path| display_path(path)).collect();
            return Err(Failure::sentence(format!(
                "{}: nothing is there to ingest, and no store was made: check the path",
                shown.join(", ")
            )));
        }
        let database = context.open_or_create()?;
        let options = Options {
            reading: self.reading.options(),
            tags,
            block: self.block.map(|side| side as usize),
            jobs: self.jobs.map(|jobs| jobs as usize),
            within: None,
            volumes: match self.volumes {
                Volumes::Keep => hlacdb::store::Volumes::Keep,
                Volumes::None => hlacdb::store::Volumes::None,
            },
        };
        let bars = Bars::until(context, context.interruptible()?);
        let began = Instant::now();
        let stream = self.stream;
        let mut broken_pipe = None;
        let report = ingest::ingest(&database, &self.paths, &options, &bars, &mut |event: &Event| {
            if stream && broken_pipe.is_none() {
                broken_pipe = print_line(context, event).err();
            }
            if let (Status::Failed, Some(error), false) = (event.status, &event.error, stream) {
                eprintln!("hlacdb: {}", with_remedy(error));
            }
        })?;
        drop(bars);
        if let Some(failure) = broken_pipe {
            return Err(failure);
        }
        if context.json && !stream {
            context.print_json(&report)?;
        }
        if report.ids.is_empty() && report.failed.is_empty() && !report.cancelled {
            context.note("no volume was found");
        }
        if report.skipped > 0 {
            let files = count(report.skipped as usize, "file");
            context.note(&format!("{files} of unknown kinds skipped (-vv names them)"));
        }
        if report.left_over > 0 {
            let voxels = count(report.left_over as usize, "voxel");
            context.note(&format!("{voxels} at far borders are in no block"));
        }
        if report.duplicates > 0 && !options.tags.is_empty() {
            context.note("what was there already keeps its tags: `hlacdb tag` changes them");
        }
        if report.added > 0 && database.statistics()?.space.drift.is_some_and(|drift| drift.is_far()) {
            context.note("the store is far from what its space was fitted on: `hlacdb reindex` fits it on everything");
        }
        let size = std::fs::metadata(&context.store).map(|file| file.len()).unwrap_or(0);
        context.note(&format!(
            "{} added, {} already there, {} failed, in {}{}; the store holds {} in {}",
            count(report.added as usize, "texture"),
            report.duplicates,
            report.failed.len(),
            duration(began.elapsed()),
            if report.cancelled { " (stopped early)" } else { "" },
            count(database.len()? as usize, "texture"),
            bytes(size),
        ));
        Ok(if report.failed.is_empty() && !report.cancelled { Outcome::Done } else { Outcome::Partly })
    }
}

/// One line, out at once: whoever reads it may rely on the texture being safe.
fn print_line(context: &mut Context, event: &Event) -> Result<(), Failure> {
    context.print_json(event)?;
    Ok(context.out().flush()?)
}
