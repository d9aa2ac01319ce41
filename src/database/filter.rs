//! The textures that carry some tags.

use std::sync::{Arc, Mutex};

use super::locks::held;
use crate::TagFilter;
use crate::error::Error;
use crate::store::{Reads, Snapshot, StoreError};

/// The textures that the last filter let through: consecutive queries often have the same filter.
#[derive(Default)]
pub(crate) struct FilterCache(Mutex<Option<Filtered>>);

/// The textures that a filter let through at a revision of the store.
struct Filtered {
    revision: u64,
    filters: Vec<TagFilter>,
    ids: Arc<Vec<u64>>,
}

impl FilterCache {
    /// The ids, ascending, of the textures that carry all of these tags; `None` if there are no filters.
    pub(crate) fn tagged(&self, snapshot: &Snapshot, filters: &[TagFilter]) -> Result<Option<Arc<Vec<u64>>>, Error> {
        if filters.is_empty() {
            return Ok(None);
        }
        let fits = |last: &&Filtered| last.revision == snapshot.revision() && last.filters == filters;
        if let Some(last) = held(self.0.lock()).as_ref().filter(fits) {
            return Ok(Some(Arc::clone(&last.ids)));
        }
        let ids = Arc::new(tagged_with_all(snapshot, filters)?.unwrap_or_default());
        let (revision, filters) = (snapshot.revision(), filters.to_vec());
        *held(self.0.lock()) = Some(Filtered { revision, filters, ids: Arc::clone(&ids) });
        Ok(Some(ids))
    }
}

/// The ids, ascending, of the textures that carry all of these tags; `None` if there are no filters.
pub(crate) fn tagged_with_all(state: &impl Reads, filters: &[TagFilter]) -> Result<Option<Vec<u64>>, Error> {
    let mut allowed: Option<Vec<u64>> = None;
    for filter in filters {
        let (key, value) = (filter.key(), filter.value());
        let ids = match state.tagged(key, value) {
            Err(StoreError::Damage(damage)) => {
                tracing::warn!("{damage}: the tags are read from the records, one by one");
                tagged_by_record(state, key, value)?
            }
            ids => ids?,
        };
        allowed = Some(match allowed {
            None => ids,
            Some(mut both) => {
                both.retain(|id| ids.binary_search(id).is_ok());
                both
            }
        });
    }
    Ok(allowed)
}

/// The ids of the textures that carry a tag, as their records say.
fn tagged_by_record(state: &impl Reads, key: &str, value: &str) -> Result<Vec<u64>, Error> {
    let mut ids = Vec::new();
    for record in state.records() {
        match record {
            Ok(record) if record.tags.get(key).is_some_and(|held| held == value) => ids.push(record.id),
            Ok(_) | Err(StoreError::Damage(_)) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(ids)
}
