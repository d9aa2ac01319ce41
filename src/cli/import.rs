//! `hlacdb import`.

use std::path::PathBuf;

use clap::Args;
use hlacdb::OpenOptions;
use hlacdb::arrays::MomentRows;
use hlacdb::hlac::View;

use super::bars::Bars;
use super::table::count;
use super::tag::{KeyValue, one_value_each};
use super::{Context, Failure, Outcome};

/// Add descriptors (moments) computed elsewhere
///
/// The array has one row of 251 moments of full@1 per texture: sums / (windows * 255^cells), in the order of `hlacdb
/// masks`. The textures have no voxels; they are found in the spaces that their moments allow.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb -s big.hlacdb import moments.npy
  hlacdb -s big.hlacdb import moments.npy --names names.txt --tag source=lab")]
pub(crate) struct Import {
    /// A numpy array (N, 251) of f32 or f64
    #[arg(value_name = "F.npy")]
    moments: PathBuf,

    /// A text file with one name per row
    #[arg(long, value_name = "F")]
    names: Option<PathBuf>,

    /// A tag for every texture (repeatable)
    #[arg(long = "tag", value_name = "KEY=VALUE")]
    tags: Vec<KeyValue>,
}

impl Import {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let tags = one_value_each(self.tags)?;
        // An array that cannot be read leaves no empty store behind.
        drop(MomentRows::open(&self.moments)?);
        // A store that the import makes keeps the one view that the array has.
        let database = OpenOptions::new().views(&[View::Full]).open(&context.store)?;
        let bars = Bars::until(context, context.interruptible()?);
        let report = database.import(&self.moments, self.names.as_deref(), &tags, &bars)?;
        drop(bars);
        if context.json {
            context.print_json(&report)?;
        } else {
            context.note(&format!("added {}", count(report.added as usize, "descriptor")));
        }
        Ok(Outcome::Done)
    }
}
