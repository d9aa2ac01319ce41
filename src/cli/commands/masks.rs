//! `hlacdb masks`.

use std::io::Write;

use clap::Args;
use hlacdb::hlac::MASKS;
use serde::Serialize;

use crate::cli::context::{Context, Failure, Outcome};

/// Print the 251 masks of the paper
///
/// One mask per line: its number, its letters (Figure 3a of the paper), and its cells as offsets z,y,x from the window's first
/// corner.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb masks > masks.txt
  hlacdb masks --letters        only the letters, one mask per line
  hlacdb --json masks")]
pub(crate) struct Masks {
    /// Print only the letters
    #[arg(long)]
    letters: bool,
}

#[derive(Serialize)]
struct MaskRow {
    number: usize,
    letters: String,
    offsets: Vec<[usize; 3]>,
}

impl Masks {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let rows: Vec<MaskRow> = (1..)
            .zip(&MASKS)
            .map(|(number, mask)| MaskRow { number, letters: mask.letters(), offsets: mask.offsets().collect() })
            .collect();
        if context.json {
            context.print_json(&serde_json::json!({ "masks": rows }))?;
            return Ok(Outcome::Done);
        }
        for row in rows {
            if self.letters {
                writeln!(context.out(), "{}", row.letters)?;
                continue;
            }
            let offsets: Vec<String> = row.offsets.iter().map(|[z, y, x]| format!("{z},{y},{x}")).collect();
            writeln!(context.out(), "{:3} {:3} {}", row.number, row.letters, offsets.join(" "))?;
        }
        Ok(Outcome::Done)
    }
}
