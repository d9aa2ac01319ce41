//! `hlacdb remove`.

use clap::Args;

use super::table::count;
use super::values::whole;
use super::{Context, Failure, Outcome};

/// Remove textures (`compact` gives the space back)
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb remove 12
  hlacdb remove 12 13 14 && hlacdb compact")]
pub(crate) struct Remove {
    /// The textures; all are removed, or, where one is not in the store, none
    #[arg(required = true, value_name = "ID", value_parser = whole::<u64>)]
    ids: Vec<u64>,
}

impl Remove {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_write()?;
        let removed = database.remove(&self.ids)?;
        if context.json {
            context.print_json(&serde_json::json!({ "removed": removed }))?;
        } else {
            context.note(&format!(
                "removed {}: run `hlacdb compact` to give the space back",
                count(removed.len(), "texture")
            ));
        }
        Ok(Outcome::Done)
    }
}
