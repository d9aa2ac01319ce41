//! The loops that make exact sums, one file per instruction set.

pub mod scalar;
