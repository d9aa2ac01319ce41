//! Exact nearest neighbours of points.
//!
//! A *point* is a row of `f32` coordinates with an id. A *[`KnnQuery`]* asks for the `k` nearest points, for those within a
//! radius, or for both, among the points that a filter allows; a *[`Neighbour`]* is a hit. [`Points`] hold the rows. The
//! linear scan bounds every row; a *[`KdTree`]* finds few candidates. An *[`Index`]* is points with or without a tree, and
//! answers queries. A *[`SharedIndex`]* lets threads search while another adds and removes rows. A *[`DiskScan`]* answers
//! one query from a store that was just opened, reading few of its points.
//!
//! Results are exact: [`Metric::distance`](crate::space::Metric::distance) defines a distance to the bit, hits are ordered
//! by (distance, id), ties at rank `k` go to the lower id, and every [`IndexMethod`] returns the same ids with the same bits of
//! distance, whatever the tail, the tombstones, the filter, the number of threads and the CPU.
//!
//! The index knows neither disks nor descriptors. Of the rooms below it uses [`crate::space`], for the metric and for linear
//! algebra.

mod box_tree;
mod disk_scan;
mod error;
#[allow(clippy::module_inception)]
mod index;
mod kdtree;
mod linear;
mod lower_bound;
mod method;
mod multiversion;
mod neighbour;
mod pairs;
mod plan;
mod points;
mod projection;
mod query;
mod scalar_quantisation;
mod shared;
mod top_k;

pub use disk_scan::DiskScan;
pub use error::IndexError;
pub use index::{Index, should_rebuild};
pub use kdtree::KdTree;
pub use method::{IndexMethod, UnknownIndexMethod};
pub use neighbour::Neighbour;
pub use pairs::{Graph, Pair};
pub use plan::{Plan, plan};
pub use points::{CHUNK_ROWS, Points};
pub use query::{IdFilter, KnnQuery};
pub use scalar_quantisation::{NO_POINT, quantise};
pub use shared::{IndexState, SharedIndex};
