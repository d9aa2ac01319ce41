//! The command line as clap sees it.

use std::path::PathBuf;

use clap::{CommandFactory, Parser, Subcommand};

use super::*;

/// The store that is used where neither `--store` nor `HLACDB_STORE` names one.
pub(crate) const DEFAULT_STORE: &str = "textures.hlacdb";

/// Find solid textures (voxel volumes) that look alike.
#[derive(Parser)]
#[command(
    name = "hlacdb",
    version,
    max_term_width = 100,
    arg_required_else_help = true,
    after_help = "Examples:
  hlacdb demo                                 see it work, from nothing, in a minute
  hlacdb ingest scans/ --tag project=cores    describe a folder of volumes into ./textures.hlacdb
  hlacdb query sample.nii.gz -k 5             the five textures most like a file
  hlacdb query --id 12 --sheet alike.png      ... like texture 12, as a picture of slices

Answers go to stdout, everything else to stderr. Exit status: 0 all done, 1 something failed, 2 wrong usage."
)]
pub(crate) struct Cli {
    /// The store: one file
    #[arg(short, long, global = true, env = "HLACDB_STORE", default_value = DEFAULT_STORE, value_name = "FILE")]
    pub(crate) store: PathBuf,

    /// Print one JSON document, and only that, on stdout (nothing where the command fails as a whole)
    #[arg(long, global = true)]
    pub(crate) json: bool,

    /// Say more on stderr (-v what is done, -vv every step)
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub(crate) verbose: u8,

    /// Say nothing on stderr but errors; no progress bar
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,

    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// The paper's experiment from nothing: 600 textures, 600 queries, its figures beside ours
    Demo(demo::Demo),
    /// Describe volumes (files, folders) and add them to the store
    Ingest(ingest::Ingest),
    /// Synthesise a recipe's textures, into the store or as files
    Synth(synth::Synth),
    /// The k textures most alike to a file, a stored texture or a descriptor
    Query(query::Query),
    /// Pairs of textures that are nearly the same
    Dedupe(dedupe::Dedupe),
    /// The 251 exact sums and moments of files, without a store
    Extract(extract::Extract),
    /// What the store holds: sizes, space, normalisation statistics, settings
    Stats(stats::Stats),
    /// The textures of the store
    List(list::List),
    /// One texture: provenance, tags, descriptor
    Show(show::Show),
    /// A picture of one texture's slices
    Sheet(sheet::Sheet),
    /// Set or take off tags of textures
    Tag(tag::Tag),
    /// Remove textures (`compact` gives the space back)
    Remove(remove::Remove),
    /// Why two textures are alike, or not
    Explain(explain::Explain),
    /// The spaces of the store, and spaces of your own
    Space(space::Space),
    /// Fit the statistics and the space anew, rebuild the index
    Reindex(reindex::Reindex),
    /// Write moments.npy, points.npy and textures.csv
    Export(export::Export),
    /// Add descriptors (moments) computed elsewhere
    Import(import::Import),
    /// Retrieval measures by a tag: P@1, P@k, mAP, per class
    Eval(eval::Eval),
    /// Check everything in the store and list damage
    Verify(verify::Verify),
    /// Restore what can be derived again in a damaged store
    Repair(repair::Repair),
    /// Copy the store as it is at this moment, while others may go on using it
    Backup(backup::Backup),
    /// Give the space of removed textures back
    Compact(compact::Compact),
    /// Bring a store of an older format to this version's
    Migrate(migrate::Migrate),
    /// The search interface: a page, and an HTTP API
    #[cfg(feature = "serve")]
    Serve(serve::Serve),
    /// Print the 251 masks: the file the paper offered for download
    Masks(masks::Masks),
    /// Print a shell's completion script
    Completions(completions::Completions),
}

/// The definition of the command line. `-1` is a value wherever a value may stand, so that a bad number is told as one
/// and not taken for an option.
pub(crate) fn command() -> clap::Command {
    let takes_value = |argument: &clap::Arg| argument.get_action().takes_values();
    let mut definition = Cli::command();
    // An empty variable is none: what it would name is no file.
    if std::env::var_os("HLACDB_STORE").is_some_and(|name| name.is_empty()) {
        definition = definition.mut_arg("store", |argument| argument.env(None::<&str>));
    }
    definition.mut_subcommands(|command| {
        command.mut_args(|argument| match takes_value(&argument) {
            true => argument.allow_negative_numbers(true),
            false => argument,
        })
    })
}

impl Cli {
    /// Runs the command. What it printed is flushed when the context is finished.
    pub(crate) fn run(self, context: &mut Context) -> Result<Outcome, Failure> {
        match self.command {
            Command::Demo(command) => command.run(context),
            Command::Ingest(command) => command.run(context),
            Command::Synth(command) => command.run(context),
            Command::Query(command) => command.run(context),
            Command::Dedupe(command) => command.run(context),
            Command::Extract(command) => command.run(context),
            Command::Stats(command) => command.run(context),
            Command::List(command) => command.run(context),
            Command::Show(command) => command.run(context),
            Command::Sheet(command) => command.run(context),
            Command::Tag(command) => command.run(context),
            Command::Remove(command) => command.run(context),
            Command::Explain(command) => command.run(context),
            Command::Space(command) => command.run(context),
            Command::Reindex(command) => command.run(context),
            Command::Export(command) => command.run(context),
            Command::Import(command) => command.run(context),
            Command::Eval(command) => command.run(context),
            Command::Verify(command) => command.run(context),
            Command::Repair(command) => command.run(context),
            Command::Backup(command) => command.run(context),
            Command::Compact(command) => command.run(context),
            Command::Migrate(command) => command.run(context),
            #[cfg(feature = "serve")]
            Command::Serve(command) => command.run(context),
            Command::Masks(command) => command.run(context),
            Command::Completions(command) => command.run(context),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_holds_together() {
        command().debug_assert();
    }
}
