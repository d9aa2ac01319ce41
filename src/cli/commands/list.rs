//! `hlacdb list`.

use std::collections::BTreeMap;

use clap::Args;
use serde::Serialize;

use crate::cli::arguments::FilterArguments;
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::table::{Align, Table, shape, tags};

/// List the textures of the store
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb list
  hlacdb list --where family=marble
  hlacdb --json list | jq '.textures[].name'")]
pub(crate) struct List {
    #[command(flatten)]
    filters: FilterArguments,
}

#[derive(Serialize)]
struct Row {
    id: u64,
    name: String,
    shape: Option<[usize; 3]>,
    tags: BTreeMap<String, String>,
}

impl List {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let textures = context.open_to_read()?.textures(&self.filters.filters())?;
        if context.json {
            let rows: Vec<Row> = textures
                .into_iter()
                .map(|texture| Row {
                    id: texture.id.get(),
                    name: texture.name,
                    shape: texture.shape,
                    tags: texture.tags,
                })
                .collect();
            context.print_json(&serde_json::json!({ "textures": rows }))?;
            return Ok(Outcome::Done);
        }
        let mut table =
            Table::new([("id", Align::Right), ("shape", Align::Left), ("name", Align::Left), ("tags", Align::Left)]);
        for texture in textures {
            table.row([texture.id.to_string(), shape(texture.shape), texture.name, tags(&texture.tags)]);
        }
        table.write(context.out())?;
        Ok(Outcome::Done)
    }
}
