//! `hlacdb dedupe`.

use clap::Args;

use super::table::{Align, Table, count};
use super::{Context, Failure, Outcome};

/// Pairs of textures that are nearly the same
///
/// Nothing is removed: `hlacdb remove` does that. What is the same to the voxel was never added twice; these are textures whose
/// points lie near one another. The distance that counts as near is 0.015 unless said otherwise: unit points that have nothing
/// in common are 1.41 apart.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb dedupe
  hlacdb dedupe --within 0.05
  hlacdb --json dedupe --space paper --within 2")]
pub(crate) struct Dedupe {
    /// Pairs at this distance or nearer [default: 0.015]
    #[arg(long, value_name = "DISTANCE")]
    within: Option<f64>,

    /// In which space [default: default]
    #[arg(long, value_name = "NAME")]
    space: Option<String>,
}

impl Dedupe {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let pairs = database.near_pairs(self.space.as_deref(), self.within)?;
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
