//! The server as programs and browsers see it: a real server on a free port of this machine.

mod changes;
mod large;
mod page;
mod queries;
mod reading;
mod security;
mod server;
