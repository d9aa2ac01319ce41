//! What the tests of all packages share: seeds, and data that is not in the repository.
//!
//! Random tests draw the same numbers in every run. `HLACDB_SEED=N` draws others, and a test that fails shows the seed it
//! used. A test whose data are missing says so on stderr and is not run; `HLACDB_REQUIRE_DATA=1` makes it fail instead.

use std::io::Write;
use std::path::PathBuf;

use proptest::test_runner::{Config, RngSeed};

/// The seed where `HLACDB_SEED` gives none.
pub const DEFAULT_SEED: u64 = 251;

/// The seed of this run, from `HLACDB_SEED` or [`DEFAULT_SEED`]. It is printed, and the test runner shows what a test printed
/// if the test fails.
///
/// # Panics
/// If `HLACDB_SEED` is set to anything but a number.
pub fn seed() -> u64 {
    let seed = match std::env::var("HLACDB_SEED") {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("HLACDB_SEED must be a number (got {text})")),
        Err(_) => DEFAULT_SEED,
    };
    eprintln!("run again with HLACDB_SEED={seed}");
    seed
}

/// A configuration of proptest with this many cases, drawn by [`seed`].
pub fn cases(cases: u32) -> Config {
    Config { cases, rng_seed: RngSeed::Fixed(seed()), ..Config::default() }
}

/// A file of the folder of real volumes: `$HLACDB_DATA`, or `shared/data` beside the repository. `None` where it is missing,
/// which is reported by [`skip`].
///
/// # Panics
/// If it is missing and `HLACDB_REQUIRE_DATA=1`.
pub fn data(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("HLACDB_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")), PathBuf::from);
    let path = folder.join(name);
    if path.exists() {
        return Some(path);
    }
    skip(&format!("{name} is missing"));
    None
}

/// Reports on stderr that the test of this thread, or a part of it, is not run. The report also appears if the test passes.
///
/// # Panics
/// If `HLACDB_REQUIRE_DATA=1`.
pub fn skip(reason: &str) {
    let thread = std::thread::current();
    let test = thread.name().unwrap_or("a test");
    assert!(std::env::var_os("HLACDB_REQUIRE_DATA").is_none_or(|value| value != "1"), "{test} cannot run: {reason}");
    // Unlike `eprintln!`, this is not captured by the test runner.
    let _ = writeln!(std::io::stderr(), "skipped: {test}: {reason}");
}
