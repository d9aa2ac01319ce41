//! `hlacdb completions`.

use std::io::Write;

use clap::Args;
use clap_complete::Shell;

use crate::cli::context::{Context, Failure, Outcome};

/// Print a shell completion script
#[derive(Args)]
#[command(after_help = "Examples:
  hlacdb completions bash > ~/.local/share/bash-completion/completions/hlacdb
  hlacdb completions zsh > ~/.zfunc/_hlacdb")]
pub(crate) struct Completions {
    /// The shell
    shell: Shell,
}

impl Completions {
    /// Prints the script for the program with this definition.
    pub(crate) fn run(self, context: &mut Context, definition: &mut clap::Command) -> Result<Outcome, Failure> {
        if context.json {
            return Err(Failure::Usage("a completion script cannot be printed as JSON: leave out --json".into()));
        }
        // The generator panics where it cannot write, so it writes to memory first.
        let mut script = Vec::new();
        clap_complete::generate(self.shell, definition, "hlacdb", &mut script);
        context.out().write_all(&script)?;
        Ok(Outcome::Done)
    }
}
