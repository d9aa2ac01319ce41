//! The program's commands: one file each, thin callers of the library.
//!
//! Answers go to stdout, everything else (log, progress, errors) to stderr. With `--json` stdout holds one JSON
//! document per command, and only that. Exit status: 0 all done, 1 something failed, 2 wrong usage.

mod arguments;
mod bars;
mod context;
mod read_arguments;
mod remedy;
mod table;
mod values;

mod backup;
mod compact;
mod completions;
mod dedupe;
mod demo;
mod eval;
mod explain;
mod export;
mod extract;
mod import;
mod ingest;
mod list;
mod masks;
mod migrate;
mod query;
mod reindex;
mod remove;
mod repair;
#[cfg(feature = "serve")]
mod serve;
mod sheet;
mod show;
mod space;
mod stats;
mod synth;
mod tag;
mod verify;

pub(crate) use arguments::{Cli, command};
pub(crate) use context::{Context, Failure, Outcome};
