//! `hlacdb export`.

use std::path::PathBuf;

use clap::Args;
use hlacdb::volume::display_path;

use super::bars::Bars;
use super::table::count;
use super::values::whole;
use super::{Context, Failure, Outcome};

/// Write moments.npy, points.npy and textures.csv
///
/// moments.npy: (N, 251) f32, the moments of full@1, one row per texture in id order. points.npy: (N, P) f32, the points of
/// the default space. textures.csv: row, id, name, shape, path and every tag as a column. With --graph K, graph.npy:
/// (N, K) i64, the ids of the K nearest neighbours of each texture in the default space, nearest first, -1 where there are
/// fewer; graph_distances.npy: (N, K) f64, their distances, NaN there. With --textures instead: whole textures (voxels,
/// tags, provenance) as a folder, or as a tar file where the name ends in .tar; `import` reads them back.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb export out/
  hlacdb export out/ --graph 10
  hlacdb export --textures all.tar && hlacdb -s other.hlacdb import all.tar
  python3 -c \"import numpy as np; print(np.load('out/moments.npy').shape)\"")]
pub(crate) struct Export {
    /// Write whole textures: voxels as numpy arrays, everything else as JSON lines
    #[arg(long)]
    textures: bool,

    /// A folder, made where there is none; with --textures also a tar file
    #[arg(value_name = "DIR")]
    folder: PathBuf,

    /// The K nearest neighbours of every texture as well
    #[arg(long, value_name = "K", value_parser = whole::<usize>)]
    graph: Option<usize>,
}

impl Export {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let database = context.open_to_read()?;
        let bars = Bars::until(context, context.interruptible()?);
        if self.textures {
            let report = database.export_textures(&self.folder, &bars)?;
            drop(bars);
            if context.json {
                context.print_json(&report)?;
            } else {
                let textures = count(report.textures as usize, "texture");
                context.note(&format!("wrote {textures}, {} with voxels, to {}", report.with_voxels, report.file));
            }
            return Ok(if report.damaged.is_empty() { Outcome::Done } else { Outcome::Partly });
        }
        let report = database.export(&self.folder, self.graph, &bars)?;
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
