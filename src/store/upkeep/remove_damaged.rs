//! Removing a texture whose record cannot be read.

use crate::store::access::reads::sealed::Source as _;
use crate::store::access::reads::{self, Reads};
use crate::store::access::transaction::Transaction;
use crate::store::error::StoreError;
use crate::store::format::keys;
use crate::store::format::rows::ROWS_PER_BLOCK;

impl Transaction {
    /// Removes all that there is under the id of a texture whose record cannot be read, and so does not say what that is:
    /// hashes and tags are walked for it. A texture whose record is whole is [`Transaction::remove`]d.
    ///
    /// # Errors
    /// [`StoreError::NoSuchTexture`]; [`StoreError::Damage`] where hashes, tags or rows are damaged as well: repair first.
    pub fn discard(&mut self, id: u64) -> Result<(), StoreError> {
        let row = self.row(id)?.ok_or(StoreError::NoSuchTexture { id })?;
        let mut hashes: Vec<[u8; 32]> = Vec::new();
        let mut tags: Vec<Vec<u8>> = Vec::new();
        {
            let table = self.tables().source.table(keys::HASHES)?;
            for entry in table.range::<&[u8; 32]>(..)? {
                let (hash, value) = entry.map_err(StoreError::when("reading the store"))?;
                if reads::read_hash(hash.value(), value.value())? == id {
                    hashes.push(*hash.value());
                }
            }
        }
        reads::each_tag(self.tables(), &[], |key, value, of| {
            if of == id {
                tags.push(keys::tag(key, value, id));
            }
        })?;
        self.writing(|this| {
            this.delete(keys::TEXTURES, id)?;
            hashes.iter().try_for_each(|hash| this.delete(keys::HASHES, hash))?;
            tags.iter().try_for_each(|key| this.delete(keys::TAGS, &**key))?;
            this.delete_chunks(id)?;
            this.delete(keys::SUMS, id)?;
            let block = (row / ROWS_PER_BLOCK as u64) as u32;
            this.bury(block, (row % ROWS_PER_BLOCK as u64) as usize)
        })
    }
}
