//! The fitted spaces of a store.

use std::sync::LazyLock;

use super::statistics_cache;
use super::stored;
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::{Error, QueryError, chain};
use crate::space::{Prior, Space, Statistics};
use crate::store::{Reads, StoreError, Transaction};

/// The space of this name as it was fitted; before the first fit, as the prior alone determines it.
pub(crate) fn load(state: &impl Reads, name: &str) -> Result<Space, Error> {
    if let Some(bytes) = state.space(name)? {
        return Ok(Space::decode(&bytes)?);
    }
    let scheme = Scheme::of(state);
    match scheme.definition(name) {
        Some(definition) => {
            let statistics = statistics_cache::load(state, &definition.feature_set)?;
            Ok(Space::fit(definition, &statistics, None, prior())?)
        }
        None => Err(QueryError::NoSuchSpace { name: name.to_owned(), spaces: scheme.names() }.into()),
    }
}

/// As [`load`], for display only: a damaged space is replaced by what the prior alone determines, with a warning.
pub(crate) fn load_or_prior(state: &impl Reads, name: &str) -> Result<Space, Error> {
    match load(state, name) {
        Err(error) if error.is_damage() => {
            tracing::warn!("{}: reindexing fits the spaces again", chain(&error));
            let scheme = Scheme::of(state);
            let definition = scheme.definition(name).ok_or(error)?;
            Ok(Space::fit(definition, &Statistics::new(&definition.feature_set), None, prior())?)
        }
        loaded => loaded,
    }
}

/// The epoch of the last fit, and the number of textures it was made on; zeros before the first fit.
pub(crate) fn last_fit(state: &impl Reads) -> Result<(u64, u64), Error> {
    match state.space(DEFAULT_SPACE)? {
        Some(bytes) => {
            let space = Space::decode(&bytes)?;
            Ok((space.epoch(), space.textures_at_fit()))
        }
        None => Ok((0, 0)),
    }
}

/// The epoch of the next fit: one more than that of any space. Damaged spaces are passed over.
pub(crate) fn next_epoch(state: &impl Reads) -> Result<u64, Error> {
    let mut last = 0;
    for definition in Scheme::of(state).definitions() {
        match state.space(&definition.name) {
            Ok(Some(bytes)) => last = last.max(Space::decode(&bytes).map_or(0, |space| space.epoch())),
            Ok(None) => {}
            Err(StoreError::Damage(damage)) => tracing::warn!("{damage}: the space is fitted again"),
            Err(error) => return Err(error.into()),
        }
    }
    Ok(last + 1)
}

/// The shipped prior: what is known of textures before a store has any.
pub(crate) fn prior() -> &'static Prior {
    static PRIOR: LazyLock<Prior> = LazyLock::new(Prior::shipped);
    &PRIOR
}

/// Stores the points of the default space for all rows that have none yet.
pub(crate) fn store_points(transaction: &mut Transaction) -> Result<(), Error> {
    let space = load(transaction, DEFAULT_SPACE)?;
    stored::store_points(transaction, DEFAULT_SPACE, &space)
}
