//! Where the bytes are.

use std::collections::BTreeMap;

use redb::{ReadableTableMetadata, TableHandle};

use crate::store::access::snapshot::Snapshot;
use crate::store::error::StoreError;
use crate::store::os::panic_boundary::guarded;

/// The bytes of one table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TableSize {
    /// Entries in the table.
    pub entries: u64,
    /// Bytes of keys and values.
    pub stored: u64,
    /// Bytes of the tree around them.
    pub metadata: u64,
    /// Bytes of its pages that hold nothing.
    pub fragmented: u64,
}

impl TableSize {
    /// All bytes of the table's pages.
    pub fn total(&self) -> u64 {
        self.stored + self.metadata + self.fragmented
    }
}

impl Snapshot {
    /// The bytes of each table, by name. Reads the branch and leaf heads of every table: seconds for a large store.
    ///
    /// # Errors
    /// [`StoreError::Engine`], [`StoreError::Damage`].
    pub fn sizes(&self) -> Result<BTreeMap<String, TableSize>, StoreError> {
        guarded("(file)", || {
            let failed = "measuring the store";
            let mut sizes = BTreeMap::new();
            for handle in self.transaction().list_tables().map_err(StoreError::when(failed))? {
                let name = handle.name().to_owned();
                let table = self.transaction().open_untyped_table(handle).map_err(StoreError::when(failed))?;
                let stats = table.stats().map_err(StoreError::when(failed))?;
                let size = TableSize {
                    entries: table.len().map_err(StoreError::when(failed))?,
                    stored: stats.stored_bytes(),
                    metadata: stats.metadata_bytes(),
                    fragmented: stats.fragmented_bytes(),
                };
                sizes.insert(name, size);
            }
            Ok(sizes)
        })
    }
}
