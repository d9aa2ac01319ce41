//! Spaces: from the moments of some views to a point, and what the distance between two points means.
//!
//! Vocabulary: a *feature set* ([`FeatureSet`]) says which numbers of a texture are looked at: its *features*. *Statistics*
//! ([`Statistics`]) are additive sums over textures, exact to the bit. A *definition* ([`Definition`]) says what a
//! space is to be; a *space* ([`Space`]) is one fitted on statistics, and turns features into *points*. A *prior*
//! ([`Prior`]) is what is known about textures before a store has any.
//!
//! | space | features | point | distance |
//! |---|---|---|---|
//! | `paper` | 251 moments of `full@1` | `moment * 255^cells`: the sums per window, the paper's histogram | L1 |
//! | `zscore` | 251 moments of `full@1` | `(x - mean) / sd`: the plain reading of the paper with normalised features | L2 |
//! | `oriented` | 251 degree roots of `stretch@1` | likeness, nuisance weight 0, 32 coordinates | L2 |
//! | `default` | 35 pooled roots of each of seven views | likeness, nuisance weight 0.5, 32 coordinates | L2 |
//! | `invariant` | the same 245 | likeness, nuisance weight 1, 32 coordinates | L2 |
//!
//! *Likeness* needs no label. With `z = (x - mean) / sd`, `T` the scatter of `z` over textures, `O` that of a
//! texture's own octants about their mean, `N` that of a texture and its copies under nuisances (brightness, contrast,
//! gamma, noise, turns), and `w` the nuisance weight:
//!
//! ```text
//! V  = eigenvectors of T / sqrt(eigenvalue), at most 128, eigenvalue > 1e-10 of the largest
//! Sw = V' O V + w V' N V = Q L Q', L ascending
//! point = z V Q[:, :P] / sqrt(L[:P] + 0.02), scaled to unit length
//! ```
//!
//! In words: directions that vary much between textures and little within one. Before the scaling to unit length the
//! coordinates are uncorrelated over `T` and ordered by falling variance, since their variances are `1 / (L + 0.02)`.
//!
//! Invariants: no feature, statistic or point is ever NaN or infinite; the same statistics give the same space, and the
//! same features the same point, to the bit, on every machine (no fused or reassociated arithmetic, no run-time choice
//! of instructions, square and cube roots of our own or exactly rounded ones).
//!
//! Imports [`crate::hlac`] and [`crate::volume`], and the metric that stands on the ground. When not to use it: to find neighbours, which is the index's work.

mod bytes;
mod definition;
mod error;
mod explain;
mod feature_set;
mod fit;
mod fitted;
#[cfg(test)]
mod fixtures;
pub(crate) mod linalg;
mod metric;
pub mod prior;
mod roots;
mod scatter;
mod statistics;

pub use definition::{Definition, MAX_DIMS, SpaceKind};
pub use error::SpaceError;
pub use explain::{Explanation, OrbitShare};
pub use feature_set::{Feature, FeatureForm, FeaturePart, FeatureSet, Features};
pub use fitted::{Drift, Space, SpaceAxis};
pub use metric::{Metric, UnknownMetric};
pub use prior::Prior;
pub use statistics::{Contribution, NuisanceStatistics, Statistics};
