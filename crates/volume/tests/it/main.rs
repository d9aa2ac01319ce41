//! The readers against files of other programs, and against hostile ones, in one test binary.

// A test states what it expects by unwrapping it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::single_range_in_vec_init)]

mod formats;
mod hostile;
mod parts;
mod pictures;
mod support;
