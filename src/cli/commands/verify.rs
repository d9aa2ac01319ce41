//! `hlacdb verify`.

use std::io::Write;

use clap::Args;
use hlacdb::VerifyReport;

use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{Align, Table};

/// Check the whole store for damage
///
/// Checks checksums, counts and links between tables, and recomputes statistics and points. With --deep, the voxels of every
/// texture are also decompressed, hashed and described again.
///
/// Exit status 1 if there is damage.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb verify
  hlacdb verify --deep")]
pub(crate) struct Verify {
    /// Also decompress, hash and describe the voxels of every texture
    #[arg(long)]
    deep: bool,
}

impl Verify {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let progress = TerminalProgress::new(context)?;
        let report = database.verify(self.deep, &progress)?;
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        } else {
            print(context.out(), &report)?;
        }
        Ok(if report.ok() { Outcome::Done } else { Outcome::Partly })
    }
}

fn print(out: &mut impl Write, report: &VerifyReport) -> Result<(), Failure> {
    let mut table = Table::new([("checked", Align::Left), ("", Align::Right)]);
    for (what, number) in &report.checked {
        table.row([what.to_string(), number.to_string()]);
    }
    table.write(out)?;
    for damage in &report.damage {
        writeln!(out, "damaged: {} {}: {}", damage.table, damage.key, damage.what)?;
    }
    let verdict = if report.ok() {
        "no damage"
    } else if report.known {
        "the data listed are lost and cannot be repaired; everything else is intact. If you still have the files, \
         `hlacdb remove ID` and `hlacdb ingest FILE` bring the textures back"
    } else {
        "the store is damaged; what is not listed is intact: run `hlacdb repair`, which keeps the damaged file beside the \
         repaired one, or restore a backup"
    };
    Ok(writeln!(out, "{verdict}")?)
}
