//! Small dense linear algebra for every room: matrices, the symmetric eigenproblem, orthogonal iteration.
//!
//! The same input gives the same bits on every machine: each routine fixes its order of operations, and none chooses
//! instructions at run time. Linear-algebra crates do choose them, which is why none is used here. Loops run over
//! contiguous memory and are left to the compiler to vectorise.
//!
//! Two routines find eigenvectors. [`Eigen`] finds all of them, to about 1e-15 of the largest eigenvalue; the fit of a
//! space and the shipped prior use it. [`orthogonal_iteration`] approximates the leading few from products with a
//! matrix that need not be formed; the index, the map of a store and the statistics report use it.

mod eigen;
mod iteration;
mod matrix;

pub(crate) use eigen::Eigen;
pub(crate) use iteration::orthogonal_iteration;
pub(crate) use matrix::{Matrix, axpy, dot, dot_in_order};
