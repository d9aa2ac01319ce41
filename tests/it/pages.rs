//! The pages of prose: what they name exists.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use proc_macro2::{TokenStream, TokenTree};
use syn::Item;

use crate::source::Workspace;

/// The texts between two marks that stand on one line.
fn between<'a>(text: &'a str, open: &'a str, close: char) -> impl Iterator<Item = &'a str> {
    text.lines().flat_map(move |line| line.split(open).skip(1).filter_map(move |rest| Some(rest.split_once(close)?.0)))
}

/// Whether a macro such as `proptest!` contains the function `name`.
fn defines(tokens: TokenStream, name: &str) -> bool {
    let mut after_fn = false;
    tokens.into_iter().any(|token| match token {
        TokenTree::Ident(ident) => std::mem::replace(&mut after_fn, ident == "fn") && ident == name,
        TokenTree::Group(group) => defines(group.stream(), name),
        _ => false,
    })
}

#[test]
fn every_named_test_exists() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let pages =
        ["docs/guarantees.md", "fuzz/README.md"].map(|page| std::fs::read_to_string(folder.join(page)).unwrap());
    let is_name = |code: &&str| code.contains("::") && !code.contains([' ', '(']);
    let named: Vec<&str> = pages.iter().flat_map(|page| page.split('`').skip(1).step_by(2)).filter(is_name).collect();
    assert!(named.len() > 20, "{named:?}");
    // A name such as `hlac/kernels::...` is a test of the package in crates/hlac.
    let package = |path: &&str| path.split_once('/').map_or("", |(package, _)| package).to_owned();
    let packages: BTreeSet<String> = named.iter().map(package).collect();
    let tests = packages.into_iter().map(|package| {
        let file =
            if package.is_empty() { "tests/it/main.rs".into() } else { format!("crates/{package}/tests/it/main.rs") };
        (package, Workspace::of_file(folder, "it", &file))
    });
    let tests: BTreeMap<String, Workspace> = tests.collect();
    let is_test = |path: &str| {
        let (module, name) = path.rsplit_once("::").unwrap();
        let module = format!("it::{}", module.split_once('/').map_or(module, |(_, module)| module));
        let module = tests[&package(&path)].modules.iter().find(|known| known.path == module);
        module.is_some_and(|module| {
            module.items.iter().any(|item| match item {
                Item::Fn(item) => {
                    item.sig.ident == name && item.attrs.iter().any(|attribute| attribute.path().is_ident("test"))
                }
                Item::Macro(item) => defines(item.mac.tokens.clone(), name),
                _ => false,
            })
        })
    };
    let missing: Vec<&&str> = named.iter().filter(|path| !is_test(path)).collect();
    assert!(missing.is_empty(), "pages name tests that do not exist: {missing:#?}");
}

#[test]
fn every_link_leads_to_a_file() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut pages = Vec::new();
    for inside in ["", "docs", "datasets", "fuzz", "crates/hlac", "crates/volume"] {
        let files = std::fs::read_dir(folder.join(inside)).unwrap().map(|entry| entry.unwrap().path());
        pages.extend(files.filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    }
    assert!(pages.len() >= 8, "{pages:?}");
    let mut broken = Vec::new();
    for page in &pages {
        let text = std::fs::read_to_string(page).unwrap();
        let links = between(&text, "](", ')').filter(|link| !link.contains("://"));
        let files = links.map(|link| link.split('#').next().unwrap()).filter(|file| !file.is_empty());
        let missing = files.filter(|file| !page.with_file_name(file).exists());
        broken.extend(missing.map(|file| format!("{}: {file}", page.display())));
    }
    assert!(broken.is_empty(), "broken links: {broken:#?}");
}
