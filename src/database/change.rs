//! Changes: every one a transaction, statistics and points included.

use super::handle::Database;
use super::locks::held;
use super::points::spaces::keep_points;
use super::points::statistics_cache::StatisticsCache;
use crate::error::Error;
use crate::isolated::isolated;
use crate::store::{Reads, Transaction};

impl Database {
    /// One transaction, with the statistics_cache kept and the new points written; an error leaves everything as it was.
    pub(crate) fn change<T: Send>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut StatisticsCache) -> Result<T, Error> + Send,
    ) -> Result<T, Error> {
        self.change_if(|transaction, statistics_cache| Ok((act(transaction, statistics_cache)?, true)))
    }

    /// As [`Database::change`], and statistics that are not whole do not stop it: `act` is told whether they are, and builds
    /// them anew.
    pub(crate) fn change_mending<T: Send>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut StatisticsCache, bool) -> Result<T, Error> + Send,
    ) -> Result<T, Error> {
        self.change_with(true, |transaction, statistics_cache, whole| {
            Ok((act(transaction, statistics_cache, whole)?, true))
        })
    }

    /// A change that touches no numbers: statistics and points are neither read nor written.
    pub(crate) fn change_records<T>(&self, act: impl FnOnce(&mut Transaction) -> Result<T, Error>) -> Result<T, Error> {
        let mut statistics_cache = held(self.statistics.lock());
        let mut transaction = self.store().write()?;
        let before = transaction.revision();
        let value = act(&mut transaction)?;
        let revision = transaction.commit()?;
        statistics_cache.follow(before, revision);
        Ok(value)
    }

    /// As [`Database::change`]; nothing is written where `act` says that nothing changed.
    pub(crate) fn change_if<T: Send>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut StatisticsCache) -> Result<(T, bool), Error> + Send,
    ) -> Result<T, Error> {
        self.change_with(false, |transaction, statistics_cache, _| act(transaction, statistics_cache))
    }

    fn change_with<T: Send>(
        &self,
        mending: bool,
        act: impl FnOnce(&mut Transaction, &mut StatisticsCache, bool) -> Result<(T, bool), Error> + Send,
    ) -> Result<T, Error> {
        let mut statistics_cache = held(self.statistics.lock());
        let mut transaction = self.store().write()?;
        let opened = match statistics_cache.open(&transaction) {
            Err(error) if mending && error.is_damage() => {
                tracing::warn!("{}: the statistics are built anew", crate::error::chain(&error));
                Ok(false)
            }
            opened => opened.map(|()| true),
        };
        let cache: &mut StatisticsCache = &mut statistics_cache;
        let done = opened.and_then(|whole| {
            isolated(|| {
                let (value, changed) = act(&mut transaction, cache, whole)?;
                if changed {
                    cache.save(&mut transaction)?;
                    keep_points(&mut transaction)?;
                    let revision = transaction.commit()?;
                    cache.close(revision);
                }
                Ok(value)
            })
        });
        if done.is_err() {
            // What was counted in memory is no longer what is on disk.
            *statistics_cache = StatisticsCache::default();
        }
        done
    }
}
