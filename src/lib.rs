//! hlacdb: an embedded database that finds solid textures that look alike.

pub mod hlac;
#[path = "../migrations/mod.rs"]
pub mod migrations;
pub mod store;
pub mod volume;
