//! `hlacdb demo`: the paper's experiment from beginning to end.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use hlacdb::render::{self, ContactSheetOptions};
use hlacdb::synth::{Recipe, Specimen};
use hlacdb::volume::{Volume, VolumeSource, display_path};
use hlacdb::{Database, Meta, OpenOptions, Progress, Query, eval};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{Align, Table};

/// Reproduce the paper's experiment: 600 textures, 600 queries, times and precision
///
/// Generates the 600 solid textures of 64^3 voxels (300 of Perlin noise, 300 of fractal noise), describes them, finds the 30
/// most similar textures of each, and prints times and precision beside those of the paper. A second run reuses the folder.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb demo
  hlacdb demo --dir demo && hlacdb -s demo/textures.hlacdb stats")]
pub(crate) struct Demo {
    /// The folder for the store and the pictures
    #[arg(long, value_name = "DIR", default_value = "hlacdb-demo")]
    dir: PathBuf,
}

/// The number of hits, as in the paper.
const K: usize = 30;

/// The times of the steps, in seconds.
#[derive(Clone, Copy, Default, Serialize, Deserialize)]
struct Times {
    synthesis_a: f64,
    synthesis_b: f64,
    features: f64,
    ingest: f64,
}

#[derive(Serialize)]
struct Document {
    textures: u64,
    times_s: Times,
    query_us: f64,
    precision: Vec<eval::SpaceMeasures>,
    sheets: Vec<String>,
}

impl Demo {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        std::fs::create_dir_all(&self.dir).map_err(|source| hlacdb::Error::Io {
            doing: "making the folder",
            path: Some(self.dir.clone()),
            source,
        })?;
        let database = OpenOptions::new().open(self.dir.join("textures.hlacdb"))?;
        let recipe = Recipe::builtin("paper600")?;
        let progress = TerminalProgress::new(context)?;
        let times = if database.len()? >= recipe.count() {
            context.note(&format!(
                "using the {} textures of an earlier run in {}",
                database.len()?,
                display_path(&self.dir)
            ));
            self.earlier_times()
        } else {
            let Some(times) = build(&database, &recipe, &progress)? else { return Ok(Outcome::Partly) };
            let (path, text) = (self.times_path(), serde_json::to_string_pretty(&times)?);
            std::fs::write(&path, text).map_err(|source| hlacdb::Error::Io {
                doing: "writing",
                path: Some(path.clone()),
                source,
            })?;
            Some(times)
        };
        let query_us = query_all(&database, &progress)?;
        let spaces = ["paper".to_owned(), "default".to_owned()];
        let precision = eval::evaluate(&database, "class", K, &spaces, &progress)?.spaces;
        drop(progress);
        let sheets = self.draw(&database)?;
        let times_s = times.unwrap_or_default();
        let document = Document { textures: database.len()?, times_s, query_us, precision, sheets };
        if context.json {
            context.print_json(&document)?;
        } else {
            self.print(context, &document, times.is_some())?;
        }
        Ok(Outcome::Done)
    }

    fn times_path(&self) -> PathBuf {
        self.dir.join("times.json")
    }

    /// The times of the run that created the store; `None` where their file is missing or invalid.
    fn earlier_times(&self) -> Option<Times> {
        serde_json::from_slice(&std::fs::read(self.times_path()).ok()?).ok()
    }

    /// Draws three queries and their hits, like Figures 6a to 6c of the paper.
    fn draw(&self, database: &Database) -> Result<Vec<String>, Failure> {
        let labels = database.labels("class")?;
        let of_class =
            |class: &str| labels.iter().filter(|(_, label)| *label == class).map(|(&id, _)| id.get()).collect();
        let (a, b): (Vec<u64>, Vec<u64>) = (of_class("a"), of_class("b"));
        let chosen = [a.first(), b.first(), b.get(b.len() / 2)];
        let mut sheets = Vec::new();
        for (name, id) in ["alike-a.png", "alike-b.png", "alike-c.png"].iter().zip(chosen) {
            let Some(&id) = id else { continue };
            let path = self.dir.join(name);
            let answer = database.query(&Query::texture(id).k(5).exclude_self())?;
            let (name, volume) = (database.texture(id)?.name, database.volume(id)?);
            let options = ContactSheetOptions::new();
            if let Some(sheet) = render::answer_sheet(database, volume.as_ref(), &name, &answer, &options)? {
                sheet.write_png(&path)?;
                sheets.push(display_path(&path));
            }
        }
        Ok(sheets)
    }

    fn print(&self, context: &mut Context, document: &Document, timed: bool) -> Result<(), Failure> {
        let Times { synthesis_a, synthesis_b, features, ingest } = document.times_s;
        let out = context.out();
        writeln!(out, "The paper's experiment: {} solid textures of 64 x 64 x 64\n", document.textures)?;
        let mut table = Table::new([
            ("step", Align::Left),
            ("the paper", Align::Right),
            ("here", Align::Right),
            ("times faster", Align::Right),
        ]);
        let mut row = |step: &str, paper: f64, here: f64, unit: &str| {
            let (here_shown, ratio) = match (here > 0.0, unit) {
                (false, _) => ("-".to_owned(), "-".to_owned()),
                (true, "us") => (format!("{:.0} us", here * 1e6), format!("{:.0}", paper / here)),
                (true, _) => (format!("{here:.2} s"), format!("{:.0}", paper / here)),
            };
            table.row([step.to_owned(), format!("{paper} s"), here_shown, ratio]);
        };
        row("synthesis of 300 textures, type (a)", 900.0, synthesis_a, "s");
        row("synthesis of 300 textures, type (b)", 1500.0, synthesis_b, "s");
        row("251 HLAC features of 600 textures, exact", 1600.0, features, "s");
        row("one query, top 30 of 600", 1.7, document.query_us / 1e6, "us");
        table.write(out)?;
        if timed {
            writeln!(out, "\nInto the store, in all views, with voxels, durably: {ingest:.1} s")?;
        }
        writeln!(out, "\nShare of the top {K} that are of the query's class (a) or (b); by chance: 0.50")?;
        let mut table = Table::new([
            ("space", Align::Left),
            ("all", Align::Right),
            ("class (a)", Align::Right),
            ("class (b)", Align::Right),
        ]);
        for space in &document.precision {
            let class = |name: &str| space.per_class.get(name).map_or(0.0, |measures| measures.p_at_k);
            let cells = [space.all.p_at_k, class("a"), class("b")].map(|value| format!("{value:.3}"));
            table.row(std::iter::once(space.space.clone()).chain(cells));
        }
        table.write(out)?;
        writeln!(out, "\nA query and its hits, as slices:")?;
        for sheet in &document.sheets {
            writeln!(out, "  {sheet}")?;
        }
        let store = display_path(&self.dir.join("textures.hlacdb"));
        writeln!(
            out,
            "\nWhat to try next:\n  hlacdb -s {store} query --id 1 -k 5 --exclude-self\n  hlacdb -s {store} query YOUR-VOLUME\n  \
             hlacdb -s {store} stats\n  hlacdb ingest YOUR-FOLDER     a store of your own in ./textures.hlacdb"
        )?;
        Ok(())
    }
}

/// Generates, describes and stores the textures of the recipe and times each step; `None` if cancelled.
fn build(database: &Database, recipe: &Recipe, progress: &TerminalProgress) -> Result<Option<Times>, Failure> {
    let specimens = recipe.specimens();
    let mut times = Times::default();
    let mut textures: Vec<(Meta, Volume)> = Vec::with_capacity(specimens.len());
    for (class, time) in [("a", &mut times.synthesis_a), ("b", &mut times.synthesis_b)] {
        let of_class: Vec<&Specimen> = specimens
            .iter()
            .filter(|specimen| specimen.tags.get("class").is_some_and(|label| label == class))
            .collect();
        progress.begin(&format!("synthesis {class}"), Some(of_class.len() as u64));
        let start = Instant::now();
        let volumes: Vec<(Meta, Volume)> = of_class
            .par_iter()
            .map(|specimen| {
                let meta =
                    Meta::named(specimen.name.clone()).tags(specimen.tags.clone()).source(VolumeSource::SYNTHETIC);
                let volume = specimen.volume();
                progress.advance(1);
                (meta, volume)
            })
            .collect();
        *time = start.elapsed().as_secs_f64();
        textures.extend(volumes);
    }
    progress.begin("features", Some(textures.len() as u64));
    let start = Instant::now();
    let windows: u64 = textures.par_iter().map(|(_, volume)| hlacdb::octant_sums(volume).total().windows).sum();
    times.features = start.elapsed().as_secs_f64();
    tracing::debug!(windows, "computed all sums");
    if progress.cancelled() {
        return Ok(None);
    }
    let start = Instant::now();
    progress.begin("storing", Some(textures.len() as u64));
    while !textures.is_empty() {
        let batch: Vec<_> = textures.drain(..textures.len().min(64)).collect();
        let added = batch.len() as u64;
        let prepared: Result<Vec<_>, _> =
            batch.into_par_iter().map(|(meta, volume)| database.prepare(volume, meta, hlacdb::Volumes::Keep)).collect();
        database.commit(prepared?)?;
        progress.advance(added);
        if progress.cancelled() {
            return Ok(None);
        }
    }
    database.reindex(&hlacdb::ReindexOptions::default(), progress)?;
    times.ingest = start.elapsed().as_secs_f64();
    Ok(Some(times))
}

/// Queries with every texture; returns the mean time of a query in microseconds.
fn query_all(database: &Database, progress: &TerminalProgress) -> Result<f64, Failure> {
    let textures = database.textures(&[])?;
    progress.begin("queries", Some(textures.len() as u64));
    // The first query loads the index.
    if let Some(texture) = textures.first() {
        database.query(&Query::texture(texture.id).k(K))?;
    }
    let start = Instant::now();
    for texture in &textures {
        database.query(&Query::texture(texture.id).k(K))?;
        progress.advance(1);
    }
    Ok(start.elapsed().as_secs_f64() * 1e6 / textures.len().max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_an_earlier_run_are_read_from_their_file() {
        let dir = tempfile::tempdir().unwrap();
        let demo = Demo { dir: dir.path().to_path_buf() };
        assert!(demo.earlier_times().is_none());
        std::fs::write(demo.times_path(), "{\"synthesis_a\":1.5,\"synthesis_b\":2,\"features\":3,\"ingest\":4}")
            .unwrap();
        assert!(demo.earlier_times().is_some_and(|times| times.synthesis_a == 1.5));
        std::fs::write(demo.times_path(), "nonsense").unwrap();
        assert!(demo.earlier_times().is_none());
    }
}
