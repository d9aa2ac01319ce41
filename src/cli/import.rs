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
/// The array has one row per texture: the 251 moments of each view, side by side: sums / (windows * 255^cells), in the
/// order of `hlacdb masks`. The textures have no voxels; they are found in the spaces that their views allow: `default`
/// then means its recipe on the views there are. A folder or .tar file is read as whole textures that
/// `export --textures` wrote.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb -s big.hlacdb import moments.npy
  hlacdb -s other.hlacdb import all.tar
  hlacdb -s big.hlacdb import moments.npy --names names.txt --tag source=lab
  hlacdb -s big.hlacdb import all.npy --views full@1,stretch@1,detail@1")]
pub(crate) struct Import {
    /// A numpy array (N, 251 per view) of f32 or f64; or a folder or .tar file of whole textures
    #[arg(value_name = "F.npy|F.tar|DIR")]
    moments: PathBuf,

    /// The views that the columns are of, in their order
    #[arg(long, value_name = "VIEW,...", value_delimiter = ',', default_value = "full@1")]
    views: Vec<View>,

    /// A text file with one name per row
    #[arg(long, value_name = "F")]
    names: Option<PathBuf>,

    /// A tag for every texture (repeatable)
    #[arg(long = "tag", value_name = "KEY=VALUE")]
    tags: Vec<KeyValue>,
}

impl Import {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        if self.moments.is_dir() || self.moments.extension().is_some_and(|kind| kind.eq_ignore_ascii_case("tar")) {
            return self.whole_textures(context);
        }
        let tags = one_value_each(self.tags)?;
        // An array that cannot be read leaves no empty store behind.
        let mut views = self.views.clone();
        views.sort_unstable();
        views.dedup();
        if views.len() != self.views.len() {
            return Err(Failure::Usage("--views names a view twice: name each once".into()));
        }
        drop(MomentRows::open_views(&self.moments, views.len())?);
        // A store that the import makes keeps the views that the array has.
        let database = OpenOptions::new().views(&views).open(&context.store)?;
        let bars = Bars::until(context, context.interruptible()?);
        let report = database.import(&self.moments, &self.views, self.names.as_deref(), &tags, &bars)?;
        drop(bars);
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
            return Err(Failure::Usage(
                "whole textures come with names and tags of their own: leave out --names and --tag".into(),
            ));
        }
        std::fs::metadata(&self.moments)
            .map_err(|error| Failure::sentence(format!("{}: {error}", hlacdb::volume::display_path(&self.moments))))?;
        let database = context.open_or_create()?;
        let bars = Bars::until(context, context.interruptible()?);
        let report = database.import_textures(&self.moments, &bars)?;
        drop(bars);
        if context.json {
            context.print_json(&report)?;
        } else {
            let added = count(report.added as usize, "texture");
            context.note(&format!("added {added}, {} already there", report.duplicates));
        }
        Ok(Outcome::Done)
    }
}
