//! The one integration binary of the crate: kernels against each other, and sums against an independent implementation.

// A test states what it expects by unwrapping it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod kernels;
mod options;
mod reference_sums;
mod slabs;
mod support;
mod views;
