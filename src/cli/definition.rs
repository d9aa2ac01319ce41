//! The command line as clap parses it.

use std::path::PathBuf;

use clap::{CommandFactory, Parser, Subcommand};
use hlacdb::volume::formats::infos;

use super::commands::*;
use super::context::{Context, Failure, Outcome};

/// The store where neither `--store` nor `HLACDB_STORE` names one.
const DEFAULT_STORE: &str = "textures.hlacdb";

/// Find solid textures (voxel volumes) that look alike.
#[derive(Parser)]
#[command(
    name = "hlacdb",
    version,
    max_term_width = 100,
    arg_required_else_help = true,
    after_help = "Examples:
  hlacdb demo                                 see everything work on generated textures, in a minute
  hlacdb ingest scans/ --tag project=cores    describe a folder of volumes into ./textures.hlacdb
  hlacdb query sample.nii.gz -k 5             the five textures most similar to a file
  hlacdb query --id 12 --sheet alike.png      the textures most similar to texture 12, as a picture

Answers go to stdout, everything else to stderr.
Exit status: 0 for success, 1 where something failed, 2 for wrong usage."
)]
pub(crate) struct Cli {
    /// Store file
    #[arg(short, long, global = true, env = "HLACDB_STORE", default_value = DEFAULT_STORE, value_name = "FILE")]
    pub(crate) store: PathBuf,

    /// Print one JSON document on stdout and nothing else (nothing at all if the command fails as a whole)
    #[arg(long, global = true)]
    pub(crate) json: bool,

    /// Print more on stderr: -v what is done, -vv every step
    #[arg(short, long, global = true, action = clap::ArgAction::Count, conflicts_with = "quiet")]
    pub(crate) verbose: u8,

    /// Print only errors on stderr, and no progress bar
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,

    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Reproduce the paper's experiment: 600 textures, 600 queries, times and precision
    Demo(demo::Demo),
    /// Describe volumes (files or folders) and add them to the store
    Ingest(ingest::Ingest),
    /// Generate a synthetic data set, into the store or as files
    Synth(synth::Synth),
    /// Find the textures most similar to a file, a stored texture or a descriptor
    Query(query::Query),
    /// List pairs of near-duplicate textures
    Dedupe(dedupe::Dedupe),
    /// Compute the 251 HLAC sums and moments of files, without a store
    Extract(extract::Extract),
    /// Show sizes, settings, a space and the normalisation statistics of the store
    Stats(stats::Stats),
    /// List the textures of the store
    List(list::List),
    /// Show one texture: provenance, tags, descriptor
    Show(show::Show),
    /// Draw the slices of one texture as a picture
    Sheet(sheet::Sheet),
    /// Set or remove tags of textures
    Tag(tag::Tag),
    /// Remove textures (`compact` frees their space)
    Remove(remove::Remove),
    /// Explain why two textures are alike or different
    Explain(explain::Explain),
    /// List, show, add or remove spaces
    Space(space::Space),
    /// Fit the spaces on all textures and rebuild the index
    Reindex(reindex::Reindex),
    /// Write moments, points and a table of textures, or whole textures
    Export(export::Export),
    /// Add descriptors that were computed elsewhere, or exported textures
    Import(import::Import),
    /// Measure retrieval by a tag: P@1, P@k, mAP, per class
    Eval(eval::Eval),
    /// Check the whole store for damage
    Verify(verify::Verify),
    /// Restore what can be recomputed in a damaged store
    Repair(repair::Repair),
    /// Copy the store while others use it
    Backup(backup::Backup),
    /// Free the space of removed textures
    Compact(compact::Compact),
    /// Upgrade a store of an older format
    Migrate(migrate::Migrate),
    /// Serve the web page and the HTTP API
    #[cfg(feature = "serve")]
    Serve(serve::Serve),
    /// Print the 251 masks of the paper
    Masks(masks::Masks),
    /// Print a shell completion script
    Completions(completions::Completions),
}

/// The definition of the command line. `-1` counts as a value wherever a value may stand, so that a negative number is
/// reported as a wrong number and not as an unknown option.
pub(crate) fn command() -> clap::Command {
    let takes_value = |argument: &clap::Arg| argument.get_action().takes_values();
    let mut definition = Cli::command();
    // An empty variable counts as unset.
    if std::env::var_os("HLACDB_STORE").is_some_and(|name| name.is_empty()) {
        definition = definition.mut_arg("store", |argument| argument.env(None::<&str>));
    }
    definition.mut_subcommands(|command| {
        let command = command.mut_args(|argument| match takes_value(&argument) {
            true => argument.allow_negative_numbers(true),
            false => argument,
        });
        match command.get_name() {
            "ingest" | "query" | "extract" => with_formats(command),
            _ => command,
        }
    })
}

/// Adds the formats that can be read to the help of a command.
fn with_formats(command: clap::Command) -> clap::Command {
    let formats: Vec<String> = infos()
        .filter(|format| format.available)
        .map(|format| format!("{} ({})", format.title, [format.extensions, format.slices].concat().join(" ")))
        .collect();
    let about = command.get_long_about().or(command.get_about()).map(ToString::to_string).unwrap_or_default();
    command.long_about(format!("{about}\n\nFormats: {}.", formats.join(", ")))
}

impl Cli {
    /// Runs the command. Its output is flushed by [`Context::finish`].
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
            Command::Completions(command) => command.run(context, &mut Self::command()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn help_lists_every_format() {
        let mut definition = command();
        let help = definition.find_subcommand_mut("ingest").unwrap().render_long_help().to_string();
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        for format in infos() {
            assert_eq!(help.contains(format.title), format.available, "{}", format.name);
        }
    }

    #[test]
    fn every_command_has_examples() {
        for command in command().get_subcommands().filter(|command| command.get_name() != "help") {
            let after = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(after.contains("hlacdb "), "{}", command.get_name());
        }
    }
}
