//! Spaces are fitted on statistics and written.

use super::nuisance;
use crate::database::points::spaces::prior;
use crate::database::scheme::{DEFAULT_SPACE, Scheme};
use crate::error::Error;
use crate::space::{Definition, Space, Statistics};
use crate::store::Transaction;

/// Fits every space on these statistics and keeps it.
pub(crate) fn fit(transaction: &mut Transaction, statistics: &[Statistics], epoch: u64) -> Result<(), Error> {
    for definition in Scheme::of(transaction).definitions() {
        if let Some(statistics) = statistics.iter().find(|kept| *kept.feature_set() == definition.feature_set) {
            fit_one(transaction, definition, statistics, epoch)?;
        }
    }
    transaction.drop_points(DEFAULT_SPACE)?;
    Ok(())
}

/// Fits one space on the statistics of its features and keeps it.
pub(crate) fn fit_one(
    transaction: &mut Transaction,
    definition: &Definition,
    statistics: &Statistics,
    epoch: u64,
) -> Result<(), Error> {
    let learned = nuisance::load(transaction, &definition.feature_set)?;
    let space = Space::fit(definition, statistics, learned.as_ref(), prior())?.with_epoch(epoch);
    Ok(transaction.put_space(&definition.name, &space.encode())?)
}
