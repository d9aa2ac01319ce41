//! The program as a user runs it: answers, JSON, exit status and errors.

mod errors;
mod numbers;
mod remedies;
mod textures;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;

use crate::support::{ball, stripes, write_npy};

/// An empty folder in which commands run.
struct Sandbox {
    folder: tempfile::TempDir,
}

impl Sandbox {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        let mut command = Command::cargo_bin("hlacdb").unwrap();
        command.current_dir(self.folder.path()).env_remove("HLACDB_STORE").args(arguments).output().unwrap()
    }

    /// The JSON document of a command that must succeed.
    fn json(&self, arguments: &[&str]) -> Value {
        let output = self.run(&[&["--json"], arguments].concat());
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    /// The error of a command that must exit with `status`.
    fn fails(&self, status: i32, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {}", stderr(&output));
        let error = stderr(&output);
        assert!(!error.contains("panicked") && !error.contains("RUST_BACKTRACE"), "{error}");
        error
    }

    /// A folder of eight small textures of two kinds.
    fn textures(&self) -> PathBuf {
        let folder = self.path("textures");
        fs::create_dir_all(folder.join("balls")).unwrap();
        for step in 1..=4 {
            write_npy(&folder.join(format!("stripes{step}.npy")), &stripes(16, step));
            write_npy(&folder.join(format!("balls/ball{step}.npy")), &ball(16, 2 + step));
        }
        folder
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}
