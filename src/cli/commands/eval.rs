//! `hlacdb eval`.

use std::cmp::Reverse;
use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use hlacdb::eval::{self, Evaluation, Measures};
use hlacdb::render;
use hlacdb::volume::display_path;

use crate::cli::arguments::{svg, whole};
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{Align, Table};

/// Measure retrieval by a tag: P@1, P@k, mAP, per class
///
/// Every texture with the tag is a query against all other textures with the tag; a hit is right if it has the same value.
/// P@1 and P@k are the fractions of right hits among the first 1 and k; mAP is the mean average precision over the whole
/// ranking.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb synth families && hlacdb eval --label family
  hlacdb eval --label class -k 30 --space paper,default
  hlacdb eval --label rock --plot rock.svg     precision curves, and mAP of each class")]
pub(crate) struct Eval {
    /// The tag whose values are the classes
    #[arg(long, value_name = "KEY", value_parser = NonEmptyStringValueParser::new())]
    label: String,

    /// The k of P@k
    #[arg(short, value_name = "N", default_value_t = 10, value_parser = whole::<usize>)]
    k: usize,

    /// Spaces, separated by commas [default: all spaces of the store]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    space: Vec<String>,

    /// Show every class, and the classes that it is confused with
    #[arg(long)]
    per_class: bool,

    /// Draw precision by recall and by rank, and mAP by class
    #[arg(long, value_name = "OUT.svg", value_parser = svg())]
    plot: Option<PathBuf>,
}

impl Eval {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let spaces = if self.space.is_empty() { database.space_names()? } else { distinct(self.space) };
        let progress = TerminalProgress::new(context)?;
        let evaluation = eval::evaluate(&database, &self.label, self.k, &spaces, &progress)?;
        drop(progress);
        if let Some(path) = &self.plot {
            render::write_svg(path, &render::evaluation_plot(&evaluation)?)?;
            context.note(&format!("wrote {}", display_path(path)));
        }
        if context.json {
            context.print_json(&evaluation)?;
            return Ok(Outcome::Done);
        }
        print_summary(context, &evaluation)?;
        if self.per_class {
            print_classes(context, &evaluation)?;
        }
        Ok(Outcome::Done)
    }
}

/// The names in order, without repetitions.
fn distinct(names: Vec<String>) -> Vec<String> {
    let mut seen = std::collections::BTreeSet::new();
    names.into_iter().filter(|name| seen.insert(name.clone())).collect()
}

/// P@1, P@k and mAP as cells of a table.
fn cells(measures: &Measures) -> [String; 3] {
    [measures.p_at_1, measures.p_at_k, measures.map].map(|value| format!("{value:.3}"))
}

fn print_summary(context: &mut Context, evaluation: &Evaluation) -> Result<(), Failure> {
    let at_k = format!("P@{}", evaluation.k);
    let mut table = Table::new([
        ("space", Align::Left),
        ("queries", Align::Right),
        ("P@1", Align::Right),
        (at_k.as_str(), Align::Right),
        ("mAP", Align::Right),
    ]);
    for space in &evaluation.spaces {
        let [first, top, map] = cells(&space.all);
        table.row([space.space.clone(), space.all.queries.to_string(), first, top, map]);
    }
    Ok(table.write(context.out())?)
}

fn print_classes(context: &mut Context, evaluation: &Evaluation) -> Result<(), Failure> {
    let at_k = format!("P@{}", evaluation.k);
    for space in &evaluation.spaces {
        writeln!(context.out(), "\n{}", space.space)?;
        let mut table = Table::new([
            (evaluation.label.as_str(), Align::Left),
            ("queries", Align::Right),
            ("P@1", Align::Right),
            (at_k.as_str(), Align::Right),
            ("mAP", Align::Right),
            ("confused with", Align::Left),
        ]);
        for (class, measures) in &space.per_class {
            let [first, top, map] = cells(measures);
            let mut wrong: Vec<(&String, &usize)> =
                space.confusion.get(class).into_iter().flatten().filter(|(other, _)| *other != class).collect();
            wrong.sort_by_key(|(_, times)| Reverse(**times));
            let wrong: Vec<String> = wrong.iter().take(4).map(|(other, times)| format!("{other} {times}")).collect();
            table.row([class.clone(), measures.queries.to_string(), first, top, map, wrong.join(", ")]);
        }
        table.write(context.out())?;
    }
    Ok(())
}
