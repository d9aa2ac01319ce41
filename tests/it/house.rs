//! The structure of the source code: no circle of files, no import from a lower room to a higher one, no long file.
//!
//! Files are joined by what their code uses: an import, or a path such as `crate::a::b` or `super::b`, leads to the file that
//! defines the item, past every re-export. A re-export by itself joins nothing, so that a `mod.rs` may present its modules,
//! and they may use what it defines. Unit tests are left out.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

use proc_macro2::{TokenStream, TokenTree};

use crate::source::{Target, Workspace};

/// The rooms: the beginning of their files' names, and the rooms whose items they may use. The longest beginning counts.
#[rustfmt::skip]
const ROOMS: &[(&str, &str, &[&str])] = &[
    ("volume", "crates/volume/src/", &[]),
    ("hlac", "crates/hlac/src/", &[]),
    ("testing", "crates/testing/src/", &[]),
    ("base", "src/progress.rs", &[]),
    ("base", "src/isolated.rs", &[]),
    ("base", "src/tags.rs", &[]),
    ("base", "src/texture_id.rs", &[]),
    ("describe", "src/describe.rs", &["volume", "hlac"]),
    ("space", "src/space/", &["volume", "hlac"]),
    ("index", "src/index/", &["space", "base"]),
    ("migrations", "migrations/", &[]),
    ("store", "src/store/", &["volume", "hlac", "base"]),
    ("synth", "src/synth/", &["volume"]),
    ("error", "src/error/", &["volume", "hlac", "space", "index", "store", "synth", "migrations", "base"]),
    ("database", "src/database/", &["volume", "hlac", "describe", "space", "index", "store", "synth", "migrations", "base", "error"]),
    ("ingest", "src/ingest/", &["volume", "hlac", "store", "synth", "base", "error", "database"]),
    ("eval", "src/eval.rs", &["space", "base", "error", "database"]),
    ("render", "src/render/", &["volume", "hlac", "error", "database", "eval"]),
    ("cli", "src/cli/", &["*"]),
    ("cli", "src/main.rs", &["*"]),
    ("serve", "src/serve/", &["*"]),
    ("root", "src/lib.rs", &["*"]),
];

/// The rooms inside `src/database/`, as above. Files beside them (the handle, errors) may use any and be used by any: the
/// test of circles keeps them in order.
#[rustfmt::skip]
const DATABASE: &[(&str, &str, &[&str])] = &[
    ("texture", "src/database/texture.rs", &[]),
    ("scheme", "src/database/scheme.rs", &["texture"]),
    ("points", "src/database/points/", &["texture", "scheme"]),
    ("write", "src/database/write/", &["texture", "scheme", "points"]),
    ("fit", "src/database/fit/", &["texture", "scheme", "points"]),
    ("search", "src/database/search/", &["texture", "scheme", "points"]),
    ("inspect", "src/database/inspect/", &["texture", "scheme", "points", "search"]),
    ("maintain", "src/database/maintain/", &["texture", "scheme", "points", "write", "fit", "search", "inspect"]),
    ("exchange", "src/database/exchange/", &["texture", "scheme", "points", "write", "fit", "search", "inspect"]),
];

/// The most lines that a file may have.
const LINES: usize = 600;

/// The places with unsafe code: vector instructions of the kernels and of the index, and the rates of instructions that a
/// benchmark measures.
const UNSAFE: &[&str] = &["crates/hlac/src/kernel/", "src/index/multiversion.rs", "benches/extract.rs"];

/// Which file uses which other one, and by what names.
#[derive(Default)]
struct Uses {
    /// What the code of a file uses.
    code: BTreeMap<String, BTreeMap<String, BTreeSet<String>>>,
    /// The same with what a file re-exports.
    all: BTreeMap<String, BTreeMap<String, BTreeSet<String>>>,
}

impl Uses {
    fn of(workspace: &Workspace) -> Self {
        let mut uses = Self::default();
        for (id, module) in workspace.modules.iter().enumerate() {
            let imports = module.imports.iter().filter(|import| import.name.is_some());
            let imports = imports.map(|import| (&import.path, import.exported));
            for (path, is_export) in module.mentions.iter().map(|path| (path, false)).chain(imports) {
                for target in workspace.resolve(id, path) {
                    let Target::Item { module: other, name } = target else { continue };
                    let other = &workspace.modules[other].file;
                    if *other == module.file {
                        continue;
                    }
                    let add = |uses: &mut BTreeMap<String, BTreeMap<String, BTreeSet<String>>>| {
                        let from = uses.entry(module.file.clone()).or_default();
                        from.entry(other.clone()).or_default().insert(name.clone());
                    };
                    add(&mut uses.all);
                    if !is_export {
                        add(&mut uses.code);
                    }
                }
            }
        }
        uses
    }

    /// For every file that leads to itself its shortest circle, each circle once.
    fn circles(&self) -> Vec<Vec<&str>> {
        let mut circles = BTreeMap::new();
        for circle in self.code.keys().filter_map(|file| self.shortest_circle(file)) {
            let files: BTreeSet<&str> = circle.iter().copied().collect();
            circles.entry(files).or_insert(circle);
        }
        circles.into_values().collect()
    }

    /// All files that a file leads to, each with the one before it on a shortest way.
    fn reached<'a>(&'a self, start: &str) -> BTreeMap<&'a str, Option<&'a str>> {
        let mut before: BTreeMap<&str, Option<&str>> = BTreeMap::new();
        let mut queue: VecDeque<&str> =
            self.code.get_key_value(start).map(|(file, _)| file.as_str()).into_iter().collect();
        while let Some(file) = queue.pop_front() {
            for next in self.code.get(file).into_iter().flat_map(BTreeMap::keys) {
                if !before.contains_key(next.as_str()) {
                    before.insert(next, (file != start).then_some(file));
                    queue.push_back(next);
                }
            }
        }
        before
    }

    fn shortest_circle(&self, start: &str) -> Option<Vec<&str>> {
        let before = self.reached(start);
        let (start, _) = self.code.get_key_value(start)?;
        let mut circle = vec![start.as_str()];
        let mut step = *before.get(start.as_str())?;
        while let Some(file) = step {
            circle.push(file);
            step = before[file];
        }
        circle.push(start);
        circle.reverse();
        Some(circle)
    }

    fn names(&self, from: &str, to: &str) -> String {
        let names: Vec<&str> = self.all[from][to].iter().map(String::as_str).collect();
        names.join(", ")
    }

    /// Uses that the table of rooms does not allow.
    fn upward(&self, rooms: &[(&str, &str, &[&str])]) -> Vec<String> {
        let mut found = Vec::new();
        for (from, others) in &self.all {
            let Some((room, allowed)) = room(rooms, from) else { continue };
            for to in others.keys() {
                let Some((other, _)) = self::room(rooms, to) else { continue };
                if room != other && !allowed.contains(&other) && !allowed.contains(&"*") {
                    found.push(format!("{from} -> {to} ({room} may not use {other}): {}", self.names(from, to)));
                }
            }
        }
        found
    }
}

fn room<'a>(rooms: &[(&'a str, &str, &'a [&'a str])], file: &str) -> Option<(&'a str, &'a [&'a str])> {
    let rooms = rooms.iter().filter(|(_, beginning, _)| file.starts_with(beginning));
    rooms.max_by_key(|(_, beginning, _)| beginning.len()).map(|&(room, _, allowed)| (room, allowed))
}

fn report(what: &str, found: &[String]) {
    assert!(found.is_empty(), "{} {what}:\n{}", found.len(), found.join("\n"));
}

fn this_repository() -> (&'static Path, Workspace) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    (folder, Workspace::of_repository(folder))
}

#[test]
fn files_use_one_another_in_no_circle() {
    let (_, workspace) = this_repository();
    let uses = Uses::of(&workspace);
    let tell = |circle: &Vec<&str>| {
        let steps =
            circle.windows(2).map(|step| format!("\n    {} -> {}: {}", step[0], step[1], uses.names(step[0], step[1])));
        circle.join(" -> ") + &steps.collect::<String>()
    };
    report("circles of files", &uses.circles().iter().map(tell).collect::<Vec<_>>());
}

#[test]
fn lower_rooms_use_no_higher_ones() {
    let (_, workspace) = this_repository();
    let homeless: BTreeSet<&String> =
        workspace.modules.iter().map(|module| &module.file).filter(|file| room(ROOMS, file).is_none()).collect();
    assert!(homeless.is_empty(), "files without a room in tests/it/house.rs: {homeless:?}");
    let uses = Uses::of(&workspace);
    report("uses of a higher room", &[uses.upward(ROOMS), uses.upward(DATABASE)].concat());
}

/// Every file that a person reads as code.
fn code_files(folder: &Path) -> Vec<(String, String)> {
    let is_hidden = |name: &str| name.starts_with('.') && name != ".ci";
    let walk = walkdir::WalkDir::new(folder).sort_by_file_name().into_iter().filter_entry(|entry| {
        let name = entry.file_name().to_string_lossy();
        entry.depth() == 0 || !(is_hidden(&name) || ["target", "node_modules"].contains(&&*name))
    });
    let files = walk.map(Result::unwrap).filter(|entry| entry.file_type().is_file());
    let named = files.filter_map(|entry| {
        let file = entry.path().strip_prefix(folder).unwrap().to_str()?.replace('\\', "/");
        let extension = file.rsplit_once('.').map_or("", |(_, extension)| extension);
        let is_code = ["rs", "js", "mjs", "css", "html", "py", "sh"].contains(&extension) || file == ".ci/run";
        is_code.then(|| (file, std::fs::read_to_string(entry.path()).unwrap()))
    });
    named.collect()
}

#[test]
fn no_file_is_longer_than_600_lines() {
    let (folder, _) = this_repository();
    let files = code_files(folder);
    assert!(files.len() > 200, "{} files", files.len());
    let lengths = files.iter().map(|(file, text)| (file, text.lines().count()));
    let long = lengths.filter(|(_, lines)| *lines > LINES).map(|(file, lines)| format!("{file}: {lines} lines"));
    report("long files", &long.collect::<Vec<_>>());
}

/// Whether code contains the keyword `unsafe`, in macros as well; comments and strings do not count.
fn has_unsafe(code: TokenStream) -> bool {
    code.into_iter().any(|token| match token {
        TokenTree::Ident(name) => name == "unsafe",
        TokenTree::Group(group) => has_unsafe(group.stream()),
        TokenTree::Punct(_) | TokenTree::Literal(_) => false,
    })
}

#[test]
fn unsafe_code_is_only_in_the_places_listed() {
    let (folder, _) = this_repository();
    let mut unused = UNSAFE.to_vec();
    let mut found = Vec::new();
    for (file, text) in code_files(folder).into_iter().filter(|(file, _)| file.ends_with(".rs")) {
        let code: TokenStream = text.parse().unwrap_or_else(|error| panic!("{file}: {error}"));
        if has_unsafe(code) {
            match UNSAFE.iter().find(|place| file.starts_with(**place)) {
                Some(place) => unused.retain(|other| other != place),
                None => found.push(file),
            }
        }
    }
    report("files with unsafe code", &found);
    assert!(unused.is_empty(), "places without unsafe code: {unused:?}");
}

mod tests {
    use super::*;

    #[test]
    fn unsafe_code_is_found_also_in_macros_but_not_in_text() {
        let has_unsafe = |code: &str| has_unsafe(code.parse().unwrap());
        assert!(has_unsafe("fn f() { if true { unsafe { g() } } }"));
        assert!(has_unsafe("macro_rules! m { () => { unsafe fn f() {} } }"));
        assert!(has_unsafe("#[unsafe(no_mangle)] fn f() {}"));
        assert!(!has_unsafe("#![deny(unsafe_code)] /* unsafe */ fn f() -> &'static str { \"unsafe\" } // unsafe"));
    }

    const CRATES: &[(&str, &str)] = &[("low", "low/lib.rs"), ("high", "src/lib.rs")];

    fn circles(files: &[(&str, &str)]) -> Vec<String> {
        let low = [("low/lib.rs", "pub mod inner;"), ("low/inner.rs", "pub struct Low;")];
        let uses = Uses::of(&Workspace::of_texts(CRATES, &[&low, files].concat()));
        uses.circles().iter().map(|circle| circle.join(" -> ")).collect()
    }

    #[test]
    fn a_circle_is_found_however_it_is_written() {
        for (a, b) in [
            ("use crate::b::B; pub struct A;", "use crate::a::A; pub struct B;"),
            ("use super::b::{self, B as Other}; pub struct A;", "pub struct B; fn f() -> crate::a::A { crate::a::A }"),
            ("use crate::{b::{B}}; pub struct A;", "pub struct B; fn f() { use super::a::A as _; }"),
            ("use crate::b::*; pub struct A(B);", "use crate::a; pub struct B; impl From<a::A> for B {}"),
            ("use crate::B; pub struct A;", "use crate::*; pub struct B; fn f(_: A) {}"),
            ("use crate::b::B; pub struct A;", "pub struct B; fn f() { print!(\"{}\", crate::a::A) }"),
            ("use crate::b::B; pub struct A;", "pub struct B; macro_rules! m { () => { $crate::a::A } }"),
            ("use crate::b::Kind::*; pub enum A { X } fn f() { One }", "use super::a::A::X; pub enum Kind { One }"),
        ] {
            let root = "mod a; mod b; pub use a::A; pub use b::*;";
            let found = circles(&[("src/lib.rs", root), ("src/a.rs", a), ("src/b.rs", b)]);
            let expected = ["src/a.rs -> src/b.rs -> src/a.rs"];
            assert_eq!(found, expected, "{a} | {b}");
        }
    }

    #[test]
    fn re_exports_and_tests_make_no_circle() {
        let child = "use super::Shared; pub struct Child(Shared);
            #[cfg(test)] use crate::Other; #[cfg(test)] mod tests { use crate::other::Other; }";
        let files = [
            ("src/lib.rs", "mod parent; pub mod other; pub use other::Other; use parent::Child;"),
            ("src/parent/mod.rs", "mod child; pub use child::Child; pub struct Shared;"),
            ("src/parent/child.rs", child),
            ("src/other.rs", "use crate::parent::Child; use low::inner::Low; pub struct Other(Child, Low);"),
        ];
        assert_eq!(circles(&files), [""; 0]);
    }

    #[test]
    fn a_parent_that_uses_what_it_presents_is_in_a_circle() {
        let files = [
            ("src/lib.rs", "mod parent;"),
            ("src/parent/mod.rs", "mod child; pub use child::Child; pub struct Shared(Option<Box<Child>>);"),
            ("src/parent/child.rs", "use super::Shared; pub struct Child(Shared);"),
        ];
        assert_eq!(circles(&files), ["src/parent/child.rs -> src/parent/mod.rs -> src/parent/child.rs"]);
    }

    #[test]
    fn the_shortest_circle_of_each_file_is_found() {
        let files = [
            ("src/lib.rs", "mod a; mod b; mod c; #[path = \"../else/d.rs\"] mod d;"),
            ("src/a.rs", "pub fn a() { crate::b::b() }"),
            ("src/b.rs", "pub fn b() { crate::c::c(); super::d::d() }"),
            ("src/c.rs", "pub fn c() { super::a::a() }"),
            ("else/d.rs", "pub fn d() { self::inside::e() } mod inside { pub fn e() { super::super::b::b() } }"),
        ];
        let expected = ["else/d.rs -> src/b.rs -> else/d.rs", "src/a.rs -> src/b.rs -> src/c.rs -> src/a.rs"];
        assert_eq!(circles(&files), expected);
    }

    #[test]
    fn a_use_of_a_higher_room_is_found_also_in_a_re_export() {
        let files = [
            ("low/lib.rs", "pub mod inner;"),
            ("low/inner.rs", "pub struct Low;"),
            ("src/lib.rs", "pub mod a; pub mod b; pub use low as deep;"),
            ("src/a.rs", "pub use crate::b::B;"),
            ("src/b.rs", "use crate::deep::inner::Low; pub struct B(Low);"),
        ];
        let uses = Uses::of(&Workspace::of_texts(CRATES, &files));
        let rooms: &[(&str, &str, &[&str])] =
            &[("low", "low/", &[]), ("a", "src/a", &["low"]), ("b", "src/b", &["low"])];
        assert_eq!(uses.upward(rooms), ["src/a.rs -> src/b.rs (a may not use b): B"]);
        let rooms: &[(&str, &str, &[&str])] = &[("low", "low/", &[]), ("b", "src/b", &["a"])];
        assert_eq!(uses.upward(rooms), ["src/b.rs -> low/inner.rs (b may not use low): Low"]);
    }
}
