//! `hlacdb repair`.

use std::io::Write;

use clap::Args;
use hlacdb::{Database, RepairOptions, RepairReport};

use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::count;

/// Restore what can be recomputed in a damaged store
///
/// Intact data are copied into a new store. Hashes, tags, rows, counters, sums, descriptors, statistics, spaces and points are
/// recomputed from records and voxels where they are damaged. The new store is verified and takes the name of the old one,
/// which is kept beside it as STORE.damaged. Textures that cannot be restored completely are listed and kept with what is
/// left of them.
///
/// Exit status 1 if something cannot be restored. Needs as much free disk space as the store takes.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb repair --check        only report damage
  hlacdb repair
  hlacdb repair --deep         also look for damage in the voxels")]
pub(crate) struct Repair {
    /// Only report damage
    #[arg(long)]
    check: bool,

    /// Also look for damage in the voxels: decompress, hash and describe every texture again
    #[arg(long)]
    deep: bool,
}

impl Repair {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let progress = TerminalProgress::new(context)?;
        let options = RepairOptions::new().deep(self.deep).check_only(self.check);
        let report = Database::repair(&context.store, &options, &progress)?;
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        } else {
            self.print(context.out(), &report)?;
        }
        let whole = report.quarantined.is_empty() && (!self.check || report.damage.is_empty());
        Ok(if whole { Outcome::Done } else { Outcome::Partly })
    }

    fn print(&self, out: &mut impl Write, report: &RepairReport) -> Result<(), Failure> {
        for damage in &report.damage {
            writeln!(out, "damaged: {} {}: {}", damage.table, damage.key, damage.what)?;
        }
        for (what, number) in &report.derived {
            writeln!(out, "recomputed: {what}: {number}")?;
        }
        for lost in &report.quarantined {
            let answers = if lost.left_out { "it is left out of answers" } else { "it is still found" };
            writeln!(out, "lost: texture {}: {}; {answers}", lost.id, lost.what)?;
        }
        if report.original.is_some() && !report.quarantined.is_empty() {
            writeln!(
                out,
                "{} lost in all: if you still have the file of one, `hlacdb remove ID` and `hlacdb ingest FILE` bring it back",
                count(report.quarantined.len(), "texture")
            )?;
        }
        match &report.original {
            _ if report.damage.is_empty() => writeln!(out, "no damage: nothing was changed")?,
            Some(original) => writeln!(out, "repaired and verified; the damaged store was kept as {original}")?,
            None if self.check => writeln!(out, "run `hlacdb repair` to restore what can be recomputed")?,
            None => writeln!(out, "nothing more can be restored: the data listed are lost, all others are intact")?,
        }
        Ok(())
    }
}
