//! `hlacdb backup`.

use std::path::PathBuf;

use clap::Args;

use super::bars::Bars;
use super::table::{bytes, count};
use super::{Context, Failure, Outcome};

/// Copy the store as it is at this moment, while others may go on using it
///
/// The copy is one consistent state, verified before it is reported. It is a store like any other.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb backup /mnt/safe/textures-2026-11-22.hlacdb
  hlacdb -s /mnt/safe/textures-2026-11-22.hlacdb verify --deep")]
pub(crate) struct Backup {
    /// Where to; nothing may be there
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

impl Backup {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let bars = Bars::until(context, context.interruptible()?);
        let report = database.backup(&self.file, &bars)?;
        drop(bars);
        if context.json {
            context.print_json(&report)?;
        } else {
            context.note(&format!(
                "copied {} (revision {}) to {}, {}, and verified it",
                count(report.textures as usize, "texture"),
                report.revision,
                report.file,
                bytes(report.bytes)
            ));
        }
        Ok(Outcome::Done)
    }
}
