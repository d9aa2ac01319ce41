//! `hlacdb verify`.

use std::io::Write;

use clap::Args;

use super::bars::Bars;
use super::table::{Align, Table};
use super::{Context, Failure, Outcome};

/// Check everything in the store and list damage
///
/// Checksums, counts, links between tables, and the statistics and points recomputed. With --deep the voxels are
/// decompressed, hashed and described anew.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb verify
  hlacdb verify --deep

Exit status 1 where damage was found.")]
pub(crate) struct Verify {
    /// Decompress, hash and describe every texture's voxels anew
    #[arg(long)]
    deep: bool,
}

impl Verify {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let bars = Bars::until(context, context.interruptible()?);
        let report = database.verify(self.deep, &bars)?;
        drop(bars);
        if context.json {
            context.print_json(&report)?;
        } else {
            let mut table = Table::new([("checked", Align::Left), ("", Align::Right)]);
            for (what, number) in &report.checked {
                table.row([what.to_string(), number.to_string()]);
            }
            table.write(context.out())?;
            for damage in &report.damage {
                writeln!(context.out(), "damaged: {} {}: {}", damage.table, damage.key, damage.what)?;
            }
            let verdict = if report.ok() {
                "no damage"
            } else if report.known {
                "what is named is lost, and no repair brings it back; everything else is whole. Where you still have the file, \
                 `hlacdb remove ID` and `hlacdb ingest FILE` do"
            } else {
                "the store is damaged: what is not named above is whole; run `hlacdb repair`, which keeps the file as it is \
                 beside the repaired one, or go back to a backup"
            };
            writeln!(context.out(), "{verdict}")?;
        }
        Ok(if report.ok() { Outcome::Done } else { Outcome::Partly })
    }
}
