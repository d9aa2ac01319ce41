//! What every command shares: the store, where answers go, and how errors end the program.

use std::error::Error;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Serialize;

use hlacdb::volume::display_path;
use hlacdb::{Database, OpenOptions};

use super::hints::Advice;

/// How a command ended that could do its work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// Everything succeeded: exit status 0.
    Done,
    /// Some of it failed and was reported: exit status 1.
    Partly,
}

/// Why a command could not do its work.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The arguments contradict each other: exit status 2.
    Usage(String),
    /// The work failed: exit status 1.
    Failed(Box<dyn Error>),
}

impl Failure {
    /// A failure of this program that no library error describes.
    pub(super) fn message(message: impl Into<String>) -> Self {
        Self::Failed(message.into().into())
    }
}

impl<E: Error + 'static> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(Box::new(error))
    }
}

/// What every command shares.
pub(crate) struct Context {
    pub(super) store: PathBuf,
    pub(super) json: bool,
    quiet: bool,
    out: BufWriter<io::Stdout>,
    interrupted: Arc<AtomicBool>,
}

impl Context {
    pub(crate) fn new(store: PathBuf, json: bool, quiet: bool) -> Self {
        let out = BufWriter::new(io::stdout());
        Self { store, json, quiet, out, interrupted: Arc::new(AtomicBool::new(false)) }
    }

    /// Where answers are written.
    pub(super) fn out(&mut self) -> &mut impl Write {
        &mut self.out
    }

    /// Prints the command's JSON document.
    pub(super) fn print_json(&mut self, document: &impl Serialize) -> Result<(), Failure> {
        serde_json::to_writer(&mut self.out, document)?;
        Ok(writeln!(self.out)?)
    }

    /// Whether progress is drawn.
    pub(super) fn draws_progress(&self) -> bool {
        !self.quiet && io::stderr().is_terminal()
    }

    /// Prints a message for the user on stderr, unless `--quiet`.
    pub(super) fn note(&self, message: &str) {
        if !self.quiet {
            eprintln!("{message}");
        }
    }

    /// From now on, the first Ctrl-C (or SIGTERM) prints `message` and sets the returned flag; a second one ends the program.
    pub(super) fn interruptible(&self, message: &'static str) -> Result<Arc<AtomicBool>, Failure> {
        let flag = Arc::clone(&self.interrupted);
        ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(130);
            }
            eprintln!("{message}");
        })?;
        Ok(Arc::clone(&self.interrupted))
    }

    /// Opens the store read-only. A store whose last writer did not close it is recovered first, which opens it once for
    /// writing.
    pub(super) fn open_to_read(&self) -> Result<Database, Failure> {
        match OpenOptions::new().read_only(true).open(&self.store) {
            Err(error) if error.needs_repair() => {
                self.note("the store was not closed properly: recovering it first");
                OpenOptions::new().create(false).open(&self.store).map_err(|error| {
                    Failure::message(format!(
                        "{}: the store was not closed properly and could not be recovered for reading: give write permission \
                         to it, or recover a copy\n  because {}",
                        display_path(&self.store),
                        Advice::on(&error).lines()
                    ))
                })?;
                Ok(OpenOptions::new().read_only(true).open(&self.store)?)
            }
            opened => Ok(opened?),
        }
    }

    /// Opens an existing store for writing.
    pub(super) fn open_to_write(&self) -> Result<Database, Failure> {
        Ok(OpenOptions::new().create(false).open(&self.store)?)
    }

    /// Opens the store for writing; creates it where there is none.
    pub(super) fn open_or_create(&self) -> Result<Database, Failure> {
        Ok(OpenOptions::new().open(&self.store)?)
    }

    /// Flushes the answer, prints an error, and returns the exit status. A reader that closed the pipe early (`| head`) is
    /// not a failure.
    pub(crate) fn finish(mut self, result: Result<Outcome, Failure>) -> u8 {
        let result = result.and_then(|outcome| self.out.flush().map(|()| outcome).map_err(Failure::from));
        match result {
            Ok(Outcome::Done) => 0,
            Ok(Outcome::Partly) => 1,
            Err(Failure::Usage(message)) => {
                eprintln!("hlacdb: {message}");
                2
            }
            Err(Failure::Failed(error)) if is_broken_pipe(error.as_ref()) => 0,
            // I/O errors of the library say what was being done; a bare one comes from writing the answer.
            Err(Failure::Failed(error)) if is_bare_io(error.as_ref()) => {
                eprintln!("hlacdb: the answer could not be written\n  because {error}");
                1
            }
            Err(Failure::Failed(error)) => {
                // The part of the answer that was printed before the error is kept.
                let _ = self.out.flush();
                eprintln!("hlacdb: {}", Advice::on(error.as_ref()).lines());
                1
            }
        }
    }
}

/// Whether the error is one of the operating system or the JSON encoder, from writing the answer.
fn is_bare_io(error: &(dyn Error + 'static)) -> bool {
    error.is::<io::Error>() || error.downcast_ref::<serde_json::Error>().is_some_and(serde_json::Error::is_io)
}

fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    let io_kind = |error: &(dyn Error + 'static)| error.downcast_ref::<io::Error>().map(io::Error::kind);
    let json_kind = |error: &(dyn Error + 'static)| error.downcast_ref::<serde_json::Error>()?.io_error_kind();
    io_kind(error).or_else(|| json_kind(error)) == Some(io::ErrorKind::BrokenPipe)
}
