//! What every command is given: where the store is, where answers go, how errors are told.

use std::error::Error;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use hlacdb::{Database, OpenOptions};

use super::remedy::remedy;

/// How a command that could do its work ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// All of it.
    Done,
    /// Some of it failed, and was told.
    Partly,
}

/// Why a command could not do its work.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The words of the command line do not fit together: exit status 2.
    Usage(String),
    /// The work failed: exit status 1.
    Failed(Box<dyn Error>),
}

impl Failure {
    /// A failure that only this program can know of, as one sentence.
    pub(crate) fn sentence(sentence: impl Into<String>) -> Self {
        Self::Failed(sentence.into().into())
    }
}

impl<E: Error + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(Box::new(error))
    }
}

/// What every command is given.
pub(crate) struct Context {
    pub(crate) store: PathBuf,
    pub(crate) json: bool,
    pub(crate) quiet: bool,
    out: BufWriter<io::Stdout>,
    interrupted: Arc<AtomicBool>,
}

impl Context {
    pub(crate) fn new(store: PathBuf, json: bool, quiet: bool) -> Self {
        let out = BufWriter::new(io::stdout());
        Self { store, json, quiet, out, interrupted: Arc::new(AtomicBool::new(false)) }
    }

    /// Where answers go.
    pub(crate) fn out(&mut self) -> &mut impl Write {
        &mut self.out
    }

    /// Prints the command's one JSON document.
    pub(crate) fn print_json(&mut self, document: &impl Serialize) -> Result<(), Failure> {
        serde_json::to_writer(&mut self.out, document)?;
        Ok(writeln!(self.out)?)
    }

    /// True where progress may be drawn.
    pub(crate) fn draws_progress(&self) -> bool {
        !self.quiet && io::stderr().is_terminal()
    }

    /// A word to the person, on stderr, unless `--quiet`.
    pub(crate) fn note(&self, sentence: &str) {
        if !self.quiet {
            eprintln!("{sentence}");
        }
    }

    /// From now on the first Ctrl-C (or SIGTERM) sets the flag that is returned, and a second one ends the program.
    pub(crate) fn interruptible(&self) -> Result<Arc<AtomicBool>, Failure> {
        self.interruptible_saying(
            "stopping after the batch in hand (again to stop at once; what was reported as added is safe)",
        )
    }

    /// The same with other words on stderr when it happens.
    pub(crate) fn interruptible_saying(&self, sentence: &'static str) -> Result<Arc<AtomicBool>, Failure> {
        let flag = Arc::clone(&self.interrupted);
        ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            eprintln!("{sentence}");
        })?;
        Ok(Arc::clone(&self.interrupted))
    }

    /// The store, to look at only.
    ///
    /// A store whose last writer did not end cleanly is repaired first, which takes one opening for writing.
    pub(crate) fn open_to_read(&self) -> Result<Database, Failure> {
        match OpenOptions::new().read_only(true).open(&self.store) {
            Err(error) if error.needs_repair() => {
                self.note("the store's last writer did not end cleanly: repairing it first");
                OpenOptions::new().create(false).open(&self.store).map_err(|error| {
                    let shown = hlacdb::volume::display_path(&self.store);
                    Failure::sentence(format!(
                        "{shown}: the store's last writer did not end cleanly, and the repair that it needs before it can be \
                         read could not be made: give write permission to it, or repair a copy\n  because {}",
                        chain(&error)
                    ))
                })?;
                Ok(OpenOptions::new().read_only(true).open(&self.store)?)
            }
            opened => Ok(opened?),
        }
    }

    /// The store, to change; it must be there.
    pub(crate) fn open_to_write(&self) -> Result<Database, Failure> {
        Ok(OpenOptions::new().create(false).open(&self.store)?)
    }

    /// The store, to add to; made where there is none.
    pub(crate) fn open_or_create(&self) -> Result<Database, Failure> {
        Ok(OpenOptions::new().open(&self.store)?)
    }

    /// Flushes the answers. A reader that closed the pipe early (`| head`) is no failure.
    pub(crate) fn finish(mut self, result: Result<Outcome, Failure>) -> u8 {
        let result = result.and_then(|outcome| self.out.flush().map(|()| outcome).map_err(Failure::from));
        match result {
            Ok(Outcome::Done) => 0,
            Ok(Outcome::Partly) => 1,
            Err(Failure::Usage(sentence)) => {
                eprintln!("hlacdb: {sentence}");
                2
            }
            Err(Failure::Failed(error)) if is_broken_pipe(error.as_ref()) => 0,
            // All other errors of the system come with what was being done.
            Err(Failure::Failed(error)) if is_bare(error.as_ref()) => {
                eprintln!("hlacdb: the answer could not be written to where it should go\n  because {error}");
                1
            }
            Err(Failure::Failed(error)) => {
                // What was already answered stays an answer.
                let _ = self.out.flush();
                eprintln!("hlacdb: {}", chain(error.as_ref()));
                1
            }
        }
    }
}

/// Whether an error is the system's or the encoder's own word, said of the answer's way out.
fn is_bare(error: &(dyn Error + 'static)) -> bool {
    error.is::<io::Error>() || error.downcast_ref::<serde_json::Error>().is_some_and(serde_json::Error::is_io)
}

fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    let io_kind = |error: &(dyn Error + 'static)| error.downcast_ref::<io::Error>().map(io::Error::kind);
    let json_kind = |error: &(dyn Error + 'static)| error.downcast_ref::<serde_json::Error>()?.io_error_kind();
    io_kind(error).or_else(|| json_kind(error)) == Some(io::ErrorKind::BrokenPipe)
}

/// An error's sentence, then its causes and what would help, each on a line of its own.
pub(crate) fn chain(error: &(dyn Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text.push_str("\n  because ");
        text.push_str(&error.to_string());
        cause = error.source();
    }
    if let Some(remedy) = remedy(error) {
        text.push_str("\n  help: ");
        text.push_str(&remedy);
    }
    text
}
