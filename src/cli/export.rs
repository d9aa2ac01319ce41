//! `hlacdb export`.

use std::path::PathBuf;

use clap::Args;
use hlacdb::volume::display_path;

use super::bars::Bars;
use super::table::count;
use super::{Context, Failure, Outcome};

/// Write moments.npy, points.npy and textures.csv
///
/// moments.npy: (N, 251) f32, the moments of full@1, one row per texture in id order. points.npy: (N, P) f32, the points of
/// the default space. textures.csv: row, id, name, shape, path and every tag as a column.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb export out/
  python3 -c \"import numpy as np; print(np.load('out/moments.npy').shape)\"")]
pub(crate) struct Export {
    /// A folder; made where there is none
    #[arg(value_name = "DIR")]
    folder: PathBuf,
}

impl Export {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let bars = Bars::until(context, context.interruptible()?);
        let report = database.export(&self.folder, &bars)?;
        drop(bars);
        if context.json {
            context.print_json(&report)?;
        } else {
            let textures = count(report.textures as usize, "texture");
            context.note(&format!("wrote {textures} to {}", display_path(&self.folder)));
        }
        Ok(Outcome::Done)
    }
}
