//! Removing a texture whose record cannot be read.

use crate::store::access::reads::{Reads, sealed::Source as _};
use crate::store::access::transaction::Transaction;
use crate::store::access::values;
use crate::store::error::StoreError;
use crate::store::format::tables::{HASHES, SUMS, TAGS, TEXTURES};
use crate::store::format::{hashes, tags};

impl Transaction {
    /// Removes everything stored under the id of a texture whose record cannot be read. The record does not say what that is,
    /// so hashes and tags are searched. Use [`Transaction::remove`] for a texture whose record is readable.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`]; [`StoreError::Damage`] if hashes, tags or rows are damaged as well: repair first.
    pub fn remove_damaged(&mut self, id: u64) -> Result<(), StoreError> {
        let row = self.row(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        let mut its_hashes: Vec<[u8; 32]> = Vec::new();
        let mut its_tags: Vec<Vec<u8>> = Vec::new();
        for entry in self.tables().source.table(HASHES)?.entries()? {
            let entry = entry?;
            let hash = entry.key()?;
            if hashes::open(hash, entry.value()?)? == id {
                its_hashes.push(*hash);
            }
        }
        values::each_tag(self.tables(), &[], |key, value, of| {
            if of == id {
                its_tags.push(tags::key(key, value, id));
            }
        })?;
        self.writing(|this| {
            this.delete(TEXTURES, id)?;
            its_hashes.iter().try_for_each(|hash| this.delete(HASHES, hash))?;
            its_tags.iter().try_for_each(|key| this.delete(TAGS, &**key))?;
            this.delete_chunks(id)?;
            this.delete(SUMS, id)?;
            this.remove_row(row)
        })
    }
}
