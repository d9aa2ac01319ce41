//! The search interface: a web page over an HTTP API.
//!
//! [`Server::bind`] takes a [`Database`](crate::Database) and [`ServerOptions`]; [`Server::run`] serves until it is stopped.
//! The server holds no logic of its own: every response comes from the library, and every error becomes problem+json
//! (RFC 9457).
//!
//! An *upload* is a volume that was sent with a query; it is kept in memory only. A *job* is long work that runs beside the
//! requests and reports its progress.
//!
//! Invariants: the database is used only on threads that may block, never on those that serve the network. No response names
//! a path of this machine, except paths relative to the folder to ingest from and to that of the store. A request that
//! changes something comes from this server's page or from a program, never from another site's page in the same browser.

mod assets;
mod auth;
mod form;
#[cfg(feature = "fuzz")]
#[doc(hidden)]
#[allow(clippy::panic, reason = "a panic is what a fuzz target reports")]
pub mod fuzz;
mod jobs;
mod limits;
mod listen;
mod metrics;
mod middleware;
mod openapi;
mod options;
mod parameters;
mod paths;
mod problem;
mod reply;
mod routes;
mod state;
mod status;
mod tokens;
mod upload_cache;
mod volume_source;

pub use listen::{Server, Stopper};
pub use options::{ServeError, ServerOptions};
