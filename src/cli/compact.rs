//! `hlacdb compact`.

use clap::Args;

use super::bars::Bars;
use super::table::bytes;
use super::{Context, Failure, Outcome};

/// Give the space of removed textures back
#[derive(Args)]
#[command(after_help = "Example:
  hlacdb remove 12 && hlacdb compact")]
pub(crate) struct Compact;

impl Compact {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_write()?;
        let bars = Bars::until(context, context.interruptible()?);
        let report = database.compact(&bars)?;
        drop(bars);
        if context.json {
            context.print_json(&report)?;
        } else {
            context.note(&format!("from {} to {}", bytes(report.bytes_before), bytes(report.bytes_after)));
        }
        Ok(Outcome::Done)
    }
}
