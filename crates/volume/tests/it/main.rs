//! The readers against files of other programs, and against hostile ones, in one test binary.

mod formats;
mod hostile;
mod parts;
mod pictures;
mod support;
