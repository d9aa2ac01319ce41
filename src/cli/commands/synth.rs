//! `hlacdb synth`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use hlacdb::ingest::{self, SpecimenFormat};
use hlacdb::synth::{Nuisance, Recipe, builtin_names};
use hlacdb::volume::display_path;

use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{count, duration};

/// Generate a synthetic data set, into the store or as files
///
/// A recipe describes the data set: a TOML file (see datasets/ in the source code), or one of the built-in recipes paper600,
/// families, wide and prior. The same recipe gives the same bytes on every machine.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb synth paper600                     the paper's 600 textures, into the store
  hlacdb synth families --out textures/     as .npy files, with their tags in textures.csv
  hlacdb synth my-recipe.toml --out raw/ --format raw")]
pub(crate) struct Synth {
    /// A recipe file, or the name of a built-in recipe
    recipe: PathBuf,

    /// Write files to this folder instead of the store
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// The format of the files
    #[arg(long, value_enum, default_value_t = FileFormat::Npy, requires = "out")]
    format: FileFormat,

    /// Changes to apply to every texture: all, none, or brightness, contrast, gamma, noise, rotation, separated by commas
    #[arg(long, value_name = "WORDS")]
    nuisance: Option<Nuisance>,
}

#[derive(Clone, Copy, ValueEnum)]
enum FileFormat {
    /// numpy, u8, shape (Z, Y, X)
    Npy,
    /// raw bytes, X fastest
    Raw,
}

impl Synth {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let mut recipe = load(&self.recipe)?;
        if let Some(nuisance) = self.nuisance {
            recipe = recipe.with_nuisance(nuisance);
        }
        let progress = TerminalProgress::new(context)?;
        let start = Instant::now();
        let report = match &self.out {
            Some(folder) => {
                let format = match self.format {
                    FileFormat::Npy => SpecimenFormat::Npy,
                    FileFormat::Raw => SpecimenFormat::Raw,
                };
                ingest::write_recipe_files(&recipe, folder, format, &progress)?
            }
            None => {
                let database = context.open_or_create()?;
                ingest::ingest_recipe(&database, &recipe, &progress, &mut |_| ())?
            }
        };
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        }
        context.note(&format!(
            "{} generated{}, in {}{}",
            count(report.added as usize, "texture"),
            match &self.out {
                Some(folder) => format!(" and written to {}, with textures.csv", display_path(folder)),
                None => format!(", {} already stored, into {}", report.duplicates, display_path(&context.store)),
            },
            duration(start.elapsed()),
            if report.cancelled { " (stopped early)" } else { "" }
        ));
        Ok(if report.cancelled { Outcome::Partly } else { Outcome::Done })
    }
}

/// The recipe in a file, or the built-in recipe of this name.
fn load(path: &Path) -> Result<Recipe, Failure> {
    if let Some(name) = path.to_str().filter(|name| builtin_names().any(|known| known == *name))
        && !path.exists()
    {
        return Ok(Recipe::builtin(name)?);
    }
    let known: Vec<&str> = builtin_names().collect();
    let text = std::fs::read_to_string(path).map_err(|error| {
        let (shown, known) = (display_path(path), known.join(", "));
        Failure::message(format!("{shown}: the recipe cannot be read (built-in recipes: {known}): {error}"))
    })?;
    Recipe::parse(&text).map_err(|error| Failure::message(format!("{}: {error}", display_path(path))))
}
