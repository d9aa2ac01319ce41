//! `hlacdb extract`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use hlacdb::hlac::{
    self, ExtractError, Extraction, MASK_COUNT, MASKS, MaskSpacing, RegionSlabExtractor, RegionSums, SlabExtractor,
    Sums, Voxels,
};
use hlacdb::volume::{self, Intensity, ReadError, Shape, SlabReader, Volume};
use hlacdb::{Progress, arrays};
use rayon::prelude::*;
use serde::Serialize;

use super::bars::Bars;
use super::context::chain;
use super::read_arguments::ReadArguments;
use super::table::{Align, Table, count, duration, shape};
use super::values::whole;
use super::{Context, Failure, Outcome};

/// The 251 exact sums and moments of files, without a store
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb extract sample.nrrd --values         every mask's sum and moment
  hlacdb extract scans/*.tif --out moments.npy
  hlacdb --json extract sample.npy
  hlacdb extract core.raw --raw-shape 200,512,512 --raw-type u16le --intensity auto
  hlacdb extract sample.npy --variant sampled --windows 10000 --seed 1    as the paper did
  hlacdb extract sample.npy --spacing 2                   cells two voxels apart: coarser structure
  hlacdb extract core.nrrd --region pores.nrrd --json     only windows whose cells lie where pores.nrrd is not 0

The time shown is that of the sums alone, without reading.

A file whose decoded samples take more than --slab-memory is read slab by slab, with the same answer; its samples must lie
in the order of Z (bare samples, .npy in C order, NRRD, MetaImage, NIfTI, TIFF pages, slices), others are read whole.")]
pub(crate) struct Extract {
    /// Volumes: files, or folders of slices
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,

    /// Write the moments as a numpy array (files, 251) of f32
    #[arg(long, value_name = "F.npy")]
    out: Option<PathBuf>,

    /// Print every mask's sum and moment
    #[arg(long)]
    values: bool,

    /// Which sums
    #[arg(long, value_enum, default_value_t = Variant::Exact)]
    variant: Variant,

    /// `sampled`: how many random windows (for 64^3, exact is cheaper from about 7000 on) [default: 10000, or all there are]
    #[arg(long, value_name = "N", value_parser = whole::<u64>)]
    windows: Option<u64>,

    /// `sampled`: the seed of the random windows
    #[arg(long, value_name = "SEED", default_value_t = 0, value_parser = whole::<u64>)]
    seed: u64,

    /// `exact`: how far apart the cells of a window are, in voxels
    #[arg(long, value_name = "VOXELS", default_value = "1", value_parser = spacing_parser())]
    spacing: MaskSpacing,

    /// `exact`: take only windows whose cells lie where this volume of the same shape is not 0; each mask then has its own
    /// number of windows (`counts` in JSON), by which its moment is divided
    #[arg(long, value_name = "MASK_FILE")]
    region: Option<PathBuf>,

    /// `exact`: read a file whose decoded samples take more than this slab by slab, in slabs that take no more (and a
    /// plane at least; a region is held in memory, a byte per voxel)
    #[arg(long, value_name = "BYTES", default_value_t = SLAB_MEMORY, value_parser = whole::<u64>)]
    slab_memory: u64,

    #[command(flatten)]
    reading: ReadArguments,
}

/// The default of `--slab-memory`: files up to this size are read at once.
const SLAB_MEMORY: u64 = 1 << 30;

/// So many random windows are taken unless said.
const SAMPLED_WINDOWS: u64 = 10_000;

/// The most memory that reading and describing one slab takes, however much may be taken (a plane at least).
const LARGEST_SLAB: u64 = 256 << 20;

fn spacing_parser() -> impl TypedValueParser<Value = MaskSpacing> {
    PossibleValuesParser::new(["1", "2", "4"]).map(|text| match text.as_str() {
        "4" => MaskSpacing::Four,
        "2" => MaskSpacing::Two,
        _ => MaskSpacing::One,
    })
}

/// Which sums are taken.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Variant {
    /// All windows, product of the intensities: the descriptor of the store
    Exact,
    /// Random windows, as the paper took them
    Sampled,
    /// All windows; where all cells of a mask are above 0, the sum of their intensities is added
    HitSum,
}

/// One file's answer.
#[derive(Serialize)]
struct Extracted {
    path: String,
    shape: [usize; 3],
    channels: usize,
    windows: u64,
    elapsed_us: u64,
    sums: Vec<u64>,
    moments: Vec<f64>,
    /// Each mask's windows within the region.
    #[serde(skip_serializing_if = "Option::is_none")]
    counts: Option<Vec<u64>>,
}

/// Why a file gave no sums.
#[derive(Debug, thiserror::Error)]
enum Refused {
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error("{path}: {error}{}", .error.hint().map(|hint| format!(": {hint}")).unwrap_or_default())]
    Extract { path: String, error: ExtractError },
    #[error("{path}: the region has {channels} channels: a region is a grey volume")]
    ColourRegion { path: String, channels: usize },
    /// The person did not want to wait: told once for all files.
    #[error("stopped")]
    Stopped,
}

impl Refused {
    fn told(&self) -> String {
        match self {
            Self::Read(error) => chain(error),
            other => chain(other),
        }
    }
}

/// What the variant asked for makes of a volume.
struct Answer {
    windows: u64,
    sums: [u64; MASK_COUNT],
    moments: [f64; MASK_COUNT],
    counts: Option<[u64; MASK_COUNT]>,
}

impl Answer {
    fn of(sums: &Sums) -> Self {
        Self { windows: sums.windows, sums: sums.values, moments: sums.moments(), counts: None }
    }

    /// `windows` are those of the whole volume.
    fn within(sums: &RegionSums, windows: u64) -> Self {
        Self { windows, sums: sums.values, moments: sums.moments(), counts: Some(sums.windows) }
    }
}

#[derive(Serialize)]
struct Document<'a> {
    files: &'a [Extracted],
    #[serde(skip_serializing_if = "Vec::is_empty")]
    failed: Vec<Failed<'a>>,
}

/// A file that gave no volume.
#[derive(Serialize)]
struct Failed<'a> {
    path: &'a str,
    error: &'a str,
}

impl Extract {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        if self.variant != Variant::Exact && (self.region.is_some() || self.spacing != MaskSpacing::One) {
            let sentence = "--spacing and --region are for exact sums: leave out --variant".into();
            return Err(Failure::Usage(sentence));
        }
        let region = self.region.as_deref().map(|path| self.read_region(path)).transpose()?;
        let saying = "stopping after the files in hand (again to stop at once)";
        let bars = Bars::until(context, context.interruptible_saying(saying)?);
        bars.begin("extracting", Some(self.files.len() as u64));
        let began = Instant::now();
        let answers: Vec<Result<Extracted, Refused>> = self
            .files
            .par_iter()
            .map(|path| {
                let answer = self.extract(path, region.as_ref(), &bars);
                bars.advance(1);
                answer
            })
            .collect();
        let elapsed = began.elapsed();
        let stopped = bars.cancelled();
        drop(bars);
        let (good, bad): (Vec<_>, Vec<_>) =
            answers.into_iter().zip(&self.files).partition(|(answer, _)| answer.is_ok());
        let good: Vec<Extracted> = good.into_iter().filter_map(|(answer, _)| answer.ok()).collect();
        let bad: Vec<(String, String)> = bad
            .into_iter()
            .filter_map(|(answer, path)| Some((answer.err()?, path)))
            .filter(|(error, _)| !matches!(error, Refused::Stopped))
            .map(|(error, path)| (volume::display_path(path), error.told()))
            .collect();
        if stopped {
            // An array with fewer rows than files would be taken for the whole.
            let unwritten = if self.out.is_some() { ", and no array is written" } else { "" };
            context.note(&format!(
                "stopped early: {} of {} done{unwritten}",
                good.len(),
                count(self.files.len(), "file")
            ));
        } else if let Some(out) = &self.out {
            let rows: Vec<f32> = good.iter().flat_map(|file| &file.moments).map(|&moment| moment as f32).collect();
            arrays::write_npy(out, &[good.len(), MASK_COUNT], &rows)?;
        }
        self.print(context, &good, &bad, elapsed)?;
        Ok(if bad.is_empty() && !stopped { Outcome::Done } else { Outcome::Partly })
    }

    /// What is inside is 255, be it a label of 1 in 65535 or -1.
    fn read_region(&self, path: &Path) -> Result<Volume, ReadError> {
        let options = self.reading.options().intensity(Intensity::NonZero);
        Ok(volume::read(path, &options)?.0)
    }

    fn extract(&self, path: &Path, region: Option<&Volume>, progress: &dyn Progress) -> Result<Extracted, Refused> {
        if progress.cancelled() {
            return Err(Refused::Stopped);
        }
        let refused = |error| Refused::Extract { path: volume::display_path(path), error };
        if let Some(channels) = region.map(Volume::channels).filter(|&channels| channels != 1) {
            return Err(Refused::ColourRegion { path: volume::display_path(path), channels });
        }
        let options = self.reading.options();
        if self.variant == Variant::Exact {
            let reader = SlabReader::open(path, &options)?;
            if let Some(mut reader) = reader.filter(|reader| reader.bytes() > self.slab_memory) {
                let mut slabs = self.slabs(reader.shape(), region).map_err(refused)?;
                let planes = reader.planes_within(self.slab_memory.min(LARGEST_SLAB));
                let mut elapsed = Duration::ZERO;
                while let Some(slab) = reader.read(planes)? {
                    if progress.cancelled() {
                        return Err(Refused::Stopped);
                    }
                    let began = Instant::now();
                    slabs.push(slab.first, &slab.grey()).map_err(refused)?;
                    elapsed += began.elapsed();
                }
                let began = Instant::now();
                let answer = slabs.finish().map_err(refused)?;
                elapsed += began.elapsed();
                return Ok(Extracted::new(path, reader.shape(), reader.channels(), elapsed, &answer));
            }
        }
        let (volume, _) = volume::read(path, &options)?;
        let began = Instant::now();
        let answer = self.sums(&volume, region).map_err(refused)?;
        Ok(Extracted::new(path, volume.shape(), volume.channels(), began.elapsed(), &answer))
    }

    /// Many files keep the cores busy by themselves; one file is shared by them.
    fn extraction(&self) -> Extraction {
        Extraction::new().spacing(self.spacing).parallel(self.files.len() == 1)
    }

    /// The sums of a whole volume by the variant asked for.
    fn sums(&self, volume: &Volume, region: Option<&Volume>) -> Result<Answer, ExtractError> {
        let grey = volume.luma();
        let voxels = Voxels::new(grey.voxels(), grey.shape())?;
        Ok(match (self.variant, region) {
            (Variant::Exact, None) => Answer::of(&self.extraction().sums(voxels)?.total()),
            (Variant::Exact, Some(region)) => {
                let region = Voxels::new(region.voxels(), region.shape())?;
                let sums = self.extraction().sums_in(voxels, region)?.total();
                Answer::within(&sums, self.spacing.windows(volume.shape()))
            }
            (Variant::Sampled, _) => {
                let there = MaskSpacing::One.windows(volume.shape());
                let asked = self.windows.unwrap_or(there.min(SAMPLED_WINDOWS));
                Answer::of(&hlac::extract_sampled(voxels, asked, self.seed)?)
            }
            (Variant::HitSum, _) => {
                let sums = hlac::extract_hit_sum(voxels);
                Answer { windows: sums.windows, sums: sums.values, moments: sums.moments(), counts: None }
            }
        })
    }

    /// What takes the slabs of a volume too large to be read whole.
    fn slabs<'a>(&self, shape: Shape, region: Option<&'a Volume>) -> Result<Slabs<'a>, ExtractError> {
        let Some(region) = region else {
            return Ok(Slabs::All(self.extraction().slabs(shape)?));
        };
        if region.shape() != shape {
            return Err(ExtractError::RegionShape { volume: shape, region: region.shape() });
        }
        let extractor = self.extraction().region_slabs(shape)?;
        Ok(Slabs::Within { extractor, region, windows: self.spacing.windows(shape) })
    }

    fn print(
        &self,
        context: &mut Context,
        good: &[Extracted],
        bad: &[(String, String)],
        elapsed: Duration,
    ) -> Result<(), Failure> {
        for (_, error) in bad {
            eprintln!("hlacdb: {error}");
        }
        if context.json {
            let failed = bad.iter().map(|(path, error)| Failed { path, error }).collect();
            return context.print_json(&Document { files: good, failed });
        }
        let mut table = Table::new([
            ("shape", Align::Left),
            ("windows", Align::Right),
            ("sums in", Align::Right),
            ("file", Align::Left),
        ]);
        for file in good {
            let time = duration(Duration::from_micros(file.elapsed_us));
            table.row([shape(Some(file.shape)), file.windows.to_string(), time, file.path.clone()]);
        }
        if !good.is_empty() {
            table.write(context.out())?;
        }
        if self.values {
            for file in good {
                print_values(context, file)?;
            }
        }
        if good.len() > 1 {
            let voxels: usize = good.iter().map(|file| file.shape.iter().product::<usize>()).sum();
            let seconds = elapsed.as_secs_f64();
            context.note(&format!(
                "{} files in {}: {:.1} files/s, {:.1} million voxels/s, reading included",
                good.len(),
                duration(elapsed),
                good.len() as f64 / seconds,
                voxels as f64 / seconds / 1e6
            ));
        }
        Ok(())
    }
}

/// The sums of slabs, of the whole volume or within a region.
enum Slabs<'a> {
    All(SlabExtractor),
    Within { extractor: RegionSlabExtractor, region: &'a Volume, windows: u64 },
}

impl Slabs<'_> {
    /// Takes the next planes, of which `first` is the Z of the first.
    fn push(&mut self, first: usize, planes: &[u8]) -> Result<(), ExtractError> {
        match self {
            Self::All(extractor) => extractor.push(planes),
            Self::Within { extractor, region, .. } => {
                let start = first * region.shape()[1] * region.shape()[2];
                extractor.push(planes, region.voxels().get(start..start + planes.len()).unwrap_or_default())
            }
        }
    }

    fn finish(self) -> Result<Answer, ExtractError> {
        Ok(match self {
            Self::All(extractor) => Answer::of(&extractor.finish()?.total()),
            Self::Within { extractor, windows, .. } => Answer::within(&extractor.finish()?.total(), windows),
        })
    }
}

impl Extracted {
    fn new(path: &Path, shape: Shape, channels: usize, elapsed: Duration, answer: &Answer) -> Self {
        Self {
            path: volume::display_path(path),
            shape,
            channels,
            windows: answer.windows,
            elapsed_us: elapsed.as_micros() as u64,
            sums: answer.sums.to_vec(),
            moments: answer.moments.to_vec(),
            counts: answer.counts.map(|counts| counts.to_vec()),
        }
    }
}

fn print_values(context: &mut Context, file: &Extracted) -> Result<(), Failure> {
    writeln!(context.out(), "\n{}", file.path)?;
    let Some(counts) = &file.counts else {
        let mut table = Table::new([("mask", Align::Left), ("sum", Align::Right), ("moment", Align::Left)]);
        for ((mask, sum), moment) in MASKS.iter().zip(&file.sums).zip(&file.moments) {
            table.row([mask.letters(), sum.to_string(), format!("{moment:.9}")]);
        }
        return Ok(table.write(context.out())?);
    };
    let mut table =
        Table::new([("mask", Align::Left), ("windows", Align::Right), ("sum", Align::Right), ("moment", Align::Left)]);
    for (((mask, count), sum), moment) in MASKS.iter().zip(counts).zip(&file.sums).zip(&file.moments) {
        table.row([mask.letters(), count.to_string(), sum.to_string(), format!("{moment:.9}")]);
    }
    Ok(table.write(context.out())?)
}
