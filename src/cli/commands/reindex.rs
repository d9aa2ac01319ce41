//! `hlacdb reindex`.

use std::time::Instant;

use clap::Args;
use hlacdb::synth::Nuisance;
use hlacdb::{Database, NuisanceUpdate};

use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{count, duration};

/// Fit the spaces on all textures and rebuild the index
///
/// Spaces are fitted automatically each time the store has doubled. This command fits them on all textures that are stored now.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb reindex
  hlacdb reindex --reextract        describe all textures again, e.g. after damage
  hlacdb reindex --nuisance brightness,noise,rotation
                                    estimate from the store which changes should not matter
  hlacdb reindex --nuisance prior   discard that estimate")]
pub(crate) struct Reindex {
    /// Describe every texture whose voxels are stored again, and recompute the statistics
    #[arg(long)]
    reextract: bool,

    /// Changes that should not matter: brightness, contrast, gamma, noise, rotation (separated by commas), or all. Their effect
    /// is estimated on at most 512 textures with stored voxels. It applies until `prior` discards it
    #[arg(long, value_name = "WORDS", value_parser = nuisance_update)]
    nuisance: Option<NuisanceUpdate>,
}

/// Parses the words after `--nuisance`.
fn nuisance_update(words: &str) -> Result<NuisanceUpdate, String> {
    match words {
        "prior" => Ok(NuisanceUpdate::Reset),
        words => words.parse::<Nuisance>().map(NuisanceUpdate::Estimate).map_err(|error| format!("{error}, prior")),
    }
}

impl Reindex {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_write()?;
        let progress = TerminalProgress::new(context)?;
        let (start, before) = (Instant::now(), size(&database));
        let report = database.reindex(
            &hlacdb::ReindexOptions::new().reextract(self.reextract).nuisance(self.nuisance.unwrap_or_default()),
            &progress,
        )?;
        if size(&database) > before + before / 4 {
            // Points were written anew beside the old ones, and a file grows by doubling. Whoever holds the store open
            // hinders that, and nothing else: `compact` may be run later.
            if let Err(error) = database.compact(&progress) {
                tracing::info!(%error, "the store was not compacted after the fit");
            }
        }
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        } else {
            context.note(&format!(
                "fit {} of {} on {}, in {}",
                report.epoch,
                report.spaces.join(", "),
                count(report.textures as usize, "texture"),
                duration(start.elapsed())
            ));
        }
        Ok(Outcome::Done)
    }
}

/// Bytes of the store's file; 0 where that cannot be told.
fn size(database: &Database) -> u64 {
    std::fs::metadata(database.path()).map_or(0, |metadata| metadata.len())
}
