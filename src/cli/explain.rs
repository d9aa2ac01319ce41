//! `hlacdb explain`.

use std::io::Write;

use clap::Args;
use hlacdb::PairExplanation;

use super::table::{Align, Table};
use super::values::whole;
use super::{Context, Failure, Outcome};

/// So many orbits are shown to a person; `--json` has all of them.
const ORBITS: usize = 10;

/// Why two textures are alike, or not: their distance, taken apart by view, number of cells and orbit of masks
///
/// A positive share keeps the two apart, a negative one brings them together; all shares of a table add up to 100 %.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb explain 12 845
  hlacdb explain 12 845 --space paper
  hlacdb --json explain 12 845 | jq '.orbits[:3]'")]
pub(crate) struct Explain {
    /// A texture of the store, by id
    #[arg(value_name = "A", value_parser = whole::<u64>)]
    a: u64,

    /// The other one
    #[arg(value_name = "B", value_parser = whole::<u64>)]
    b: u64,

    /// In which space: default, oriented, invariant, paper, zscore, or one of your own
    #[arg(long, value_name = "NAME")]
    space: Option<String>,
}

impl Explain {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let explained = database.explain(self.a, self.b, self.space.as_deref())?;
        if context.json {
            context.print_json(&explained)?;
        } else {
            let [a, b] = [database.texture(self.a)?.name, database.texture(self.b)?.name];
            writeln!(
                context.out(),
                "{a} (id {}) and {b} (id {}): distance {:.4} in space {} (fit {})",
                self.a,
                self.b,
                explained.explanation.distance,
                explained.space,
                explained.epoch
            )?;
            print(context.out(), &explained)?;
        }
        Ok(Outcome::Done)
    }
}

fn print(out: &mut impl Write, explained: &PairExplanation) -> Result<(), Failure> {
    let explanation = &explained.explanation;
    if explanation.total <= 0.0 {
        writeln!(out, "nothing keeps them apart: their points are the same")?;
        return Ok(());
    }
    let percent = |share: f64| format!("{:+.1}%", share * 100.0);
    writeln!(out)?;
    let mut table = Table::new([("view", Align::Left), ("share", Align::Right)]);
    for (view, share) in &explanation.views {
        table.row([view.to_string(), percent(*share)]);
    }
    table.write(out)?;
    writeln!(out)?;
    let mut table = Table::new([("masks of", Align::Left), ("share", Align::Right)]);
    for (cells, share) in ["one cell", "two cells", "three cells"].into_iter().zip(explanation.cells) {
        table.row([cells.to_owned(), percent(share)]);
    }
    table.write(out)?;
    writeln!(out)?;
    let mut table = Table::new([
        ("orbit", Align::Right),
        ("share", Align::Right),
        ("view", Align::Left),
        ("of the orbit", Align::Left),
        ("masks", Align::Left),
    ]);
    for share in explanation.orbits.iter().take(ORBITS) {
        table.row([
            share.orbit.to_string(),
            percent(share.share),
            share.view.to_string(),
            share.aspect.to_owned(),
            letters(&share.masks),
        ]);
    }
    table.write(out)?;
    let left = explanation.orbits.len().saturating_sub(ORBITS);
    if left > 0 {
        writeln!(out, "... and {left} more with smaller shares (--json has all)")?;
    }
    writeln!(
        out,
        "\nShares are of the squared distance: what is positive keeps the two apart, what is negative brings them together.\n\
         A view is a mapped copy of the texture at full, half or quarter scale; an orbit is a mask in all its orientations\n\
         (`hlacdb masks` draws masks by their letters), `mean` its strength and `deviation` how much that depends on direction."
    )?;
    Ok(())
}

/// The first masks of an orbit by their letters (`hlacdb masks` draws them), and how many more there are.
fn letters(masks: &[String]) -> String {
    const SHOWN: usize = 4;
    let first: Vec<&str> = masks.iter().take(SHOWN).map(String::as_str).collect();
    match masks.len().saturating_sub(SHOWN) {
        0 => first.join(" "),
        more => format!("{} and {more} more", first.join(" ")),
    }
}
