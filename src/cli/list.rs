//! `hlacdb list`.

use clap::Args;
use hlacdb::TagFilter;
use serde::Serialize;

use super::table::{Align, Table, shape, tags};
use super::tag::KeyValue;
use super::{Context, Failure, Outcome};

/// The textures of the store
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb list
  hlacdb list --where family=marble
  hlacdb --json list | jq '.textures[].name'")]
pub(crate) struct List {
    /// Only textures with this tag (repeatable: all must hold)
    #[arg(long = "where", value_name = "KEY=VALUE")]
    filters: Vec<KeyValue>,
}

#[derive(Serialize)]
struct Row {
    id: u64,
    name: String,
    shape: Option<[usize; 3]>,
    tags: std::collections::BTreeMap<String, String>,
}

impl List {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let filters: Vec<TagFilter> = self.filters.into_iter().map(KeyValue::into_filter).collect();
        let textures = database.textures(&filters)?;
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
