//! `hlacdb dedupe`.

use clap::Args;

use crate::cli::arguments::SpaceArgument;
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::table::{Align, Table, count};

/// List pairs of near-duplicate textures
///
/// Identical volumes are never stored twice; these are pairs of textures whose points are close together. Nothing is removed:
/// use `hlacdb remove` for that. In the default space, unrelated textures are about 1.41 apart.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb dedupe
  hlacdb dedupe --within 0.05
  hlacdb --json dedupe --space paper --within 2")]
pub(crate) struct Dedupe {
    /// The largest distance of a pair [default: 0.015]
    #[arg(long, value_name = "DISTANCE")]
    within: Option<f64>,

    #[command(flatten)]
    space: SpaceArgument,
}

impl Dedupe {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let pairs = database.near_pairs(self.space.name.as_deref(), self.within)?;
        if context.json {
            context.print_json(&serde_json::json!({ "pairs": pairs }))?;
            return Ok(Outcome::Done);
        }
        let mut table = Table::new([
            ("distance", Align::Right),
            ("id", Align::Right),
            ("name", Align::Left),
            ("id", Align::Right),
            ("name", Align::Left),
        ]);
        for pair in &pairs {
            let distance = format!("{:.6}", pair.distance);
            let [first, second] = [pair.first, pair.second].map(|id| id.to_string());
            table.row([distance, first, pair.first_name.clone(), second, pair.second_name.clone()]);
        }
        table.write(context.out())?;
        context.note(&count(pairs.len(), "pair"));
        Ok(Outcome::Done)
    }
}
