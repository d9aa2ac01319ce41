//! The program `hlacdb`: parses the command line, starts logging and threads, runs the command.

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
    log_panics();
    tracing::info!(kernel = kernel.name(), store = %arguments.store.display(), "hlacdb {}", env!("CARGO_PKG_VERSION"));
    start_threads();
    let mut context = Context::new(arguments.store.clone(), arguments.json, arguments.quiet);
    let result = arguments.run(&mut context);
    ExitCode::from(context.finish(result))
}

/// Logs panics. A panic of the storage engine on a damaged page is reported as damage in one sentence, so its own message is
/// for debugging only. Any other panic is a bug, logged with its backtrace.
fn log_panics() {
    std::panic::set_hook(Box::new(|panic| match hlacdb::panic_is_contained() {
        true => tracing::debug!("the storage engine {panic}"),
        false => {
            let backtrace = std::backtrace::Backtrace::force_capture();
            tracing::error!("internal error, please report it: {panic}\n{backtrace}");
        }
    }));
}

/// The environment variable that selects a kernel by name, instead of the fastest one that the CPU supports.
const KERNEL_VARIABLE: &str = "HLACDB_KERNEL";

/// The kernel that [`KERNEL_VARIABLE`] names, or the fastest one.
fn select_kernel() -> Result<Kernel, String> {
    let Some(name) = std::env::var_os(KERNEL_VARIABLE) else { return Ok(kernels::active()) };
    let selected = kernels::select(&name.to_string_lossy());
    selected.map_err(|error| format!("{KERNEL_VARIABLE}: {error}: unset the variable or name one of these kernels"))
}

/// Starts the worker threads. If the system refuses, the main thread does their work.
fn start_threads() {
    if let Err(error) = rayon::ThreadPoolBuilder::new().build_global() {
        tracing::warn!(%error, "the worker threads cannot be started: continuing with one thread");
        // This fails only if a pool exists already.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
    }
}

/// Logs to stderr. `HLACDB_LOG` (e.g. `hlacdb=debug`) overrides `-v` and `-q`.
fn start_log(verbose: u8, quiet: bool) {
    let level = match (quiet, verbose) {
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "info",
        (false, _) => "debug",
    };
    let filter = EnvFilter::try_from_env("HLACDB_LOG").unwrap_or_else(|_| EnvFilter::new(format!("hlacdb={level}")));
    let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).with_ansi(color).init();
}
