//! What enters the build: every package by its licence and its source, against the lists of `deny.toml`. `cargo deny` reads
//! the same file and knows advisories too; this runs wherever the tests do.

use std::path::Path;
use std::process::Command;

/// Whether an SPDX expression leaves a choice that is allowed: parts joined by AND, each a choice joined by OR (or `/`, as
/// once was usual).
fn allows(allowed: &[&str], expression: &str) -> bool {
    expression.split(" AND ").all(|part| {
        let part = part.trim().trim_start_matches('(').trim_end_matches(')');
        part.replace(" OR ", "/").split('/').any(|choice| allowed.contains(&choice.trim()))
    })
}

#[test]
fn expressions_are_understood() {
    let allowed = ["MIT", "Unicode-3.0"];
    for (expression, expected) in [
        ("MIT", true),
        ("GPL-3.0-only", false),
        ("Apache-2.0 / MIT", true),
        ("(MIT OR Apache-2.0) AND Unicode-3.0", true),
        ("MIT AND BSD-3-Clause", false),
        ("Apache-2.0 WITH LLVM-exception", false),
    ] {
        assert_eq!(allows(&allowed, expression), expected, "{expression}");
    }
}

#[test]
fn every_package_has_an_allowed_licence_and_source() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let lists: toml::Table = std::fs::read_to_string(folder.join("deny.toml")).unwrap().parse().unwrap();
    let allowed: Vec<&str> =
        lists["licenses"]["allow"].as_array().unwrap().iter().filter_map(|name| name.as_str()).collect();
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let told = Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--locked", "--all-features"])
        .current_dir(folder)
        .output();
    let Some(told) = told.ok().filter(|told| told.status.success()) else {
        return hlacdb_testing::skip("cargo metadata fails here");
    };
    let told: serde_json::Value = serde_json::from_slice(&told.stdout).unwrap();
    let packages = told["packages"].as_array().unwrap();
    assert!(packages.len() > 100, "{} packages", packages.len());
    for package in packages {
        let (name, licence) = (&package["name"], package["license"].as_str().unwrap_or("none"));
        assert!(allows(&allowed, licence), "{name}: {licence} is not in deny.toml");
        // Our own package has no source; all others come from the one registry.
        let source = package["source"].as_str().unwrap_or("registry+ (our own)");
        assert!(source.starts_with("registry+"), "{name} comes from {source}");
    }
}
