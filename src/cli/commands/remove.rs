//! `hlacdb remove`.

use clap::Args;

use crate::cli::arguments::whole;
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::table::count;

/// Remove textures (`compact` frees their space)
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb remove 12
  hlacdb remove 12 13 14 && hlacdb compact")]
pub(crate) struct Remove {
    /// The ids of textures. If one of them is not in the store, none is removed
    #[arg(required = true, value_name = "ID", value_parser = whole::<u64>)]
    ids: Vec<u64>,
}

impl Remove {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let removed = context.open_to_write()?.remove(&self.ids)?;
        if context.json {
            context.print_json(&serde_json::json!({ "removed": removed }))?;
        } else {
            let textures = count(removed.len(), "texture");
            context.note(&format!("removed {textures}: run `hlacdb compact` to free the space"));
        }
        Ok(Outcome::Done)
    }
}
