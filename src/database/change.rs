//! Changes of the store: each is one transaction, in which statistics and points are kept up to date.

use super::handle::Database;
use super::locks::held;
use super::points::spaces::store_points;
use super::points::statistics_cache::StatisticsCache;
use crate::error::{Error, chain};
use crate::isolated::isolated;
use crate::store::{Reads, Transaction};

impl Database {
    /// Makes a change in one transaction, in which the statistics are saved and the points of new textures are stored. After
    /// an error the store is as it was.
    pub(crate) fn change<T: Send>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut StatisticsCache) -> Result<T, Error> + Send,
    ) -> Result<T, Error> {
        self.change_if(|transaction, statistics| Ok((act(transaction, statistics)?, true)))
    }

    /// As [`Database::change`], but damaged statistics do not prevent it: `act` gets `false` and rebuilds them.
    pub(crate) fn change_despite_damage<T: Send>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut StatisticsCache, bool) -> Result<T, Error> + Send,
    ) -> Result<T, Error> {
        self.change_with(true, |transaction, statistics, intact| Ok((act(transaction, statistics, intact)?, true)))
    }

    /// A change of records only: statistics and points are neither read nor written.
    pub(crate) fn change_records<T>(&self, act: impl FnOnce(&mut Transaction) -> Result<T, Error>) -> Result<T, Error> {
        let mut statistics = held(self.statistics.lock());
        let mut transaction = self.store().write()?;
        let before = transaction.revision();
        let value = act(&mut transaction)?;
        let revision = transaction.commit()?;
        statistics.advance(before, revision);
        Ok(value)
    }

    /// As [`Database::change`]. Nothing is written if `act` returns `false`: nothing changed.
    pub(crate) fn change_if<T: Send>(
        &self,
        act: impl FnOnce(&mut Transaction, &mut StatisticsCache) -> Result<(T, bool), Error> + Send,
    ) -> Result<T, Error> {
        self.change_with(false, |transaction, statistics, _| act(transaction, statistics))
    }

    fn change_with<T: Send>(
        &self,
        despite_damage: bool,
        act: impl FnOnce(&mut Transaction, &mut StatisticsCache, bool) -> Result<(T, bool), Error> + Send,
    ) -> Result<T, Error> {
        let mut guard = held(self.statistics.lock());
        let statistics: &mut StatisticsCache = &mut guard;
        let mut transaction = self.store().write()?;
        let loaded = match statistics.load_for(&transaction) {
            Err(error) if despite_damage && error.is_damage() => {
                tracing::warn!("{}: the statistics are rebuilt", chain(&error));
                Ok(false)
            }
            loaded => loaded.map(|()| true),
        };
        let done = loaded.and_then(|intact| {
            isolated(|| {
                let (value, changed) = act(&mut transaction, statistics, intact)?;
                if changed {
                    statistics.save(&mut transaction)?;
                    store_points(&mut transaction)?;
                    statistics.saved_as(transaction.commit()?);
                }
                Ok(value)
            })
        });
        if done.is_err() {
            // The statistics in memory no longer match those in the store.
            *guard = StatisticsCache::default();
        }
        done
    }
}
