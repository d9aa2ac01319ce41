//! `hlacdb eval`.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use clap::builder::NonEmptyStringValueParser;
use hlacdb::eval::{self, Evaluation};
use hlacdb::render;
use hlacdb::volume::display_path;

use super::bars::Bars;
use super::table::{Align, Table};
use super::values::{svg, whole};
use super::{Context, Failure, Outcome};

/// Retrieval measures by a tag: P@1, P@k, mAP, per class
///
/// Every texture that carries the tag is a query against all others that carry it. P@1 and P@k: the share of the first
/// 1 and k hits with the query's value; mAP: mean average precision over the whole ranking.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb synth families && hlacdb eval --label family
  hlacdb eval --label class -k 30 --space paper,default
  hlacdb eval --label rock --plot rock.svg     curves of precision, and how well each value is found")]
pub(crate) struct Eval {
    /// The tag whose values say what is alike
    #[arg(long, value_name = "KEY", value_parser = NonEmptyStringValueParser::new())]
    label: String,

    /// The k of P@k
    #[arg(short, value_name = "N", default_value_t = 10, value_parser = whole::<usize>)]
    k: usize,

    /// Which spaces, separated by commas [default: all the store has]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    space: Vec<String>,

    /// Show every class and which classes are taken for which
    #[arg(long)]
    per_class: bool,

    /// Draw precision by recall and by rank, and mAP by class, as SVG
    #[arg(long, value_name = "OUT.svg", value_parser = svg())]
    plot: Option<PathBuf>,
}

impl Eval {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let spaces = if self.space.is_empty() { database.space_names()? } else { distinct(self.space) };
        let bars = Bars::until(context, context.interruptible()?);
        let evaluation = eval::evaluate(&database, &self.label, self.k, &spaces, &bars)?;
        drop(bars);
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

/// The names in order, each once.
fn distinct(names: Vec<String>) -> Vec<String> {
    let mut seen = std::collections::BTreeSet::new();
    names.into_iter().filter(|name| seen.insert(name.clone())).collect()
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
        let [first, top, map] = [space.all.p_at_1, space.all.p_at_k, space.all.map].map(|value| format!("{value:.3}"));
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
            ("first taken for", Align::Left),
        ]);
        for (class, measures) in &space.per_class {
            let [first, top, map] = [measures.p_at_1, measures.p_at_k, measures.map].map(|value| format!("{value:.3}"));
            let mut wrong: Vec<(&String, &usize)> =
                space.confusion.get(class).into_iter().flatten().filter(|(other, _)| *other != class).collect();
            wrong.sort_by_key(|(_, times)| std::cmp::Reverse(**times));
            let wrong: Vec<String> = wrong.iter().take(4).map(|(other, times)| format!("{other} {times}")).collect();
            table.row([class.clone(), measures.queries.to_string(), first, top, map, wrong.join(", ")]);
        }
        table.write(context.out())?;
    }
    Ok(())
}
