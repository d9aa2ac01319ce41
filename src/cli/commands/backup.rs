//! `hlacdb backup`.

use std::path::PathBuf;

use clap::Args;

use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{bytes, count};

/// Copy the store while others use it
///
/// The copy is one consistent state, and it is verified before success is reported. It is a store like any other.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb backup /mnt/safe/textures.backup
  hlacdb -s /mnt/safe/textures.backup verify --deep     check the copy")]
pub(crate) struct Backup {
    /// The copy; the file must not exist
    #[arg(value_name = "FILE")]
    file: PathBuf,
}

impl Backup {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let progress = TerminalProgress::new(context)?;
        let report = database.backup(&self.file, &progress)?;
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        } else {
            context.note(&format!(
                "copied {} (revision {}) to {}, {}, and verified the copy",
                count(report.textures as usize, "texture"),
                report.revision,
                report.file,
                bytes(report.bytes)
            ));
        }
        Ok(Outcome::Done)
    }
}
