//! `hlacdb show`.

use std::io::Write;

use clap::Args;
use hlacdb::Provenance;
use hlacdb::volume::display_path;
use serde::Serialize;

use crate::cli::arguments::whole;
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::table::{bytes, one_line, shape, tags};

/// Show one texture: provenance, tags, descriptor
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb show 12
  hlacdb --json show 12 | jq .moments")]
pub(crate) struct Show {
    /// The id of a texture
    #[arg(value_parser = whole::<u64>)]
    id: u64,
}

#[derive(Serialize)]
struct Document {
    #[serde(flatten)]
    texture: hlacdb::Texture,
    path_shown: Option<String>,
    sums: Option<Vec<u64>>,
    windows: Option<u64>,
    moments: std::collections::BTreeMap<String, Vec<f32>>,
}

impl Show {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let texture = database.texture(self.id)?;
        let path_shown = texture.path.as_deref().map(display_path);
        if context.json {
            let sums = database.sums(self.id)?;
            let descriptor = database.descriptor(self.id)?;
            let document = Document {
                texture,
                path_shown,
                windows: sums.as_ref().map(|sums| sums.windows),
                sums: sums.map(|sums| sums.values.to_vec()),
                moments: descriptor.iter().map(|(view, row)| (view.name().to_string(), row.to_vec())).collect(),
            };
            context.print_json(&document)?;
            return Ok(Outcome::Done);
        }
        let mut lines = vec![
            ("texture", texture.id.to_string()),
            ("name", texture.name.clone()),
            ("tags", tags(&texture.tags)),
            ("shape", shape(texture.shape)),
            ("channels", texture.channels.to_string()),
            ("content", texture.content.as_ref().map_or_else(|| "-".into(), |hash| hash.to_string())),
            (
                "voxels",
                texture.stored_bytes.map_or_else(|| "not stored".into(), |size| format!("{} compressed", bytes(size))),
            ),
            ("path", path_shown.unwrap_or_else(|| "-".into())),
            ("source", texture.source.as_ref().map_or_else(|| "-".into(), source)),
        ];
        if let Some(block) = &texture.block {
            let [z, y, x] = block.origin;
            lines.push(("block", format!("at {z},{y},{x} of {}", shape(Some(block.shape)))));
        }
        for (key, value) in lines {
            writeln!(context.out(), "{key:9} {}", one_line(&value))?;
        }
        Ok(Outcome::Done)
    }
}

/// The file format, the sample type, and how samples map to 256 levels.
fn source(source: &Provenance) -> String {
    let levels = match &source.mapping {
        Some(mapping) => format!("{} to {} mapped to 0 to 255 ({})", mapping.lo, mapping.hi, mapping.rule),
        None => "not rescaled".to_owned(),
    };
    format!("{}, {} samples, {levels}", source.kind, source.samples)
}
