//! Spaces: maps from the moments of a texture to a point, such that the distance between points measures likeness.
//!
//! - A *descriptor* ([`Descriptor`]) holds the moments of a texture, by view.
//! - A *feature set* ([`FeatureSet`]) selects the numbers of a descriptor that a space uses, its *features*.
//! - *Statistics* ([`Statistics`]) are sums over the textures of a store; they are exact, additive and removable.
//! - A *definition* ([`Definition`]) names the feature set of a space and how features become points.
//! - A *space* ([`Space`]) is a definition fitted on statistics. It maps features to *points*.
//! - A *prior* holds statistics of textures in general, for stores with few textures.
//!
//! A store fits its spaces itself; what is public here is for reading them, and for defining new ones
//! ([`crate::Database::add_space`]).
//!
//! | space | features | point | distance |
//! |---|---|---|---|
//! | `paper` | 251 moments of `full@1` | the paper's histogram: the sums per window, `moment * 255^cells` | L1 |
//! | `zscore` | 251 moments of `full@1` | the paper's features normalised: `(x - mean) / sd` | L2 |
//! | `oriented` | 251 degree roots of `stretch@1` | likeness, nuisance weight 0, 32 dimensions | L2 |
//! | `default` | 35 pooled features of each of 7 views | likeness, nuisance weight 0.5, 32 dimensions | L2 |
//! | `invariant` | the same 245 | likeness, nuisance weight 1, 32 dimensions | L2 |
//!
//! A *likeness* space is fitted without labels. Let `z = (x - mean) / sd`; let `T` be the scatter of `z` over textures,
//! `O` that of the octants of a texture about their mean, `N` that of a texture and its copies under nuisances
//! (brightness, contrast, gamma, noise, turns), and `w` the nuisance weight. Then
//!
//! ```text
//! V  = eigenvectors of T / sqrt(eigenvalue), at most 128, eigenvalue > 1e-10 of the largest
//! Sw = V' O V + w V' N V = Q L Q', L ascending
//! point = z V Q[:, :P] / sqrt(L[:P] + 0.02), scaled to unit length
//! ```
//!
//! The axes are the directions that vary much between textures and little within one. Before points are scaled to unit
//! length, coordinates are uncorrelated over `T` and ordered by falling variance, `1 / (L + 0.02)`.
//!
//! Invariants: features, statistics and points are always finite. The same statistics give the same space, and the same
//! features the same point, to the bit, on every machine: arithmetic is neither fused nor reassociated, instructions
//! are not chosen at run time, and square and cube roots are correctly rounded or computed here.

mod codec;
pub(crate) mod contribution;
mod definition;
mod degree_roots;
mod descriptor;
mod error;
mod explain;
mod feature_set;
mod fit;
mod fitted;
#[cfg(test)]
mod fixtures;
pub(crate) mod linalg;
mod metric;
pub(crate) mod nuisance;
pub(crate) mod prior;
mod scatter;
mod statistics;

pub use definition::{Definition, MAX_DIMS, SpaceKind};
pub use descriptor::Descriptor;
pub use error::SpaceError;
pub use explain::{Explanation, OrbitShare};
pub use feature_set::{Feature, FeatureForm, FeaturePart, FeatureSet, Features};
pub use fitted::{Drift, Space, SpaceAxis};
pub use metric::{Metric, UnknownMetric};
pub use statistics::Statistics;

pub(crate) use contribution::Contribution;
pub(crate) use nuisance::NuisanceStatistics;
pub(crate) use prior::Prior;
