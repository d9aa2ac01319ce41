//! `hlacdb extract`.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use hlacdb::hlac::{self, MASK_COUNT, MASKS, Sums};
use hlacdb::volume::{self, Volume};
use hlacdb::{Progress, arrays};
use rayon::prelude::*;
use serde::Serialize;

use super::bars::Bars;
use super::context::chain;
use super::read_arguments::ReadArguments;
use super::table::{Align, Table, duration, shape};
use super::{Context, Failure, Outcome};

/// The 251 exact sums and moments of files, without a store
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb extract sample.nrrd --values         every mask's sum and moment
  hlacdb extract scans/*.tif --out moments.npy
  hlacdb --json extract sample.npy
  hlacdb extract core.raw --raw-shape 200,512,512 --raw-type u16le --intensity auto
  hlacdb extract sample.npy --variant sampled --windows 10000 --seed 1    as the paper did

The time shown is that of the sums alone, without reading.")]
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

    /// `sampled`: how many random windows (from about 30000 on, exact is cheaper)
    #[arg(long, value_name = "N", default_value_t = 10_000)]
    windows: u64,

    /// `sampled`: the seed of the random windows
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    seed: u64,

    #[command(flatten)]
    reading: ReadArguments,
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
        let bars = Bars::new(context);
        bars.begin("extracting", Some(self.files.len() as u64));
        let began = Instant::now();
        let answers: Vec<Result<Extracted, hlacdb::Error>> = self
            .files
            .par_iter()
            .map(|path| {
                let answer = self.extract(path);
                bars.advance(1);
                answer
            })
            .collect();
        let elapsed = began.elapsed();
        drop(bars);
        let (good, bad): (Vec<_>, Vec<_>) =
            answers.into_iter().zip(&self.files).partition(|(answer, _)| answer.is_ok());
        let good: Vec<Extracted> = good.into_iter().filter_map(|(answer, _)| answer.ok()).collect();
        let bad: Vec<(String, String)> = bad
            .into_iter()
            .filter_map(|(answer, path)| answer.err().map(|error| (volume::display_path(path), chain(&error))))
            .collect();
        if let Some(out) = &self.out {
            let rows: Vec<f32> = good.iter().flat_map(|file| &file.moments).map(|&moment| moment as f32).collect();
            arrays::write_npy(out, &[good.len(), MASK_COUNT], &rows)?;
        }
        self.print(context, &good, &bad, elapsed)?;
        Ok(if bad.is_empty() { Outcome::Done } else { Outcome::Partly })
    }

    fn extract(&self, path: &Path) -> Result<Extracted, hlacdb::Error> {
        let (volume, _) = volume::read(path, &self.reading.options())?;
        let began = Instant::now();
        let (windows, sums, moments) = self.sums(&volume);
        let elapsed_us = began.elapsed().as_micros() as u64;
        Ok(Extracted {
            path: volume::display_path(path),
            shape: volume.shape(),
            channels: volume.channels(),
            windows,
            elapsed_us,
            sums: sums.to_vec(),
            moments: moments.to_vec(),
        })
    }

    /// Windows, sums and moments by the variant asked for.
    fn sums(&self, volume: &Volume) -> (u64, [u64; MASK_COUNT], [f64; MASK_COUNT]) {
        let product = |sums: Sums| (sums.windows, sums.values, sums.moments());
        match self.variant {
            // Many files keep the cores busy by themselves; one file is shared by them.
            Variant::Exact if self.files.len() > 1 => product(hlac::extract(volume).total()),
            Variant::Exact => product(hlac::extract_parallel(volume).total()),
            Variant::Sampled => product(hlac::extract_sampled(volume, self.windows, self.seed)),
            Variant::HitSum => {
                let sums = hlac::extract_hit_sum(volume);
                (sums.windows, sums.values, sums.moments())
            }
        }
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
        table.write(context.out())?;
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

fn print_values(context: &mut Context, file: &Extracted) -> Result<(), Failure> {
    writeln!(context.out(), "\n{}", file.path)?;
    let mut table = Table::new([("mask", Align::Left), ("sum", Align::Right), ("moment", Align::Left)]);
    for ((mask, sum), moment) in MASKS.iter().zip(&file.sums).zip(&file.moments) {
        table.row([mask.letters(), sum.to_string(), format!("{moment:.9}")]);
    }
    Ok(table.write(context.out())?)
}
