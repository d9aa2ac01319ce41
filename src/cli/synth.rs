//! `hlacdb synth`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use hlacdb::ingest;
use hlacdb::ingest::recipes::{self, Format};
use hlacdb::synth::{Nuisance, Recipe, builtin_names};
use hlacdb::volume::display_path;

use super::bars::Bars;
use super::table::{count, duration};
use super::{Context, Failure, Outcome};

/// Synthesise a recipe's textures, into the store or as files
///
/// A recipe is a TOML file (see datasets/ in the sources), or the name of a built-in one. The same recipe gives the same
/// bytes on every machine.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb synth paper600                     the paper's 600 textures, into the store
  hlacdb synth families --out textures/     as .npy files, with a textures.csv of their tags
  hlacdb synth my-recipe.toml --out raw/ --format raw")]
pub(crate) struct Synth {
    /// A recipe's file, or the name of a built-in one: paper600, families, ...
    recipe: PathBuf,

    /// Write files to this folder, and leave the store alone
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// The kind of files
    #[arg(long, value_enum, default_value_t = Kind::Npy, requires = "out")]
    format: Kind,

    /// What varies besides the recipe: all, none, or brightness, contrast, gamma, noise, rotation separated by commas
    #[arg(long, value_name = "WORDS")]
    nuisance: Option<Nuisance>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Kind {
    /// numpy, u8, (Z, Y, X)
    Npy,
    /// bare bytes, X fastest
    Raw,
}

impl Synth {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let mut recipe = load(&self.recipe)?;
        if let Some(nuisance) = self.nuisance {
            recipe = recipe.with_nuisance(nuisance);
        }
        let bars = Bars::until(context, context.interruptible()?);
        let began = Instant::now();
        let report = match &self.out {
            Some(folder) => {
                let format = match self.format {
                    Kind::Npy => Format::Npy,
                    Kind::Raw => Format::Raw,
                };
                recipes::write_files(&recipe, folder, format, &bars)?
            }
            None => {
                let database = context.open_or_create()?;
                ingest::synthesise(&database, &recipe, &bars, &mut |_| ())?
            }
        };
        drop(bars);
        if context.json {
            context.print_json(&report)?;
        }
        context.note(&format!(
            "{} synthesised{}, in {}{}",
            count(report.added as usize, "texture"),
            match &self.out {
                Some(folder) => format!(" and written to {}, with textures.csv", display_path(folder)),
                None => format!(", {} already there, into {}", report.duplicates, display_path(&context.store)),
            },
            duration(began.elapsed()),
            if report.cancelled { " (stopped early)" } else { "" }
        ));
        Ok(if report.cancelled { Outcome::Partly } else { Outcome::Done })
    }
}

/// The recipe of a file, or the built-in one of that name.
fn load(path: &Path) -> Result<Recipe, Failure> {
    if let Some(name) = path.to_str().filter(|name| builtin_names().any(|known| known == *name))
        && !path.exists()
    {
        return Ok(Recipe::builtin(name)?);
    }
    let known: Vec<&str> = builtin_names().collect();
    let text = std::fs::read_to_string(path).map_err(|error| {
        let (shown, known) = (display_path(path), known.join(", "));
        Failure::sentence(format!("reading the recipe {shown} (built in are: {known}) failed: {error}"))
    })?;
    // The sentence says where in the recipe; which file it is only this place knows.
    Recipe::parse(&text).map_err(|error| Failure::sentence(format!("{}: {error}", display_path(path))))
}
