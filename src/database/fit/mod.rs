//! Fitting: when and how the spaces of a store are fitted on its statistics.

pub(crate) mod nuisance;
pub(crate) mod rebuild;
pub(crate) mod reindex;
pub(crate) mod spaces;
pub(crate) mod user_spaces;
