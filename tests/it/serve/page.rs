//! The page in a real browser: written for node, and begun from here.

use std::path::Path;
use std::process::Command;

#[test]
#[ignore = "the page's tests need Chromium and node: .ci/run installs what is missing and runs them"]
fn the_page_works_in_a_real_browser() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser");
    let ended = Command::new("node")
        .args(["--test", "--test-concurrency=1"])
        .current_dir(folder)
        .env("HLACDB_BIN", assert_cmd::cargo::cargo_bin("hlacdb"))
        .status();
    assert!(ended.expect("node is installed").success(), "the page's tests failed: their words are above");
}
