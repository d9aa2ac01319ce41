//! hlacdb: an embedded database that finds solid textures that look alike.

pub mod hlac;
pub mod space;
pub mod synth;
pub mod volume;
