//! `hlacdb import`.

use std::path::PathBuf;

use clap::Args;
use hlacdb::OpenOptions;
use hlacdb::arrays::MomentRows;
use hlacdb::hlac::View;
use hlacdb::volume::display_path;

use crate::cli::arguments::TagArguments;
use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::count;

/// Add descriptors that were computed elsewhere, or exported textures
///
/// An array has one row per texture: the 251 moments of each view, side by side. A moment is a sum divided by (number of
/// windows * 255^cells); masks are in the order of `hlacdb masks`. The textures have no voxels. They are found in the spaces
/// that use only the given views; the default space uses those of its views that there are.
///
/// A folder or tar file contains whole textures that `hlacdb export --textures` wrote.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb -s big.hlacdb import moments.npy
  hlacdb -s big.hlacdb import moments.npy --names names.txt --tag source=lab
  hlacdb -s big.hlacdb import all.npy --views full@1,stretch@1,detail@1
  hlacdb -s other.hlacdb import all.tar                  whole textures")]
pub(crate) struct Import {
    /// A numpy array (N, 251 per view) of f32 or f64; or a folder or .tar file of whole textures
    #[arg(value_name = "F.npy|F.tar|DIR")]
    moments: PathBuf,

    /// The views of the columns, in order
    #[arg(long, value_name = "VIEW,...", value_delimiter = ',', default_value = "full@1")]
    views: Vec<View>,

    /// A text file with one name per row
    #[arg(long, value_name = "F")]
    names: Option<PathBuf>,

    #[command(flatten)]
    tags: TagArguments,
}

impl Import {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        if self.moments.is_dir() || self.moments.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("tar")) {
            return self.whole_textures(context);
        }
        let tags = self.tags.map()?;
        let mut views = self.views.clone();
        views.sort_unstable();
        views.dedup();
        if views.len() != self.views.len() {
            return Err(Failure::Usage("--views names a view twice".into()));
        }
        // The array is checked first, so that a bad one leaves no empty store behind.
        drop(MomentRows::open_views(&self.moments, views.len())?);
        // A store that is created here keeps the views of the array.
        let database = OpenOptions::new().views(&views).open(&context.store)?;
        let progress = TerminalProgress::new(context)?;
        let report = database.import(&self.moments, &self.views, self.names.as_deref(), &tags, &progress)?;
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        } else {
            let spaces = database.space_names()?.join(", ");
            context.note(&format!("added {}; spaces: {spaces}", count(report.added as usize, "descriptor")));
        }
        Ok(Outcome::Done)
    }

    fn whole_textures(self, context: &mut Context) -> Result<Outcome, Failure> {
        if self.names.is_some() || !self.tags.is_empty() {
            let message = "exported textures have their own names and tags: leave out --names and --tag";
            return Err(Failure::Usage(message.into()));
        }
        // A missing file leaves no empty store behind.
        std::fs::metadata(&self.moments)
            .map_err(|error| Failure::message(format!("{}: {error}", display_path(&self.moments))))?;
        let database = context.open_or_create()?;
        let progress = TerminalProgress::new(context)?;
        let report = database.import_textures(&self.moments, &progress)?;
        drop(progress);
        if context.json {
            context.print_json(&report)?;
        } else {
            let added = count(report.added as usize, "texture");
            context.note(&format!("added {added}, {} already stored", report.duplicates));
        }
        Ok(Outcome::Done)
    }
}
