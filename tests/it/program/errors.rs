//! Wrong usage, wrong input, and answers that cannot be written.

use std::fs;
use std::process::Output;

use assert_cmd::Command;

use super::{Sandbox, stderr, text};

#[test]
fn errors_name_what_is_wrong() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    assert!(sandbox.fails(1, &["query", "--id", "1"]).contains("hlacdb ingest"));
    sandbox.json(&["ingest", text(&folder)]);
    assert!(sandbox.fails(1, &["query", "--id", "1", "-k", "0"]).contains("k must be >= 1"));
    assert!(sandbox.fails(1, &["query", "--id", "77"]).contains("77"));
    assert!(sandbox.fails(1, &["query", "--id", "1", "--within=-1"]).contains("-1"));
    assert!(sandbox.fails(1, &["query", "--id", "1", "--space", "hyper"]).contains("hyper"));
    assert!(sandbox.fails(1, &["query", "nowhere.npy"]).contains("nowhere.npy"));
    assert!(sandbox.fails(1, &["eval", "--label", "colour"]).contains("colour"));
    sandbox.fails(2, &["query"]);
    sandbox.fails(2, &["ingest"]);
    sandbox.fails(2, &["frobnicate"]);
    sandbox.fails(2, &["ingest", ".", "--intensity", "9..1"]);
    fs::write(sandbox.path("notes.hlacdb"), "dear diary, this is no store at all").unwrap();
    let error = sandbox.fails(1, &["-s", "notes.hlacdb", "list"]);
    assert!(error.contains("notes.hlacdb") && error.contains("not"), "{error}");
    assert_eq!(fs::read(sandbox.path("notes.hlacdb")).unwrap().len(), 35, "a file that is not a store is not changed");
}

#[test]
fn wrong_numbers_and_extensions_are_refused() {
    let sandbox = Sandbox::new();
    sandbox.json(&["ingest", text(&sandbox.textures())]);
    for arguments in
        [&["query", "--id", "1", "-k", "-1"][..], &["query", "--id", "-1"], &["show", "-3"], &["sheet", "1e3"]]
    {
        let error = sandbox.fails(2, arguments);
        assert!(error.contains("whole number of 0 or more") && !error.contains("tip:"), "{error}");
    }
    assert!(sandbox.fails(2, &["sheet", "1", "--out", "one.jpg"]).contains(".png"));
    assert!(sandbox.fails(2, &["query", "--id", "1", "--sheet", "one.jpg"]).contains(".png"));
    let volume = sandbox.path("textures/stripes1.npy");
    let sampled = ["extract", text(&volume), "--variant", "sampled"];
    assert!(sandbox.fails(1, &[&sampled[..], &["--windows", "2745"]].concat()).contains("2744"));
    assert_eq!(sandbox.json(&sampled)["files"][0]["windows"], 2744, "as many as there are, unless error");
}

#[test]
fn output_stays_on_its_line_and_tags_have_one_value() {
    let sandbox = Sandbox::new();
    let folder = sandbox.textures();
    sandbox.json(&["ingest", text(&folder), "--tag", "note=a\nb\u{1b}[31m"]);
    let listed = String::from_utf8(sandbox.run(&["list"]).stdout).unwrap();
    assert_eq!(listed.lines().count(), 9);
    assert!(listed.contains("note=a\\nb\\u{1b}[31m") && !listed.contains('\u{1b}'), "{listed}");
    assert_eq!(sandbox.json(&["list", "--where", "note=a\nb\u{1b}[31m"])["textures"].as_array().unwrap().len(), 8);
    assert!(sandbox.fails(2, &["tag", "1", "a=1", "a=2"]).contains("two values"));
    assert!(sandbox.fails(2, &["ingest", text(&folder), "--tag", "a=1", "--tag", "a=2"]).contains("two values"));
    assert!(sandbox.fails(2, &["--json", "completions", "bash"]).contains("--json"));
    let mut unset = Command::cargo_bin("hlacdb").unwrap();
    let output = unset.current_dir(sandbox.folder.path()).env("HLACDB_STORE", "").args(["show", "1"]).output().unwrap();
    assert!(output.status.success(), "an empty variable counts as unset: {}", stderr(&output));
}

#[cfg(target_os = "linux")]
#[test]
fn an_answer_that_cannot_be_written_is_a_failure() {
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("hlacdb"));
    let output = child.arg("masks").stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("the answer could not be written"), "{}", stderr(&output));
}

/// Runs a command whose answer is not read.
fn into_a_closed_pipe(arguments: &[&str]) -> Output {
    let mut child = std::process::Command::new(assert_cmd::cargo::cargo_bin("hlacdb"))
        .args(arguments)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    child.wait_with_output().unwrap()
}

#[test]
fn a_closed_pipe_is_not_a_failure() {
    let output = into_a_closed_pipe(&["masks"]);
    assert!(output.stderr.is_empty(), "{}", stderr(&output));
}

/// Regression: the generator of completion scripts panicked when its output was cut off.
#[test]
fn completions_into_a_closed_pipe_do_not_panic() {
    let output = into_a_closed_pipe(&["completions", "bash"]);
    assert!(!stderr(&output).contains("panicked"), "{}", stderr(&output));
    assert_ne!(output.status.code(), Some(101));
}

/// Regression: a command that failed left an empty store behind, and later queries found nothing in it.
#[test]
fn a_command_that_adds_nothing_creates_no_store() {
    let sandbox = Sandbox::new();
    assert!(sandbox.fails(1, &["ingest", "nowhere"]).contains("nowhere"));
    fs::write(sandbox.path("wrong.npy"), "not an array").unwrap();
    sandbox.fails(1, &["import", "wrong.npy"]);
    assert!(!sandbox.path("textures.hlacdb").exists());
}

/// Parsers of Python literals descend into nested brackets, and quote what they do not understand.
#[test]
fn hostile_arrays_give_one_short_line() {
    let sandbox = Sandbox::new();
    let header = "[".repeat(120_000);
    let length = (header.len() as u32).to_le_bytes();
    fs::write(sandbox.path("nested.npy"), [b"\x93NUMPY\x02\x00", &length[..], header.as_bytes()].concat()).unwrap();
    let header = format!("{{'descr': {}, 'fortran_order': False, 'shape': (3, 251), }}", "[".repeat(60_000));
    let length = (header.len() as u32).to_le_bytes();
    fs::write(sandbox.path("type.npy"), [b"\x93NUMPY\x02\x00", &length[..], header.as_bytes()].concat()).unwrap();
    sandbox.json(&["ingest", text(&sandbox.textures())]);
    for name in ["nested.npy", "type.npy"] {
        for arguments in [&["import", name][..], &["query", "--moments", name], &["query", name], &["extract", name]] {
            let error = sandbox.fails(1, arguments);
            assert!(error.contains(name) && error.len() < 1000, "{arguments:?}: {} bytes: {error}", error.len());
        }
    }
}
