//! `hlacdb query`.

use std::collections::BTreeSet;
use std::io::Write;
use std::path::PathBuf;

use clap::{ArgGroup, Args};
use hlacdb::hlac::View;
use hlacdb::render::{self, ContactSheetOptions};
use hlacdb::space::Descriptor;
use hlacdb::volume::{self, Volume, display_path};
use hlacdb::{Answer, Combine, Database, IndexMethod, arrays};

use crate::cli::arguments::{FilterArguments, ReadArguments, SpaceArgument, png, whole};
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::hints::Advice;
use crate::cli::table::{Align, Table, count, duration, tags};

/// Find the textures most similar to a file, a stored texture or a descriptor
///
/// Filters are applied before k. Hits are ordered by (distance, id) and do not depend on the index.
#[derive(Args)]
#[command(group = ArgGroup::new("example").required(true), after_help = "Examples:
  hlacdb query sample.nii.gz
  hlacdb query --id 12 -k 30 --exclude-self --sheet alike.png
  hlacdb query --id 12 --id 40 --exclude-self             similar to both: near the mean of their points
  hlacdb query --id 12 --id 40 --combine min              similar to either
  hlacdb query sample.npy --where family=marble --within 0.4
  hlacdb query a.npy b.npy c.npy                          three queries, in parallel
  hlacdb --json query --moments moments.npy --space paper")]
pub(crate) struct Query {
    /// Volumes, which need not be in the store; one query each
    #[arg(value_name = "FILE", group = "example")]
    files: Vec<PathBuf>,

    /// A texture of the store; several are the examples of one query
    #[arg(long = "id", value_name = "ID", group = "example", value_parser = whole::<u64>)]
    ids: Vec<u64>,

    /// Descriptors: a numpy array of the 251 moments of full@1, or (N, 251) for N queries
    #[arg(long, value_name = "F.npy", group = "example")]
    moments: Option<PathBuf>,

    /// How several --id combine: `mean` (near the mean of their points) or `min` (near any of them)
    #[arg(long, value_name = "HOW", default_value = "mean", requires = "ids")]
    combine: Combine,

    /// The number of hits; there is no upper limit [default: 10, or all with --within]
    #[arg(short, value_name = "N", value_parser = whole::<usize>)]
    k: Option<usize>,

    /// The largest distance of a hit
    #[arg(long, value_name = "DISTANCE")]
    within: Option<f64>,

    #[command(flatten)]
    filters: FilterArguments,

    /// Leave out the examples themselves
    #[arg(long)]
    exclude_self: bool,

    #[command(flatten)]
    space: SpaceArgument,

    /// Index: auto, linear, kdtree
    #[arg(long, value_name = "INDEX", default_value = "auto")]
    index: IndexMethod,

    /// Draw the query and its hits as slices (Figure 6 of the paper)
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
            let queries = descriptors.into_iter().map(|one| self.with_options(hlacdb::Query::descriptor(one)));
            let answers = database.query_all(&queries.collect::<Vec<_>>())?;
            print_all(context, &answers, |row| format!("row {row}"))?;
            return Ok(Outcome::Done);
        }
        match self.files.as_slice() {
            [] => {
                let query = hlacdb::Query::textures(&self.ids).combine(self.combine);
                let answer = database.query(&self.with_options(query))?;
                if let (Some(path), Some(&id)) = (&self.sheet, self.ids.first()) {
                    let (name, volume) = (database.texture(id)?.name, database.volume(id)?);
                    self.write_sheet(context, &database, volume.as_ref(), &name, &answer, path)?;
                }
                print_all(context, &[answer], |_| String::new())?;
            }
            [file] => {
                let volume = volume::read(file, &self.reading.options())?.0;
                let answer = database.query(&self.with_options(hlacdb::Query::volume(&volume)))?;
                if let Some(path) = &self.sheet {
                    self.write_sheet(context, &database, Some(&volume), &display_path(file), &answer, path)?;
                }
                print_all(context, &[answer], |_| display_path(file))?;
            }
            _ => return self.run_files(context, &database),
        }
        Ok(Outcome::Done)
    }

    /// One query for each file that can be read; the others are reported.
    fn run_files(&self, context: &mut Context, database: &Database) -> Result<Outcome, Failure> {
        if self.sheet.is_some() {
            return Err(Failure::Usage("--sheet draws one query: give one FILE".into()));
        }
        let (mut names, mut volumes) = (vec![], vec![]);
        for path in &self.files {
            match volume::read(path, &self.reading.options()) {
                Ok((volume, _)) => {
                    names.push(display_path(path));
                    volumes.push(volume);
                }
                Err(error) => eprintln!("hlacdb: {}", Advice::on(&error).line()),
            }
        }
        let queries: Vec<hlacdb::Query<'_>> =
            volumes.iter().map(|volume| self.with_options(hlacdb::Query::volume(volume))).collect();
        let answers = database.query_all(&queries)?;
        if context.json {
            let named = names.iter().zip(&answers).map(|(file, answer)| FileAnswer { file, answer });
            context.print_json(&serde_json::json!({ "queries": named.collect::<Vec<_>>() }))?;
        } else {
            print_all(context, &answers, |at| names.get(at).cloned().unwrap_or_default())?;
        }
        Ok(if volumes.len() == self.files.len() { Outcome::Done } else { Outcome::Partly })
    }

    /// Adds the options that apply to every kind of example.
    fn with_options<'a>(&self, query: hlacdb::Query<'a>) -> hlacdb::Query<'a> {
        let mut query = query.index(self.index);
        if let Some(k) = self.k {
            query = query.k(k);
        }
        if let Some(distance) = self.within {
            query = query.within(distance);
        }
        if let Some(space) = &self.space.name {
            query = query.space(space);
        }
        if self.exclude_self {
            query = query.exclude_self();
        }
        query.filters(self.filters.filters())
    }

    fn write_sheet(
        &self,
        context: &Context,
        database: &Database,
        query: Option<&Volume>,
        name: &str,
        answer: &Answer,
        path: &std::path::Path,
    ) -> Result<(), Failure> {
        let sheet = render::answer_sheet(database, query, name, answer, &ContactSheetOptions::new())?;
        let nothing = "neither the query nor its hits have stored voxels: there is nothing to draw";
        sheet.ok_or_else(|| Failure::message(nothing))?.write_png(path)?;
        context.note(&format!("wrote {}", display_path(path)));
        Ok(())
    }
}

/// An answer and the file that was the query.
#[derive(serde::Serialize)]
struct FileAnswer<'a> {
    file: &'a str,
    #[serde(flatten)]
    answer: &'a Answer,
}

/// Prints the answers. Where there are several, `name` gives the name of the n-th query.
fn print_all(context: &mut Context, answers: &[Answer], name: impl Fn(usize) -> String) -> Result<(), Failure> {
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
    // A warning that applies to several queries is printed once.
    let warnings: BTreeSet<&String> = answers.iter().flat_map(|answer| &answer.warnings).collect();
    warnings.into_iter().for_each(|warning| context.note(&format!("warning: {warning}")));
    Ok(())
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
        count(answer.hits.len(), "hit"),
        answer.space,
        answer.epoch,
        answer.index,
        duration(answer.elapsed)
    ));
    Ok(())
}
