//! The program `hlacdb`: parse, log, dispatch, exit code.

mod cli;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::FromArgMatches;
use hlacdb::hlac::kernels::{self, Kernel};
use tracing_subscriber::EnvFilter;

use cli::{Cli, Context};

fn main() -> ExitCode {
    let kernel = match select_kernel() {
        Ok(kernel) => kernel,
        Err(error) => {
            eprintln!("hlacdb: {error}");
            return ExitCode::from(2);
        }
    };
    let version = format!("{} (kernel {})", env!("CARGO_PKG_VERSION"), kernel.name());
    let matches = cli::command().version(version).get_matches();
    let arguments = match Cli::from_arg_matches(&matches) {
        Ok(arguments) => arguments,
        Err(error) => error.exit(),
    };
    start_log(arguments.verbose, arguments.quiet);
    tell_damage_only();
    tracing::info!(kernel = kernel.name(), store = %arguments.store.display(), "hlacdb {}", env!("CARGO_PKG_VERSION"));
    start_threads();
    let mut context = Context::new(arguments.store.clone(), arguments.json, arguments.quiet);
    let result = arguments.run(&mut context);
    ExitCode::from(context.finish(result))
}

/// What the engine stumbles over in a damaged file is told as damage, in one sentence: its own words go to the log.
fn tell_damage_only() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| match hlacdb::store::panic_is_contained() {
        true => tracing::debug!("contained: {panic}"),
        false => usual(panic),
    }));
}

/// The environment variable that forces a kernel by its name, in place of the fastest that the CPU runs.
const KERNEL_VARIABLE: &str = "HLACDB_KERNEL";

/// The kernel that [`KERNEL_VARIABLE`] names, or else the fastest.
fn select_kernel() -> Result<Kernel, String> {
    let Some(name) = std::env::var_os(KERNEL_VARIABLE) else { return Ok(kernels::active()) };
    let selected = kernels::select(&name.to_string_lossy());
    selected.map_err(|error| format!("{KERNEL_VARIABLE}: {error}: unset the variable or name one of these kernels"))
}

/// Starts the worker threads; where the system grants none, the main thread does their work.
fn start_threads() {
    if let Err(error) = rayon::ThreadPoolBuilder::new().build_global() {
        tracing::warn!(%error, "no worker threads could be started: going on with one");
        // Should this fail too, the pool was there already.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    }
}

/// The log goes to stderr; `HLACDB_LOG` (e.g. `hlacdb=debug`) overrides `-v` and `-q`.
fn start_log(verbose: u8, quiet: bool) {
    let level = match (quiet, verbose) {
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "info",
        (false, _) => "debug",
    };
    let filter = EnvFilter::try_from_env("HLACDB_LOG").unwrap_or_else(|_| EnvFilter::new(format!("hlacdb={level}")));
    let colour = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).with_ansi(colour).init();
}
