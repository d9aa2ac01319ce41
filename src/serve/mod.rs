//! The search interface: a page over an HTTP API, for people who want to see the textures and the ones alike.
//!
//! [`Server::bind`] takes a [`Database`](crate::Database) and [`Settings`]; [`Server::run`] serves until it is told to stop.
//! Nothing is decided here: every answer is one of the library's, every error its sentence, as problem+json (RFC 9457).
//!
//! Vocabulary: a *lane* bounds how much work of a kind is done at once; an *upload* is a volume that was asked with and is
//! in memory only; a *job* is long work that goes on beside the requests, and tells how far it is.
//!
//! Invariants: the database is only touched on threads that may block, never on those that speak to the network; no answer
//! names a path of the machine outside what is served; a request that changes something comes from the page itself, or
//! from a program, but not from another site's page in the same browser.

mod assets;
mod auth;
mod form;
#[cfg(feature = "fuzz")]
#[doc(hidden)]
#[allow(clippy::panic, reason = "the fuzzer is told by a panic")]
pub mod fuzz;
mod jobs;
mod limits;
mod listen;
mod metrics;
mod openapi;
mod problem;
mod reply;
mod routes;
mod settings;
mod state;
mod upload_cache;

pub use listen::{Server, Stopper};
pub use settings::{ServeError, Settings};
