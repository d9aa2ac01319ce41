//! `hlacdb reindex`.

use std::time::Instant;

use clap::Args;
use hlacdb::synth::Nuisance;
use hlacdb::{Database, NuisanceUpdate};

use super::bars::Bars;
use super::table::{count, duration};
use super::{Context, Failure, Outcome};

/// Fit the statistics and the space anew, rebuild the index
///
/// A space is fitted by itself each time the store has doubled; this fits it on everything there is now.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb reindex
  hlacdb reindex --reextract        describe all voxels anew, e.g. after damage
  hlacdb reindex --nuisance brightness,noise,rotation
                                    learn from the store what should not matter
  hlacdb reindex --nuisance prior   forget that again")]
pub(crate) struct Reindex {
    /// Describe every texture whose voxels are kept anew, and rebuild the statistics from nothing
    #[arg(long)]
    reextract: bool,

    /// What should not matter: brightness, contrast, gamma, noise, rotation (separated by commas), or all. Estimated on at most
    /// 512 textures whose voxels are kept, and in force until `prior` forgets it
    #[arg(long, value_name = "WORDS", value_parser = learn)]
    nuisance: Option<NuisanceUpdate>,
}

/// The words after `--nuisance`.
fn learn(words: &str) -> Result<NuisanceUpdate, String> {
    match words {
        "prior" => Ok(NuisanceUpdate::Reset),
        words => words.parse::<Nuisance>().map(NuisanceUpdate::Estimate).map_err(|error| format!("{error}, prior")),
    }
}

impl Reindex {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_write()?;
        let bars = Bars::until(context, context.interruptible()?);
        let (began, before) = (Instant::now(), size(&database));
        let report = database.reindex(
            &hlacdb::ReindexOptions { reextract: self.reextract, nuisance: self.nuisance.unwrap_or_default() },
            &bars,
        )?;
        if size(&database) > before + before / 4 {
            // Points were written anew beside the old ones, and a file grows by doubling. Whoever holds the store open
            // hinders that, and nothing else: `compact` may be run later.
            if let Err(error) = database.compact(&bars) {
                tracing::info!(%error, "the store was not compacted after the fit");
            }
        }
        drop(bars);
        if context.json {
            context.print_json(&report)?;
        } else {
            context.note(&format!(
                "fit {} of {} on {}, in {}",
                report.epoch,
                report.spaces.join(", "),
                count(report.textures as usize, "texture"),
                duration(began.elapsed())
            ));
        }
        Ok(Outcome::Done)
    }
}

/// Bytes of the store's file; 0 where that cannot be told.
fn size(database: &Database) -> u64 {
    std::fs::metadata(database.path()).map_or(0, |metadata| metadata.len())
}
