//! `hlacdb query`.

use std::io::Write;
use std::path::PathBuf;

use clap::{ArgGroup, Args};
use hlacdb::hlac::View;
use hlacdb::index::IndexMethod;
use hlacdb::render::{self, ContactSheetOptions};
use hlacdb::space::Descriptor;
use hlacdb::volume::{self, Volume};
use hlacdb::{Answer, Combine, Database, Query as Question, arrays};

use super::read_arguments::ReadArguments;
use super::remedy::with_remedy;
use super::table::{Align, Table, duration, tags};
use super::tag::KeyValue;
use super::values::{png, whole};
use super::{Context, Failure, Outcome};

/// The k textures most alike to a file, a stored texture or a descriptor
#[derive(Args)]
#[command(group = ArgGroup::new("example").required(true), after_help = "Examples:
  hlacdb query sample.nii.gz
  hlacdb query --id 12 -k 30 --exclude-self --sheet alike.png
  hlacdb query --id 12 --id 40 --exclude-self             like both: near the mean of their points
  hlacdb query --id 12 --id 40 --combine min              like either
  hlacdb query sample.npy --where family=marble --within 0.4
  hlacdb query a.npy b.npy c.npy                          three queries, in parallel
  hlacdb --json query --moments moments.npy --space paper

Filters are applied before k. Hits are ordered by (distance, id), and are the same for every index.")]
pub(crate) struct Query {
    /// Volumes that need not be in the store, a query each
    #[arg(value_name = "FILE", group = "example")]
    files: Vec<PathBuf>,

    /// A texture of the store; several are examples of one query
    #[arg(long = "id", value_name = "ID", group = "example", value_parser = whole::<u64>)]
    ids: Vec<u64>,

    /// Descriptors: a numpy array of 251 moments of full@1, or (N, 251) for N queries
    #[arg(long, value_name = "F.npy", group = "example")]
    moments: Option<PathBuf>,

    /// What several --id mean: near the mean of their points, or near any of them
    #[arg(long, value_name = "HOW", default_value = "mean", requires = "ids")]
    combine: Combine,

    /// How many hits; no ceiling [default: 10, or all with --within]
    #[arg(short, value_name = "N", value_parser = whole::<usize>)]
    k: Option<usize>,

    /// Only hits at this distance or nearer
    #[arg(long, value_name = "DISTANCE")]
    within: Option<f64>,

    /// Only textures with this tag (repeatable: all must hold)
    #[arg(long = "where", value_name = "KEY=VALUE")]
    filters: Vec<KeyValue>,

    /// Leave out the examples themselves
    #[arg(long)]
    exclude_self: bool,

    /// In which space: default, oriented, invariant, paper, zscore
    #[arg(long, value_name = "NAME")]
    space: Option<String>,

    /// By which index: auto, linear, kdtree
    #[arg(long, value_name = "INDEX", default_value = "auto")]
    index: IndexMethod,

    /// Draw the query and its hits as slices (the paper's Figure 6)
    #[arg(long, value_name = "OUT.png", value_parser = png(), conflicts_with = "moments")]
    sheet: Option<PathBuf>,

    #[command(flatten)]
    reading: ReadArguments,
}

impl Query {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        if let Some(path) = &self.moments {
            let rows = arrays::read_moments(path)?;
            let descriptors = rows.into_iter().map(|row| Descriptor::from_moments([(View::Full, row)]));
            let descriptors = descriptors.collect::<Result<Vec<_>, _>>().map_err(hlacdb::Error::from)?;
            let queries = descriptors.into_iter().map(|one| self.refine(Question::descriptor(one)));
            let answers = database.query_all(&queries.collect::<Vec<_>>())?;
            return print_all(context, &answers, |row| format!("row {row}"));
        }
        if self.files.len() > 1 {
            return self.run_files(context, &database);
        }
        let volumes = self.files.iter().map(|path| Ok(volume::read(path, &self.reading.options())?.0));
        let volumes: Vec<Volume> = volumes.collect::<Result<_, Failure>>()?;
        let name = |at: usize| self.files.get(at).map_or_else(String::new, |path| volume::display_path(path));
        let question = match volumes.first() {
            Some(volume) => Question::volume(volume),
            None => Question::textures(&self.ids).combine(self.combine),
        };
        let answer = database.query(&self.refine(question))?;
        if let Some(path) = &self.sheet {
            let (example, title) = match (volumes.into_iter().next(), self.ids.first()) {
                (None, Some(&id)) => (database.volume(id)?, database.texture(id)?.name),
                (volume, _) => (volume, name(0)),
            };
            write_sheet(&database, example.as_ref(), &title, &answer, path)?;
            context.note(&format!("wrote {}", volume::display_path(path)));
        }
        print_all(context, &[answer], name)
    }

    /// A query for each file that can be read; the others are told.
    fn run_files(&self, context: &mut Context, database: &Database) -> Result<Outcome, Failure> {
        if self.sheet.is_some() {
            return Err(Failure::Usage("--sheet draws one query: name one FILE".into()));
        }
        let (mut names, mut volumes) = (vec![], vec![]);
        for path in &self.files {
            match volume::read(path, &self.reading.options()) {
                Ok((volume, _)) => {
                    names.push(volume::display_path(path));
                    volumes.push(volume);
                }
                Err(error) => eprintln!("hlacdb: {}", with_remedy(&error)),
            }
        }
        let questions: Vec<Question<'_>> = volumes.iter().map(|one| self.refine(Question::volume(one))).collect();
        let answers = database.query_all(&questions)?;
        if context.json {
            let named = names.iter().zip(&answers).map(|(file, answer)| Named { file, answer });
            context.print_json(&serde_json::json!({ "queries": named.collect::<Vec<_>>() }))?;
        } else {
            print_all(context, &answers, |at| names.get(at).cloned().unwrap_or_default())?;
        }
        Ok(if volumes.len() == self.files.len() { Outcome::Done } else { Outcome::Partly })
    }

    /// The options that every kind of example shares.
    fn refine<'a>(&self, question: Question<'a>) -> Question<'a> {
        let mut question = question.index(self.index);
        if let Some(k) = self.k {
            question = question.k(k);
        }
        if let Some(distance) = self.within {
            question = question.within(distance);
        }
        if let Some(space) = &self.space {
            question = question.space(space);
        }
        if self.exclude_self {
            question = question.exclude_self();
        }
        question.filters(self.filters.iter().cloned().map(KeyValue::into_filter))
    }
}

/// An answer, and the file that was asked about.
#[derive(serde::Serialize)]
struct Named<'a> {
    file: &'a str,
    #[serde(flatten)]
    answer: &'a Answer,
}

/// Prints the answers; `name` says what the n-th query was, where there are several.
fn print_all(context: &mut Context, answers: &[Answer], name: impl Fn(usize) -> String) -> Result<Outcome, Failure> {
    match (answers, context.json) {
        ([answer], true) => context.print_json(answer)?,
        (answers, true) => context.print_json(&serde_json::json!({ "queries": answers }))?,
        (answers, false) => {
            for (at, answer) in answers.iter().enumerate() {
                if answers.len() > 1 {
                    writeln!(context.out(), "{}", name(at))?;
                }
                print(context, answer)?;
            }
        }
    }
    // The same slip of the pen in every query is told once.
    let warnings: std::collections::BTreeSet<&String> = answers.iter().flat_map(|answer| &answer.warnings).collect();
    warnings.into_iter().for_each(|warning| context.note(&format!("warning: {warning}")));
    Ok(Outcome::Done)
}

fn print(context: &mut Context, answer: &Answer) -> Result<(), Failure> {
    let mut table = Table::new([
        ("rank", Align::Right),
        ("distance", Align::Right),
        ("id", Align::Right),
        ("name", Align::Left),
        ("tags", Align::Left),
    ]);
    for hit in &answer.hits {
        let distance = format!("{:.4}", hit.distance);
        table.row([hit.rank.to_string(), distance, hit.id.to_string(), hit.name.clone(), tags(&hit.tags)]);
    }
    table.write(context.out())?;
    context.note(&format!(
        "{} in space {} (fit {}), {} index, {}",
        super::table::count(answer.hits.len(), "hit"),
        answer.space,
        answer.epoch,
        answer.index,
        duration(answer.elapsed)
    ));
    Ok(())
}

/// Writes the contact sheet of an answer.
pub(super) fn write_sheet(
    database: &Database,
    query: Option<&Volume>,
    name: &str,
    answer: &Answer,
    path: &std::path::Path,
) -> Result<(), Failure> {
    match render::answer_sheet(database, query, name, answer, &ContactSheetOptions::new())? {
        Some(sheet) => Ok(sheet.write_png(path)?),
        None => Err(Failure::sentence("neither the query nor its hits have stored voxels: there is nothing to draw")),
    }
}
