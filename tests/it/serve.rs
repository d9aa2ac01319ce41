//! The server as programs and pages see it: a real one, on a free port of this machine.

mod changes;
mod doors;
mod looking;
mod page;
mod place;
mod questions;
