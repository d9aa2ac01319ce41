//! Fitting spaces on everything in a store, and changing which spaces there are.

pub(crate) mod nuisance;
pub(crate) mod rebuild;
pub(crate) mod reindex;
pub(crate) mod user_spaces;
