//! `hlacdb space`.

use std::io::Write;

use clap::{Args, Subcommand, ValueEnum};
use hlacdb::hlac::View;
use hlacdb::space::{Definition, FeatureForm, FeatureSet, Space as Fitted, SpaceKind};

use crate::cli::context::{Context, Failure, Outcome};
use crate::cli::progress::TerminalProgress;
use crate::cli::table::{Align, Table};

/// List, show, add or remove spaces
///
/// A space defines similarity: which views are compared, and how. A space that you add is kept in the store, fitted together
/// with the built-in ones, and available wherever a command takes --space.
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb space list
  hlacdb space show default                            its formula
  hlacdb space add fine --views sign@1,detail@1 --pooled --nuisance 0.5 --dims 24
  hlacdb space add histogram --kind intersection       the paper's histograms by intersection
  hlacdb query --id 12 --space fine
  hlacdb space remove fine")]
pub(crate) struct Space {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// List the spaces of the store
    List,
    /// Show the formula of one space
    Show {
        /// The name of the space
        name: String,
    },
    /// Add a space and fit it
    Add(Add),
    /// Remove a space that was added
    Remove {
        /// The name of the space
        name: String,
    },
}

#[derive(Args)]
struct Add {
    /// The name: 1 to 64 letters, digits, - or _
    name: String,

    /// Views of the store, separated by commas [default: the seven views of the default space; full@1 for histograms]
    #[arg(long, value_name = "VIEWS", value_delimiter = ',')]
    views: Vec<String>,

    /// Ignore orientation: use mean and deviation over each of the 18 orbits of masks instead of the 251 masks
    #[arg(long)]
    pooled: bool,

    /// Weight of the nuisance scatter: 0 ignores nuisances, 1 weighs them as much as the octants
    #[arg(long, value_name = "W", default_value_t = 0.5, allow_hyphen_values = true)]
    nuisance: f64,

    /// The number of coordinates of a point, 1 to 128
    #[arg(long, value_name = "P", default_value_t = 32)]
    dims: usize,

    /// How features are compared
    #[arg(long, value_enum, default_value_t = Kind::Likeness)]
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// Along directions that vary much between textures and little within one; L2
    Likeness,
    /// As histograms of sums per window; L1 (the paper's histogram)
    Histogram,
    /// By histogram intersection: 1 minus the sum of the smaller of each two bins
    Intersection,
    /// As z-scores (x - mean) / sd; L2
    Zscore,
}

impl Space {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        match self.action {
            Action::List => list(context),
            Action::Show { name } => show(context, &name),
            Action::Add(add) => add.run(context),
            Action::Remove { name } => {
                context.open_to_write()?.remove_space(&name)?;
                if context.json {
                    context.print_json(&serde_json::json!({ "removed": name }))?;
                } else {
                    context.note(&format!("removed the space {name}"));
                }
                Ok(Outcome::Done)
            }
        }
    }
}

fn list(context: &mut Context) -> Result<Outcome, Failure> {
    let spaces = context.open_to_read()?.spaces()?;
    if context.json {
        let spaces: Vec<_> = spaces.iter().map(document).collect();
        context.print_json(&serde_json::json!({ "spaces": spaces }))?;
        return Ok(Outcome::Done);
    }
    let mut table = Table::new([
        ("space", Align::Left),
        ("fit", Align::Right),
        ("on", Align::Right),
        ("coordinates", Align::Right),
        ("distance", Align::Left),
        ("views", Align::Left),
    ]);
    for space in &spaces {
        let views: Vec<&str> = space.feature_set().views().iter().map(|view| view.name()).collect();
        let own = if Definition::built_in(space.name()).is_some() { "" } else { " (own)" };
        let numbers = [space.epoch(), space.textures_at_fit(), space.dims() as u64].map(|number| number.to_string());
        let name = format!("{}{own}", space.name());
        table.row([name].into_iter().chain(numbers).chain([space.metric().to_string(), views.join(" ")]));
    }
    table.write(context.out())?;
    Ok(Outcome::Done)
}

/// A space as `--json` prints it.
fn document(space: &Fitted) -> serde_json::Value {
    let definition = space.definition();
    serde_json::json!({
        "name": space.name(),
        "built_in": Definition::built_in(space.name()).is_some(),
        "epoch": space.epoch(),
        "fitted_on": space.textures_at_fit(),
        "dims": space.dims(),
        "definition": definition,
        "formula": definition.formula(),
    })
}

fn show(context: &mut Context, name: &str) -> Result<Outcome, Failure> {
    let space = context.open_to_read()?.space(name)?;
    let definition = space.definition();
    if context.json {
        context.print_json(&document(&space))?;
    } else {
        let (epoch, textures) = (space.epoch(), space.textures_at_fit());
        writeln!(context.out(), "{name}: fit {epoch}, on {textures} textures\n{}", definition.formula())?;
    }
    Ok(Outcome::Done)
}

impl Add {
    fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        let definition = self.definition()?;
        let database = context.open_to_write()?;
        let progress = TerminalProgress::new(context)?;
        let added = database.add_space(&definition, &progress)?;
        drop(progress);
        if context.json {
            context.print_json(&document(&added))?;
        } else {
            context.note(&format!(
                "added the space {}, fitted on {} textures\n{}",
                added.name(),
                added.textures_at_fit(),
                definition.formula()
            ));
        }
        Ok(Outcome::Done)
    }

    /// The definition that the arguments describe.
    fn definition(&self) -> Result<Definition, Failure> {
        let likeness = self.kind == Kind::Likeness;
        let views = match self.views.as_slice() {
            [] if likeness => View::LIKENESS.to_vec(),
            [] => vec![View::Full],
            named => named.iter().map(|name| name.parse::<View>()).collect::<Result<_, _>>()?,
        };
        if likeness {
            return Ok(Definition::likeness(&self.name, &views, self.pooled, self.nuisance, self.dims)?);
        }
        let form = if self.pooled { FeatureForm::Pooled } else { FeatureForm::Moments };
        let kind = match self.kind {
            Kind::Histogram => SpaceKind::Histogram,
            Kind::Intersection => SpaceKind::Intersection,
            Kind::Zscore | Kind::Likeness => SpaceKind::ZScore,
        };
        Ok(Definition::new(&self.name, FeatureSet::new(form, &views)?, kind)?)
    }
}
