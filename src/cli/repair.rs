//! `hlacdb repair`.

use std::io::Write;

use clap::Args;
use hlacdb::{Database, RepairOptions as Options};

use super::bars::Bars;
use super::table::count;
use super::{Context, Failure, Outcome};

/// Restore what can be derived again in a damaged store
///
/// What is whole goes into a new store; hashes, tags, rows, counters, sums, descriptors, statistics, spaces and points are
/// derived again from records and voxels; the result is verified and takes the store's name, and the damaged file is kept
/// beside it as STORE.damaged. A texture of which something cannot be derived is named and kept with what is left of it.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb repair --check        only say what is damaged
  hlacdb repair
  hlacdb repair --deep         voxels are described anew to look for damage

Exit status 1 where something is lost for good. Takes as much room on the disk as the store has.")]
pub(crate) struct Repair {
    /// Only say what is damaged
    #[arg(long)]
    check: bool,

    /// Look for damage in the voxels too: decompress, hash and describe every texture anew
    #[arg(long)]
    deep: bool,
}

impl Repair {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let bars = Bars::until(context, context.interruptible()?);
        let options = Options { deep: self.deep, check_only: self.check };
        let report = Database::repair(&context.store, &options, &bars)?;
        drop(bars);
        let whole = report.quarantined.is_empty() && (!self.check || report.damage.is_empty());
        if context.json {
            context.print_json(&report)?;
            return Ok(if whole { Outcome::Done } else { Outcome::Partly });
        }
        for damage in &report.damage {
            writeln!(context.out(), "damaged: {} {}: {}", damage.table, damage.key, damage.what)?;
        }
        for (what, number) in &report.derived {
            writeln!(context.out(), "derived again: {what}: {number}")?;
        }
        for lost in &report.quarantined {
            let answers = if lost.left_out { "it is left out of answers" } else { "it is still found" };
            writeln!(context.out(), "lost: texture {}: {}; {answers}", lost.id, lost.what)?;
        }
        if report.original.is_some() && !report.quarantined.is_empty() {
            let lost = count(report.quarantined.len(), "texture");
            writeln!(
                context.out(),
                "{lost} in all: where you still have the file, `hlacdb remove ID` and `hlacdb ingest FILE` bring one back"
            )?;
        }
        match (&report.original, report.damage.is_empty()) {
            (_, true) => writeln!(context.out(), "no damage: nothing was done")?,
            (None, false) if !self.check => writeln!(
                context.out(),
                "nothing more can be restored: what is named is lost, and the store stays as it is; everything else is whole"
            )?,
            (None, false) => writeln!(context.out(), "run `hlacdb repair` to restore what can be derived again")?,
            (Some(original), false) => {
                writeln!(context.out(), "repaired and verified; the store as it was: {original}")?;
            }
        }
        Ok(if whole { Outcome::Done } else { Outcome::Partly })
    }
}
