//! The textures that match tag filters.

use std::sync::{Arc, Mutex};

use super::locks::held;
use crate::TagFilter;
use crate::error::Error;
use crate::store::{Reads, Snapshot, StoreError};

/// The textures that matched the last filters: consecutive queries often have the same ones.
#[derive(Default)]
pub(crate) struct FilterCache(Mutex<Option<Matching>>);

/// The textures that matched filters at one revision of the store.
struct Matching {
    revision: u64,
    filters: Vec<TagFilter>,
    ids: Arc<Vec<u64>>,
}

impl FilterCache {
    /// The ids, ascending, of the textures that match all filters; `None` if there are no filters.
    pub(crate) fn matching_ids(
        &self,
        snapshot: &Snapshot,
        filters: &[TagFilter],
    ) -> Result<Option<Arc<Vec<u64>>>, Error> {
        if filters.is_empty() {
            return Ok(None);
        }
        let fits = |last: &&Matching| last.revision == snapshot.revision() && last.filters == filters;
        if let Some(last) = held(self.0.lock()).as_ref().filter(fits) {
            return Ok(Some(Arc::clone(&last.ids)));
        }
        let ids = Arc::new(matching_ids(snapshot, filters)?.unwrap_or_default());
        let (revision, filters) = (snapshot.revision(), filters.to_vec());
        *held(self.0.lock()) = Some(Matching { revision, filters, ids: Arc::clone(&ids) });
        Ok(Some(ids))
    }
}

/// The ids, ascending, of the textures that match all filters; `None` if there are no filters.
pub(crate) fn matching_ids(state: &impl Reads, filters: &[TagFilter]) -> Result<Option<Vec<u64>>, Error> {
    let mut matching: Option<Vec<u64>> = None;
    for filter in filters {
        let (key, value) = (filter.key(), filter.value());
        let ids = match state.tagged(key, value) {
            Err(StoreError::Damage(damage)) => {
                tracing::warn!("{damage}: the tags are read from the records");
                tagged_by_record(state, key, value)?
            }
            ids => ids?,
        };
        matching = Some(match matching {
            None => ids,
            Some(mut both) => {
                both.retain(|id| ids.binary_search(id).is_ok());
                both
            }
        });
    }
    Ok(matching)
}

/// The ids of the textures that have a tag according to their records.
fn tagged_by_record(state: &impl Reads, key: &str, value: &str) -> Result<Vec<u64>, Error> {
    let mut ids = Vec::new();
    for record in state.records() {
        match record {
            Ok(record) if record.tags.get(key).is_some_and(|other| other == value) => ids.push(record.id),
            Ok(_) | Err(StoreError::Damage(_)) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(ids)
}
