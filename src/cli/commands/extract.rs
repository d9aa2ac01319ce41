//! `hlacdb extract`.

use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use hlacdb::arrays;
use hlacdb::hlac::{MASK_COUNT, MASKS, MaskSpacing};
use hlacdb::ingest::{ExtractOptions, ExtractReport, ExtractVariant, ExtractedFile, FailedExtraction, extract_files};
use hlacdb::volume::display_path;
use serde::Serialize;

use crate::cli::arguments::{ReadArguments, whole};
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::hints::Advice;
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{Align, Table, count, duration, shape};

/// Compute the 251 HLAC sums and moments of files, without a store
///
/// The time in the table is that of the sums alone, without reading.
///
/// A file whose decoded samples are larger than --slab-memory is read slab by slab, with the same result. Its samples must be
/// stored in the order of Z (raw samples, .npy in C order, NRRD, MetaImage, NIfTI, TIFF pages, slices); other files are read
/// whole.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb extract sample.nrrd --values                     the sum and moment of every mask
  hlacdb extract scans/*.tif --out moments.npy
  hlacdb --json extract sample.npy
  hlacdb extract core.raw --raw-shape 200,512,512 --raw-type u16le --intensity auto
  hlacdb extract sample.npy --variant sampled --windows 10000 --seed 1    random windows, as in the paper
  hlacdb extract sample.npy --spacing 2                   cells two voxels apart: coarser structure
  hlacdb --json extract core.nrrd --region pores.nrrd     only windows whose cells lie where pores.nrrd is not 0")]
pub(crate) struct Extract {
    /// Volumes: files, or folders of slices
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,

    /// Write the moments as a numpy array (files, 251) of f32
    #[arg(long, value_name = "F.npy")]
    out: Option<PathBuf>,

    /// Print the sum and moment of every mask
    #[arg(long)]
    values: bool,

    /// Which sums to compute
    #[arg(long, value_enum, default_value_t = Variant::Exact)]
    variant: Variant,

    /// For `sampled`: the number of random windows; for 64^3, exact sums are cheaper from about 7000 on [default: 10000, or
    /// all there are]
    #[arg(long, value_name = "N", value_parser = whole::<u64>)]
    windows: Option<u64>,

    /// For `sampled`: the seed of the random windows
    #[arg(long, value_name = "SEED", default_value_t = 0, value_parser = whole::<u64>)]
    seed: u64,

    /// For `exact`: the distance between the cells of a window, in voxels
    #[arg(long, value_name = "VOXELS", default_value = "1", value_parser = spacing_parser())]
    spacing: MaskSpacing,

    /// For `exact`: only windows whose cells all lie where this volume of the same shape is not 0. Each mask then has its own
    /// number of windows (`counts` in JSON)
    #[arg(long, value_name = "MASK_FILE")]
    region: Option<PathBuf>,

    /// For `exact`: read files with more bytes of decoded samples in slabs of at most this size (at least one plane; a region
    /// is kept in memory, one byte per voxel)
    #[arg(long, value_name = "BYTES", default_value_t = ExtractOptions::SLAB_MEMORY, value_parser = whole::<u64>)]
    slab_memory: u64,

    #[command(flatten)]
    reading: ReadArguments,
}

fn spacing_parser() -> impl TypedValueParser<Value = MaskSpacing> {
    PossibleValuesParser::new(["1", "2", "4"]).map(|text| match text.as_str() {
        "4" => MaskSpacing::Four,
        "2" => MaskSpacing::Two,
        _ => MaskSpacing::One,
    })
}

/// Which sums to compute.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Variant {
    /// All windows, products of intensities: the descriptor of the store
    Exact,
    /// Random windows, as in the paper
    Sampled,
    /// All windows; where all cells of a mask are above 0, the sum of their intensities
    HitSum,
}

#[derive(Serialize)]
struct Document<'a> {
    files: &'a [ExtractedFile],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    failed: Vec<FailedFile>,
}

/// A file without sums.
#[derive(Serialize)]
struct FailedFile {
    path: String,
    error: String,
}

impl From<&FailedExtraction> for FailedFile {
    fn from(failed: &FailedExtraction) -> Self {
        Self { path: display_path(&failed.path), error: Advice::on(&failed.error).line() }
    }
}

impl Extract {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let options = self.options()?;
        let message = "stopping after the current files (press again to stop at once)";
        let progress = TerminalProgress::with_message(context, message)?;
        let start = Instant::now();
        let report = extract_files(&self.files, &options, &progress)?;
        let elapsed = start.elapsed();
        drop(progress);
        if report.cancelled {
            // An array with fewer rows than files would be mistaken for the whole.
            let no_array = if self.out.is_some() { "; no array was written" } else { "" };
            let (done, all) = (report.files.len(), count(self.files.len(), "file"));
            context.note(&format!("stopped early: {done} of {all} done{no_array}"));
        } else if let Some(out) = &self.out {
            let moments = report.files.iter().flat_map(|file| &file.moments);
            let rows: Vec<f32> = moments.map(|&moment| moment as f32).collect();
            arrays::write_npy(out, &[report.files.len(), MASK_COUNT], &rows)?;
        }
        self.print(context, &report, elapsed)?;
        Ok(if report.failed.is_empty() && !report.cancelled { Outcome::Done } else { Outcome::Partly })
    }

    fn options(&self) -> Result<ExtractOptions, Failure> {
        if self.variant != Variant::Exact && (self.region.is_some() || self.spacing != MaskSpacing::One) {
            return Err(Failure::Usage("--spacing and --region need --variant exact".into()));
        }
        let variant = match self.variant {
            Variant::Exact => ExtractVariant::Exact { spacing: self.spacing, region: self.region.clone() },
            Variant::Sampled => ExtractVariant::Sampled { windows: self.windows, seed: self.seed },
            Variant::HitSum => ExtractVariant::HitSum,
        };
        Ok(ExtractOptions::new().reading(self.reading.options()).variant(variant).slab_memory(self.slab_memory))
    }

    fn print(&self, context: &mut Context, report: &ExtractReport, elapsed: Duration) -> Result<(), Failure> {
        let failed: Vec<FailedFile> = report.failed.iter().map(FailedFile::from).collect();
        for FailedFile { error, .. } in &failed {
            eprintln!("hlacdb: {error}");
        }
        if context.json {
            return context.print_json(&Document { files: &report.files, failed });
        }
        let mut table = Table::new([
            ("shape", Align::Left),
            ("windows", Align::Right),
            ("sums in", Align::Right),
            ("file", Align::Left),
        ]);
        for file in &report.files {
            let time = duration(file.elapsed);
            table.row([shape(Some(file.shape)), file.windows.to_string(), time, file.path.clone()]);
        }
        if !report.files.is_empty() {
            table.write(context.out())?;
        }
        if self.values {
            for file in &report.files {
                print_values(context, file)?;
            }
        }
        if report.files.len() > 1 {
            let voxels: usize = report.files.iter().map(|file| file.shape.iter().product::<usize>()).sum();
            let seconds = elapsed.as_secs_f64();
            context.note(&format!(
                "{} files in {}: {:.1} files/s, {:.1} million voxels/s, including reading",
                report.files.len(),
                duration(elapsed),
                report.files.len() as f64 / seconds,
                voxels as f64 / seconds / 1e6
            ));
        }
        Ok(())
    }
}

fn print_values(context: &mut Context, file: &ExtractedFile) -> Result<(), Failure> {
    writeln!(context.out(), "\n{}", file.path)?;
    let values = || MASKS.iter().zip(&file.sums).zip(&file.moments);
    let cells = |sum: &u64, moment: &f64| [sum.to_string(), format!("{moment:.9}")];
    let Some(counts) = &file.counts else {
        let mut table = Table::new([("mask", Align::Left), ("sum", Align::Right), ("moment", Align::Left)]);
        for ((mask, sum), moment) in values() {
            let [sum, moment] = cells(sum, moment);
            table.row([mask.letters(), sum, moment]);
        }
        return Ok(table.write(context.out())?);
    };
    let mut table =
        Table::new([("mask", Align::Left), ("windows", Align::Right), ("sum", Align::Right), ("moment", Align::Left)]);
    for (((mask, sum), moment), count) in values().zip(counts) {
        let [sum, moment] = cells(sum, moment);
        table.row([mask.letters(), count.to_string(), sum, moment]);
    }
    Ok(table.write(context.out())?)
}
