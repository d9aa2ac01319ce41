//! The public API of the library packages, as text in `docs/api/`: every change of it shows in review.
//!
//! `HLACDB_UPDATE=1 cargo test --test it api` writes the texts anew. They are made from the source code alone, with all
//! features: public items by the path that a user writes, each once, with public fields, variants, public methods and
//! implemented traits. What a macro makes is not seen; the text names the macros that are called beside public items.

mod listing;
mod tokens;

use std::collections::BTreeSet;
use std::path::Path;

use crate::source::Workspace;
use listing::Listing;

/// The library packages, by the name of their crate and of their text.
const PACKAGES: [(&str, &str); 3] = [("hlacdb", "hlacdb"), ("hlac", "hlac"), ("hlacdb_volume", "hlacdb-volume")];

/// The crates whose items a public signature may name, beside our own.
const ALLOWED: [&str; 4] = ["std", "core", "alloc", "serde"];

const COMMAND: &str = "HLACDB_UPDATE=1 cargo test --test it api";

#[test]
fn the_public_api_is_the_one_that_was_reviewed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let workspace = Workspace::of_repository(folder);
    let update = std::env::var_os("HLACDB_UPDATE").is_some_and(|value| value == "1");
    let mut changed = Vec::new();
    for (name, file) in PACKAGES {
        let listing = Listing::of(&workspace, name);
        let text = format!("The public API of {file}, made by `{COMMAND}`.\n\n{}", listing.text());
        assert!(text.lines().count() > 40, "{text}");
        let path = folder.join(format!("docs/api/{file}.txt"));
        let reviewed = std::fs::read_to_string(&path).unwrap_or_default();
        if text == reviewed {
            continue;
        }
        if update {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, &text).unwrap();
        }
        let (old, new): (BTreeSet<&str>, BTreeSet<&str>) = (reviewed.lines().collect(), text.lines().collect());
        changed.push(format!("docs/api/{file}.txt"));
        changed.extend(old.difference(&new).map(|line| format!("  - {}", line.trim_start())));
        changed.extend(new.difference(&old).map(|line| format!("  + {}", line.trim_start())));
    }
    assert!(
        changed.is_empty() || update,
        "the public API has changed:\n{}\nif so intended: {COMMAND}",
        changed.join("\n")
    );
}

#[test]
fn no_public_signature_names_a_foreign_type() {
    let workspace = Workspace::of_repository(Path::new(env!("CARGO_MANIFEST_DIR")));
    let found: Vec<String> =
        PACKAGES.iter().flat_map(|(name, _)| Listing::of(&workspace, name).foreign(&ALLOWED)).collect();
    assert!(found.is_empty(), "{} public signatures name foreign types:\n{}", found.len(), found.join("\n"));
}

const SAMPLE: &str = r#"
    mod inner;
    pub mod outer { pub use crate::inner::Deep as Shown; #[doc(hidden)] pub struct Hidden; }
    pub use inner::{Thing, public};
    pub use redb::Key;
    #[derive(Clone, Debug)] #[non_exhaustive]
    pub enum Choice<T: ?Sized> { One, Two(Box<T>, u8), Three { at: [usize; 3] } }
    impl<'a, T> From<&'a T> for Choice<T> where T: Clone { fn from(_: &'a T) -> Self { Self::One } }
    pub trait Named: Send { const LENGTH: usize; type Out; fn name(&self) -> Self::Out; fn twice(&self) -> u8 { 2 } }
    impl Named for u8 {}
    #[cfg(feature = "extra")] pub const COUNT: usize = 3;
    #[cfg(test)] pub struct OnlyForTests;
    pub(crate) struct Private;
    pub static ALL: &[&str] = &["a"];
    pub type Pair<T = u8> = (T, T);
"#;

const INNER: &str = r#"
    use std::path::Path; use redb::{Error as Failure, Database};
    pub struct Thing { pub size: u64, secret: Database }
    impl Thing {
        pub fn open(mut path: impl AsRef<Path>, change: &mut dyn FnMut(u64) -> bool) -> Result<Self, Failure> { todo!() }
        pub const fn size(&self) -> Option<&'static [u64]> { None }
        fn private(&self) -> Database { todo!() }
        #[doc(hidden)] pub fn internal(&self) -> Database { todo!() }
    }
    pub struct Deep<const N: usize>(pub [f32; N], u8);
    impl<const N: usize> std::fmt::Display for Deep<N> {}
    pub fn public() -> Thing { todo!() }
    pub fn not_exported() -> Database { todo!() }
"#;

/// Everything that a listing must show, and nothing else.
#[test]
fn a_listing_shows_what_users_can_reach() {
    let workspace = Workspace::of_texts(&[("sample", "lib.rs")], &[("lib.rs", SAMPLE), ("inner.rs", INNER)]);
    let listing = Listing::of(&workspace, "sample");
    let expected = r#"sample
    pub static ALL: &[&str]
    #[cfg(feature = "extra")] pub const COUNT: usize = 3
    #[non_exhaustive] pub enum Choice<T: ?Sized>
        One
        Two(Box<T>, u8)
        Three { at: [usize; 3] }
        derive Clone, Debug
        impl<'a, T> From<&'a T> for Choice<T> where T: Clone
    pub use redb::Key
    pub trait Named: Send
        const LENGTH: usize
        fn name(&self) -> Self::Out
        fn twice(&self) -> u8 { .. }
        impl Named for u8
        type Out
    pub type Pair<T = u8> = (T, T)
    pub struct Thing
        pub size: u64
        private fields
        pub const fn size(&self) -> Option<&'static [u64]>
        pub fn open(path: impl AsRef<Path>, change: &mut dyn FnMut(u64) -> bool) -> Result<Self, Failure>
    pub mod outer
    pub fn public() -> Thing

sample::outer
    pub struct Shown<const N: usize>
        pub 0: [f32; N]
        private fields
        impl<const N: usize> std::fmt::Display for Deep<N>
"#;
    assert_eq!(listing.text(), expected);
    let expected = ["sample::Key: redb::Key", "sample::Thing: redb::Error"];
    assert_eq!(listing.foreign(&["std"]), expected);
}
