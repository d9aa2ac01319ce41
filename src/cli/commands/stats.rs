//! `hlacdb stats`.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use hlacdb::hlac::MASKS;
use hlacdb::render;
use hlacdb::volume::display_path;
use hlacdb::{DEFAULT_SPACE, StatisticsReport, arrays};

use crate::cli::arguments::svg;
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::table::{Align, Table, bytes, count};

/// Show sizes, settings, a space and the normalisation statistics of the store
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb stats
  hlacdb stats --moments                     mean, standard deviation, lowest and highest of all 251 moments
  hlacdb --json stats | jq .statistics.mean
  hlacdb stats --space paper                 formula and axes of another space
  hlacdb stats --plot stats.svg              the 251 moments and the axes, as a plot
  hlacdb stats --covariance cov.npy          the covariance of the moments, (251, 251) f64")]
pub(crate) struct Stats {
    /// Show the statistics of all moments
    #[arg(long)]
    moments: bool,

    /// Write the covariance matrix of the 251 moments as a numpy array
    #[arg(long, value_name = "OUT.npy")]
    covariance: Option<PathBuf>,

    /// The space to show: default, oriented, invariant, paper, zscore, or one added with `hlacdb space add`
    #[arg(long, value_name = "NAME", default_value = DEFAULT_SPACE)]
    space: String,

    /// Draw mean and standard deviation of the 251 moments, and the variance along the axes of the space
    #[arg(long, value_name = "OUT.svg", value_parser = svg())]
    plot: Option<PathBuf>,
}

impl Stats {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let report = database.statistics_in(&self.space)?;
        if let Some(path) = &self.covariance {
            arrays::write_npy(path, &[MASKS.len(); 2], &database.covariance()?)?;
            context.note(&format!("wrote {}", display_path(path)));
        }
        if let Some(path) = &self.plot {
            render::write_svg(path, &render::statistics_plot(&report)?)?;
            context.note(&format!("wrote {}", display_path(path)));
        }
        if context.json {
            context.print_json(&report)?;
            return Ok(Outcome::Done);
        }
        let out = context.out();
        writeln!(
            out,
            "{}, {}, revision {}",
            count(report.textures as usize, "texture"),
            count(report.descriptors as usize, "descriptor"),
            report.revision
        )?;
        for lost in &report.quarantined {
            writeln!(out, "damaged: texture {}: {}", lost.id, lost.what)?;
        }
        print_settings(out, &report)?;
        print_sizes(out, &report)?;
        print_space(out, &report)?;
        print_statistics(out, &report, self.moments)?;
        Ok(Outcome::Done)
    }
}

fn print_settings(out: &mut impl Write, report: &StatisticsReport) -> Result<(), Failure> {
    let settings = &report.settings;
    writeln!(out, "views    {}", settings.views.join(" "))?;
    writeln!(out, "spaces   {}", settings.spaces.join(" "))?;
    writeln!(out, "volumes  {}", settings.volumes)?;
    writeln!(out, "format   {}", settings.format)?;
    writeln!(out, "kernel   {}", settings.kernel)?;
    Ok(())
}

fn print_sizes(out: &mut impl Write, report: &StatisticsReport) -> Result<(), Failure> {
    writeln!(out)?;
    let mut table = Table::new([("table", Align::Left), ("bytes", Align::Right)]);
    let of_file = report.bytes.get(FILE).copied().unwrap_or(0);
    let tables = report.bytes.iter().filter(|(name, _)| *name != FILE);
    tables.clone().for_each(|(name, &size)| table.row([name.clone(), bytes(size)]));
    let free = of_file.saturating_sub(tables.map(|(_, size)| size).sum());
    table.row(["free, and bookkeeping".to_owned(), bytes(free)]);
    table.row(["the file".to_owned(), bytes(of_file)]);
    table.write(out)?;
    if free > of_file / 2 && free > WORTH_COMPACTING {
        writeln!(out, "`hlacdb compact` frees most of the unused bytes")?;
    }
    Ok(())
}

/// The entry of a report's sizes that counts the whole file.
const FILE: &str = "file";

/// Unused bytes that are worth a hint.
const WORTH_COMPACTING: u64 = 4 << 20;

fn print_space(out: &mut impl Write, report: &StatisticsReport) -> Result<(), Failure> {
    let space = &report.space;
    writeln!(
        out,
        "\nspace {}, fit {}, on {}, {} coordinates",
        space.name,
        space.epoch,
        count(space.fitted_on as usize, "texture"),
        space.dims
    )?;
    writeln!(out, "{}", space.formula)?;
    match &space.drift {
        Some(drift) => writeln!(
            out,
            "drift since the fit: the mean moved by {:.3} of the spread; the spread is {:.3} times as large",
            drift.shift, drift.spread
        )?,
        None => writeln!(out, "drift since the fit: none yet")?,
    }
    if space.drift.is_some_and(|drift| drift.is_far()) {
        writeln!(out, "this is much: `hlacdb reindex` fits the space on all textures")?;
    }
    if space.axes.is_empty() {
        return Ok(());
    }
    let mut table = Table::new([
        ("axis", Align::Right),
        ("variance", Align::Right),
        ("views", Align::Left),
        ("goes with", Align::Left),
    ]);
    for (number, axis) in (1..).zip(&space.axes) {
        let mut views: Vec<(&String, &f64)> = axis.views.iter().collect();
        views.sort_by(|a, b| b.1.total_cmp(a.1));
        let views: Vec<String> =
            views.iter().take(2).map(|(view, share)| format!("{view} {:.0}%", *share * 100.0)).collect();
        let features: Vec<String> = axis.features.iter().take(1).map(|(name, r)| format!("{name} ({r:+.2})")).collect();
        let variance = format!("{:.1}%", axis.variance * 100.0);
        table.row([number.to_string(), variance, views.join(", "), features.join(", ")]);
    }
    Ok(table.write(out)?)
}

fn print_statistics(out: &mut impl Write, report: &StatisticsReport, all: bool) -> Result<(), Failure> {
    let statistics = &report.statistics;
    writeln!(
        out,
        "\nmoments of full@1 over {}; their strongest axis holds {:.1}% of the z-scored variance",
        count(statistics.count as usize, "texture"),
        statistics.leading_share * 100.0
    )?;
    let mut table = Table::new([
        ("mask", Align::Left),
        ("mean", Align::Right),
        ("std", Align::Right),
        ("min", Align::Right),
        ("max", Align::Right),
    ]);
    // One mask of each order represents the others.
    let shown: Vec<usize> = if all { (0..MASKS.len()).collect() } else { vec![0, 1, 14] };
    for at in shown {
        let value = |values: &[f64]| values.get(at).map_or_else(|| "-".to_owned(), |value| format!("{value:.6}"));
        let letters = MASKS.get(at).map(|mask| mask.letters()).unwrap_or_default();
        let columns = [&statistics.mean, &statistics.std, &statistics.min, &statistics.max].map(|column| value(column));
        table.row(std::iter::once(letters).chain(columns));
    }
    Ok(table.write(out)?)
}
