//! `hlacdb compact`.

use clap::Args;

use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::bytes;

/// Free the space of removed textures
///
/// The file is rewritten without unused space. Nothing else changes.
#[derive(Args)]
#[command(after_help = "Example:
  hlacdb remove 12 && hlacdb compact")]
pub(crate) struct Compact;

impl Compact {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_write()?;
        let progress = TerminalProgress::new(context)?;
        let report = database.compact(&progress)?;
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        } else {
            context.note(&format!("from {} to {}", bytes(report.bytes_before), bytes(report.bytes_after)));
        }
        Ok(Outcome::Done)
    }
}
