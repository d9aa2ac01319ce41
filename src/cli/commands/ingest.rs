//! `hlacdb ingest`.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use hlacdb::Database;
use hlacdb::ingest::{self, IngestEvent, IngestOptions, IngestReport, IngestStatus};
use hlacdb::volume::display_path;

use crate::cli::arguments::{ReadArguments, TagArguments};
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::hints::Advice;
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{bytes, count, duration};

/// Describe volumes (files or folders) and add them to the store
///
/// A folder of PNG, JPEG or TIFF slices is one volume; other folders are searched, in natural order of names. Volumes that are
/// already in the store, by content, are left as they are. A bad file is reported, and the others are added.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb ingest scans/ --tag project=cores
  hlacdb ingest ketton.tif --block 64 --tag rock=ketton      a large volume as 64^3 textures
  hlacdb ingest cores/*.nii.gz --intensity -1000..2000       the same window for all CT volumes
  hlacdb ingest dump/ --raw-shape 64,64,64 --raw-type u8
  hlacdb ingest scans/ --stream | while read line; do ...    one JSON line per texture, once it is durable")]
pub(crate) struct Ingest {
    /// Files and folders
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,

    #[command(flatten)]
    tags: TagArguments,

    /// Cut each volume into blocks of N x N x N voxels; the rest at the far borders is not used
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(3..=4096))]
    block: Option<u32>,

    /// The number of threads that read and describe [default: one per core]
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    jobs: Option<u32>,

    /// Keep the voxels in the store, or only descriptor and provenance
    #[arg(long, value_enum, default_value_t = Volumes::Keep)]
    volumes: Volumes,

    /// Print one JSON line per texture, as soon as it is durable
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
        let exists = |path: &PathBuf| path.symlink_metadata().is_ok();
        if !context.store.exists() && !self.paths.iter().any(exists) {
            let paths: Vec<String> = self.paths.iter().map(|path| display_path(path)).collect();
            let message = format!("{}: no such file or folder; no store was created", paths.join(", "));
            return Err(Failure::message(message));
        }
        let (paths, stream, tagged) = (self.paths.clone(), self.stream, !self.tags.is_empty());
        let options = self.options()?;
        let database = context.open_or_create()?;
        let progress = TerminalProgress::new(context)?;
        let start = Instant::now();
        let mut broken_pipe = None;
        let report = ingest::ingest(&database, &paths, &options, &progress, &mut |event: &IngestEvent| {
            if stream && broken_pipe.is_none() {
                broken_pipe = print_line(context, event).err();
            }
            if let (IngestStatus::Failed, Some(error), false) = (event.status, &event.error, stream) {
                eprintln!("hlacdb: {}", Advice::on(error).line());
            }
        })?;
        drop(progress);
        if let Some(failure) = broken_pipe {
            return Err(failure);
        }
        if context.json && !stream {
            context.print_json(&report)?;
        }
        print_notes(context, &database, &report, tagged)?;
        let size = std::fs::metadata(&context.store).map(|file| file.len()).unwrap_or(0);
        context.note(&format!(
            "{} added, {} already stored, {} failed, in {}{}; the store holds {} in {}",
            count(report.added as usize, "texture"),
            report.duplicates,
            report.failed.len(),
            duration(start.elapsed()),
            if report.cancelled { " (stopped early)" } else { "" },
            count(database.len()? as usize, "texture"),
            bytes(size),
        ));
        Ok(if report.failed.is_empty() && !report.cancelled { Outcome::Done } else { Outcome::Partly })
    }

    fn options(self) -> Result<IngestOptions, Failure> {
        let volumes = match self.volumes {
            Volumes::Keep => hlacdb::Volumes::Keep,
            Volumes::None => hlacdb::Volumes::None,
        };
        let mut options = IngestOptions::new().reading(self.reading.options()).tags(self.tags.map()?).volumes(volumes);
        if let Some(side) = self.block {
            options = options.block(side as usize);
        }
        if let Some(jobs) = self.jobs {
            options = options.jobs(jobs as usize);
        }
        Ok(options)
    }
}

/// What the user should know besides the numbers.
fn print_notes(context: &Context, database: &Database, report: &IngestReport, tagged: bool) -> Result<(), Failure> {
    if report.ids.is_empty() && report.failed.is_empty() && !report.cancelled {
        context.note("no volume was found");
    }
    if report.skipped > 0 {
        let files = count(report.skipped as usize, "file");
        context.note(&format!("{files} of unrecognised formats skipped (-vv names them)"));
    }
    if report.left_over > 0 {
        let voxels = count(report.left_over as usize, "voxel");
        context.note(&format!("{voxels} at the far borders are in no block"));
    }
    if report.duplicates > 0 && tagged {
        context.note("textures that were already stored keep their tags: `hlacdb tag` changes them");
    }
    if report.added > 0 && database.statistics()?.space.drift.is_some_and(|drift| drift.is_far()) {
        context.note("the store has changed much since its spaces were fitted: `hlacdb reindex` fits them again");
    }
    Ok(())
}

/// Prints one line and flushes it, so that its reader can rely on the texture being durable.
fn print_line(context: &mut Context, event: &IngestEvent) -> Result<(), Failure> {
    context.print_json(event)?;
    Ok(context.out().flush()?)
}
