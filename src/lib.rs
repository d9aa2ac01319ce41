//! hlacdb: an embedded database that finds solid textures that look alike.

pub mod hlac;
pub mod index;
pub mod store;
pub mod synth;
pub mod volume;
