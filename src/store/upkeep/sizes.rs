//! How many bytes each table takes.

use std::collections::BTreeMap;

use redb::{ReadableTableMetadata, TableHandle};

use crate::store::access::snapshot::Snapshot;
use crate::store::damage::FILE;
use crate::store::error::StoreError;
use crate::store::os::panic_boundary::contained;

const DOING: &str = "measuring the store";

/// The bytes of one table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct TableSize {
    /// The number of entries.
    pub entries: u64,
    /// The bytes of keys and values.
    pub stored: u64,
    /// The bytes of the tree around them.
    pub metadata: u64,
    /// The unused bytes of the table's pages.
    pub fragmented: u64,
}

impl TableSize {
    /// All bytes of the table's pages.
    pub fn total(&self) -> u64 {
        self.stored + self.metadata + self.fragmented
    }
}

impl Snapshot {
    /// The bytes of each table, by name. Reads the heads of all pages of every table: seconds for a large store.
    ///
    /// # Errors
    /// [`StoreError::Engine`], [`StoreError::Damage`].
    pub fn sizes(&self) -> Result<BTreeMap<String, TableSize>, StoreError> {
        let tables = contained(FILE, DOING, || self.transaction().list_tables())?;
        let mut sizes = BTreeMap::new();
        for handle in tables {
            let name = handle.name().to_owned();
            let table = contained(FILE, DOING, || self.transaction().open_untyped_table(handle))?;
            let (stats, entries) =
                contained(FILE, DOING, || Ok::<_, redb::StorageError>((table.stats()?, table.len()?)))?;
            let size = TableSize {
                entries,
                stored: stats.stored_bytes(),
                metadata: stats.metadata_bytes(),
                fragmented: stats.fragmented_bytes(),
            };
            sizes.insert(name, size);
        }
        Ok(sizes)
    }
}
