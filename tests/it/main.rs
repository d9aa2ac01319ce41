//! The one integration binary: what only the whole program, or real files, can show.

// A test says what it expects by unwrapping it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod api;
mod disk;
mod house;
mod index;
mod model;
mod own_spaces;
mod pages;
mod program;
mod real;
mod search;
#[cfg(feature = "serve")]
mod serve;
mod slabs;
mod source;
mod space;
mod store;
mod supply;
mod support;
mod synth;
mod tables;
mod trust;
