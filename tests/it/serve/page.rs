//! Runs the tests of the page, which are written for node, in a real browser.

use std::path::Path;
use std::process::Command;

#[test]
#[ignore = "the tests of the page need Chromium and node: .ci/run installs them"]
fn the_page_works_in_a_real_browser() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/browser");
    let ended = Command::new("node")
        .args(["--test", "--test-concurrency=1"])
        .current_dir(folder)
        .env("HLACDB_BIN", assert_cmd::cargo::cargo_bin("hlacdb"))
        .status();
    assert!(ended.expect("node is installed").success(), "the tests of the page failed: see their output above");
}
