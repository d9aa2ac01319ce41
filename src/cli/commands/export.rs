//! `hlacdb export`.

use std::path::PathBuf;

use clap::Args;
use hlacdb::volume::display_path;

use crate::cli::arguments::whole;
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::count;

/// Write moments, points and a table of textures, or whole textures
///
/// Files, with one row per texture in the order of ids:
///
///   moments.npy           (N, 251) f32: the moments of the view full@1
///   points.npy            (N, P) f32: the points of the default space
///   textures.csv          row, id, name, shape, path, and one column per tag
///   graph.npy             with --graph K: (N, K) i64, the ids of the K nearest neighbours in the default space, nearest
///                         first; -1 where there are fewer
///   graph_distances.npy   with --graph K: (N, K) f64, their distances; NaN where there are fewer
///
/// With --textures, whole textures (voxels, tags, provenance) are written instead, as a folder or a tar file. `hlacdb import`
/// reads them.
#[derive(Args)]
#[command(
    verbatim_doc_comment,
    after_help = "Examples:
  hlacdb export out/
  hlacdb export out/ --graph 10
  hlacdb export --textures all.tar && hlacdb -s other.hlacdb import all.tar
  python3 -c \"import numpy as np; print(np.load('out/moments.npy').shape)\""
)]
pub(crate) struct Export {
    /// Write whole textures: voxels as numpy arrays, everything else as JSON lines
    #[arg(long)]
    textures: bool,

    /// The folder, created if needed; with --textures, a name that ends in .tar makes a tar file
    #[arg(value_name = "DIR")]
    folder: PathBuf,

    /// Also write the K nearest neighbours of every texture
    #[arg(long, value_name = "K", value_parser = whole::<usize>)]
    graph: Option<usize>,
}

impl Export {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let progress = TerminalProgress::new(context)?;
        if self.textures {
            let report = database.export_textures(&self.folder, &progress)?;
            drop(progress);
            if context.json {
                context.print_json(&report)?;
            } else {
                let textures = count(report.textures as usize, "texture");
                context.note(&format!("wrote {textures}, {} with voxels, to {}", report.with_voxels, report.file));
            }
            return Ok(if report.damaged.is_empty() { Outcome::Done } else { Outcome::Partly });
        }
        let report = database.export(&self.folder, self.graph, &progress)?;
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        } else {
            let textures = count(report.textures as usize, "texture");
            context.note(&format!("wrote {textures} to {}", display_path(&self.folder)));
        }
        Ok(Outcome::Done)
    }
}
