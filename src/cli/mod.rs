//! The command line: what it accepts, and how answers and errors are printed.
//!
//! The commands are thin callers of the library, one file each in `commands/`. Answers go to stdout; the log, progress and
//! errors go to stderr. With `--json`, stdout holds one JSON document per command and nothing else. Exit status: 0 for
//! success, 1 where something failed, 2 for wrong usage.

mod arguments;
mod commands;
mod context;
mod definition;
mod hints;
mod progress;
mod table;

pub(crate) use context::Context;
pub(crate) use definition::{Cli, command};
