//! From points to neighbours, exactly.
//!
//! Vocabulary: a *point* is a row of `f32` coordinates with an id; a *[`KnnQuery`]* asks for the `k` nearest points, or
//! those within a radius, or both, among those that a filter allows; a *[`Neighbour`]* is a hit. [`Points`] hold the
//! rows; the scan (`linear`) reads all of them; a *[`KdTree`]* proposes few. An *[`Index`]* is points with or without a
//! tree and is what one asks; a *[`SharedIndex`]* lets threads ask while one adds and removes; a *[`DiskScan`]* answers
//! one question from a store that was just opened, reading codes of all points and few points.
//!
//! Exact means exact: [`Metric::distance`] defines a distance to the bit, hits are ordered by (distance, id), ties at
//! rank `k` go to the lower id, and every [`Method`] returns the same ids with the same bits, whatever the tail, the
//! tombstones, the filter, the number of threads and the CPU.
//!
//! This room stands on the ground: it knows no disk, no descriptors and no spaces.

mod box_tree;
mod disk_scan;
mod error;
#[allow(clippy::module_inception)]
mod index;
mod kdtree;
mod linear;
mod lower_bound;
mod multiversion;
mod neighbour;
mod pairs;
mod points;
mod projection;
mod query;
mod scalar_quantisation;
mod shared;

pub use disk_scan::DiskScan;
pub use error::IndexError;
pub use index::{Index, Method, UnknownMethod, should_rebuild};
pub use kdtree::KdTree;
pub use neighbour::Neighbour;
pub use pairs::{Graph, Pair};
pub use points::{CHUNK_ROWS, Points};
pub use query::{IdFilter, KnnQuery};
pub use scalar_quantisation::{NO_POINT, quantise};
pub use shared::{IndexState, SharedIndex};
