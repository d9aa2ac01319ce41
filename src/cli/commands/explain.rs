//! `hlacdb explain`.

use std::io::Write;

use clap::Args;
use hlacdb::PairExplanation;

use crate::cli::arguments::{SpaceArgument, whole};
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::table::{Align, Table};

/// The most orbits in the table; `--json` prints all.
const MAX_ORBITS: usize = 10;

/// Explain why two textures are alike or different
///
/// Their squared distance is divided by view, by the number of cells of a mask, and by orbit of masks. A positive share
/// separates the two textures, a negative one brings them together; the shares of a table add up to 100 %.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb explain 12 845
  hlacdb explain 12 845 --space paper
  hlacdb --json explain 12 845 | jq '.orbits[:3]'")]
pub(crate) struct Explain {
    /// The id of a texture
    #[arg(value_name = "A", value_parser = whole::<u64>)]
    a: u64,

    /// The id of another texture
    #[arg(value_name = "B", value_parser = whole::<u64>)]
    b: u64,

    #[command(flatten)]
    space: SpaceArgument,
}

impl Explain {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let explained = database.explain(self.a, self.b, self.space.name.as_deref())?;
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
        writeln!(out, "the two textures have the same point: there is nothing to explain")?;
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
    for share in explanation.orbits.iter().take(MAX_ORBITS) {
        table.row([
            share.orbit.to_string(),
            percent(share.share),
            share.view.to_string(),
            share.aspect.to_owned(),
            letters(&share.masks),
        ]);
    }
    table.write(out)?;
    let more = explanation.orbits.len().saturating_sub(MAX_ORBITS);
    if more > 0 {
        writeln!(out, "... and {more} more with smaller shares (--json prints all)")?;
    }
    writeln!(
        out,
        "\nShares are of the squared distance: positive shares separate the two textures, negative ones bring them together.\n\
         A view is a mapped copy of the texture at full, half or quarter scale. An orbit is a mask in all its orientations\n\
         (`hlacdb masks` lists masks by their letters): `mean` is its strength, `deviation` how much that depends on direction."
    )?;
    Ok(())
}

/// The letters of the first masks of an orbit, and how many more there are.
fn letters(masks: &[String]) -> String {
    const SHOWN: usize = 4;
    let first: Vec<&str> = masks.iter().take(SHOWN).map(String::as_str).collect();
    match masks.len().saturating_sub(SHOWN) {
        0 => first.join(" "),
        more => format!("{} and {more} more", first.join(" ")),
    }
}
