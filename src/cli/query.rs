//! `hlacdb query`.

use std::io::Write;
use std::path::PathBuf;

use clap::{ArgGroup, Args};
use hlacdb::index::Method;
use hlacdb::volume::{self, Volume, sheet};
use hlacdb::{Answer, Database, Query as Question, arrays};

use super::read_arguments::ReadArguments;
use super::table::{Align, Table, duration, tags};
use super::tag::KeyValue;
use super::values::{png, whole};
use super::{Context, Failure, Outcome};

/// The k textures most alike to a file, a stored texture or a descriptor
#[derive(Args)]
#[command(group = ArgGroup::new("example").required(true), after_help = "Examples:
  hlacdb query sample.nii.gz
  hlacdb query --id 12 -k 30 --exclude-self --sheet alike.png
  hlacdb query sample.npy --where family=marble --within 0.4
  hlacdb --json query --moments moments.npy --space paper

Filters are applied before k. Hits are ordered by (distance, id), and are the same for every index.")]
pub(crate) struct Query {
    /// A volume that need not be in the store
    #[arg(value_name = "FILE", group = "example")]
    file: Option<PathBuf>,

    /// A texture of the store
    #[arg(long, group = "example", value_parser = whole::<u64>)]
    id: Option<u64>,

    /// Descriptors: a numpy array of 251 moments of full@1, or (N, 251) for N queries
    #[arg(long, value_name = "F.npy", group = "example")]
    moments: Option<PathBuf>,

    /// How many hits; no ceiling
    #[arg(short, value_name = "N", default_value_t = 10, value_parser = whole::<usize>)]
    k: usize,

    /// Only hits at this distance or nearer
    #[arg(long, value_name = "DISTANCE")]
    within: Option<f64>,

    /// Only textures with this tag (repeatable: all must hold)
    #[arg(long = "where", value_name = "KEY=VALUE")]
    filters: Vec<KeyValue>,

    /// Leave out the example itself
    #[arg(long)]
    exclude_self: bool,

    /// In which space: default, oriented, invariant, paper, zscore
    #[arg(long, value_name = "NAME")]
    space: Option<String>,

    /// By which index: auto, linear, kdtree
    #[arg(long, value_name = "INDEX", default_value = "auto")]
    index: Method,

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
            return self.by_moments(context, &database, path);
        }
        let (answer, example, title) = match (&self.file, self.id) {
            (Some(path), _) => {
                let (volume, _) = volume::read(path, &self.reading.options())?;
                let answer = database.query(&self.refine(Question::volume(&volume)))?;
                (answer, Some(volume), volume::display_path(path))
            }
            (None, Some(id)) => {
                let answer = database.query(&self.refine(Question::texture(id)))?;
                (answer, None, database.texture(id)?.name)
            }
            (None, None) => return Err(Failure::Usage("name a FILE, --id or --moments".into())),
        };
        if let Some(path) = &self.sheet {
            let example = match (example, self.id) {
                (Some(volume), _) => Some(volume),
                (None, Some(id)) => database.volume(id)?,
                (None, None) => None,
            };
            write_sheet(&database, example.as_ref(), &title, &answer, path)?;
            context.note(&format!("wrote {}", volume::display_path(path)));
        }
        if context.json {
            context.print_json(&answer)?;
        } else {
            print(context, &answer)?;
        }
        Ok(Outcome::Done)
    }

    /// The options that every kind of example shares.
    fn refine<'a>(&self, question: Question<'a>) -> Question<'a> {
        let mut question = question.k(self.k).index(self.index);
        if let Some(distance) = self.within {
            question = question.within(distance);
        }
        if let Some(space) = &self.space {
            question = question.space(space);
        }
        if self.exclude_self {
            question = question.exclude_self();
        }
        for filter in &self.filters {
            let (key, value) = filter.clone().into_pair();
            question = question.filter(key, value);
        }
        question
    }

    fn by_moments(
        &self,
        context: &mut Context,
        database: &Database,
        path: &std::path::Path,
    ) -> Result<Outcome, Failure> {
        let rows = arrays::read_moments(path)?;
        let questions: Vec<Question<'_>> =
            rows.into_iter().map(|row| self.refine(Question::moments(vec![(hlacdb::hlac::View::Full, row)]))).collect();
        let answers = database.query_all(&questions)?;
        match (answers.as_slice(), context.json) {
            ([answer], true) => context.print_json(answer)?,
            (answers, true) => context.print_json(&serde_json::json!({ "queries": answers }))?,
            (answers, false) => {
                for (row, answer) in answers.iter().enumerate() {
                    if answers.len() > 1 {
                        writeln!(context.out(), "row {row}")?;
                    }
                    print(context, answer)?;
                }
            }
        }
        Ok(Outcome::Done)
    }
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

/// The paper's Figure 6: the example first, then the hits whose voxels are stored.
pub(super) fn write_sheet(
    database: &Database,
    example: Option<&Volume>,
    title: &str,
    answer: &Answer,
    path: &std::path::Path,
) -> Result<(), Failure> {
    let mut volumes = Vec::with_capacity(answer.hits.len());
    for hit in &answer.hits {
        if let Some(volume) = database.volume(hit.id)? {
            volumes.push((hit, volume));
        }
    }
    let mut panels = Vec::with_capacity(volumes.len() + 1);
    if let Some(volume) = example {
        panels.push(sheet::Panel { volume, caption: vec![title.to_owned(), "the query".into()] });
    }
    for (hit, volume) in &volumes {
        let caption =
            vec![format!("{}. {}", hit.rank, hit.name), format!("id {}  distance {:.4}", hit.id, hit.distance)];
        panels.push(sheet::Panel { volume, caption });
    }
    if panels.is_empty() {
        return Err(Failure::sentence("no voxels are stored of the example or its hits: there is nothing to draw"));
    }
    let layout = sheet::Layout {
        title: Some(format!("Nearest to {title}, space {}", answer.space)),
        query_first: example.is_some(),
        ..sheet::Layout::default()
    };
    Ok(sheet::write_png(&sheet::draw(&panels, &layout), path)?)
}
