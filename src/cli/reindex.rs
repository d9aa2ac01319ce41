//! `hlacdb reindex`.

use std::time::Instant;

use clap::Args;

use super::bars::Bars;
use super::table::{count, duration};
use super::{Context, Failure, Outcome};

/// Fit the statistics and the space anew, rebuild the index
///
/// A space is fitted by itself each time the store has doubled; this fits it on everything there is now.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb reindex
  hlacdb reindex --reextract        describe all voxels anew, e.g. after damage")]
pub(crate) struct Reindex {
    /// Describe every texture whose voxels are kept anew, and rebuild the statistics from nothing
    #[arg(long)]
    reextract: bool,
}

impl Reindex {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_write()?;
        let bars = Bars::until(context, context.interruptible()?);
        let began = Instant::now();
        let report = database.reindex(&hlacdb::Reindex { reextract: self.reextract }, &bars)?;
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
