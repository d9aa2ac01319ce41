//! `hlacdb space`.

use std::io::Write;

use clap::{Args, Subcommand, ValueEnum};
use hlacdb::hlac::View;
use hlacdb::space::{Definition, FeatureForm, FeatureSet, Space as Fitted, SpaceKind};

use super::bars::Bars;
use super::table::{Align, Table};
use super::{Context, Failure, Outcome};

/// The spaces of the store, and spaces of your own
///
/// A space says what likeness means: which views are looked at, and what is made of their moments. A space of your own is
/// kept in the store, fitted with the others, and named wherever a command takes --space.
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
    act: Act,
}

#[derive(Subcommand)]
enum Act {
    /// The spaces that the store answers in
    List,
    /// The formula of one space
    Show {
        /// Its name
        name: String,
    },
    /// Add a space of your own and fit it
    Add(Add),
    /// Remove a space of your own
    Remove {
        /// Its name
        name: String,
    },
}

#[derive(Args)]
struct Add {
    /// 1 to 64 letters, digits, - or _
    name: String,

    /// Views of the store, separated by commas; all seven of the default space (histograms: full@1) unless said
    #[arg(long, value_name = "VIEWS", value_delimiter = ',')]
    views: Vec<String>,

    /// Forget orientation: mean and deviation over each of the 18 orbits of masks, and not the 251 masks
    #[arg(long)]
    pooled: bool,

    /// Weight of the nuisance scatter: 0 knows no nuisance, 1 weighs it as much as the octants
    #[arg(long, value_name = "W", default_value_t = 0.5, allow_hyphen_values = true)]
    nuisance: f64,

    /// Coordinates of a point, 1 to 128
    #[arg(long, value_name = "P", default_value_t = 32)]
    dims: usize,

    /// What is made of the features
    #[arg(long, value_enum, default_value_t = What::Likeness)]
    kind: What,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// The directions that vary much between textures and little within one; L2
    Likeness,
    /// The sums per window; L1 (the paper's histogram)
    Histogram,
    /// Histogram intersection: 1 - the sum of the lower of each two bins
    Intersection,
    /// (x - mean) / sd; L2
    Zscore,
}

impl Space {
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        match self.act {
            Act::List => list(context),
            Act::Show { name } => show(context, &name),
            Act::Add(add) => add.run(context),
            Act::Remove { name } => {
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
        let spaces: Vec<_> = spaces.iter().map(told).collect();
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

/// A space as `--json` shows it.
fn told(space: &Fitted) -> serde_json::Value {
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
        context.print_json(&told(&space))?;
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
        let bars = Bars::until(context, context.interruptible()?);
        let added = database.add_space(&definition, &bars)?;
        drop(bars);
        if context.json {
            context.print_json(&told(&added))?;
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

    /// What was asked for.
    fn definition(&self) -> Result<Definition, Failure> {
        let likeness = self.kind == What::Likeness;
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
            What::Histogram => SpaceKind::Histogram,
            What::Intersection => SpaceKind::Intersection,
            What::Zscore | What::Likeness => SpaceKind::ZScore,
        };
        Ok(Definition::new(&self.name, FeatureSet::new(form, &views)?, kind)?)
    }
}
