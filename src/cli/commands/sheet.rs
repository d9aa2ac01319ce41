//! `hlacdb sheet`.

use std::path::PathBuf;

use clap::Args;
use hlacdb::render::{self, ContactSheetOptions, SliceAxis};
use hlacdb::volume::display_path;

use crate::cli::arguments::{png, whole};
use crate::cli::context::{Context, Failure, Outcome};

/// Draw the slices of one texture as a picture (Figure 1 of the paper)
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb sheet 12                         writes texture-12.png
  hlacdb sheet 12 --out marble.png --axis y --columns 10")]
pub(crate) struct Sheet {
    /// The id of a texture
    #[arg(value_parser = whole::<u64>)]
    id: u64,

    /// The picture to write [default: texture-ID.png]
    #[arg(long, short, value_name = "OUT.png", value_parser = png())]
    out: Option<PathBuf>,

    /// The axis across which slices are taken: z, y or x
    #[arg(long, value_name = "AXIS", default_value = "z")]
    axis: SliceAxis,

    /// Slices in a row
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=64))]
    columns: u16,

    /// The most slices; of a longer axis every n-th slice is drawn
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u16).range(1..=4096))]
    slices: u16,
}

impl Sheet {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let texture = database.texture(self.id)?;
        let Some(volume) = database.volume(self.id)? else {
            return Err(Failure::message(format!(
                "texture {} ({}) was stored without voxels: ingest its file again with --volumes keep",
                texture.id, texture.name
            )));
        };
        let out = self.out.unwrap_or_else(|| PathBuf::from(format!("texture-{}.png", self.id)));
        let options = ContactSheetOptions::new()
            .columns(usize::from(self.columns))
            .slices(usize::from(self.slices))
            .axis(self.axis);
        render::texture_sheet(&texture, &volume, &options).write_png(&out)?;
        if context.json {
            context.print_json(&serde_json::json!({ "id": self.id, "sheet": display_path(&out) }))?;
        } else {
            context.note(&format!("wrote {}", display_path(&out)));
        }
        Ok(Outcome::Done)
    }
}
