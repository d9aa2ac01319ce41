//! The tables: their names and the types of their keys and values, frozen with the format version.

use std::marker::PhantomData;

use redb::{Key, TableDefinition, Value};

/// A table of the file.
pub(crate) struct Table<K: Key + 'static, V: Value + 'static> {
    pub(crate) name: &'static str,
    types: PhantomData<fn(K) -> V>,
}

impl<K: Key + 'static, V: Value + 'static> Table<K, V> {
    const fn new(name: &'static str) -> Self {
        Self { name, types: PhantomData }
    }

    /// The table as the engine knows it.
    pub(crate) const fn definition(self) -> TableDefinition<'static, K, V> {
        TableDefinition::new(self.name)
    }
}

impl<K: Key + 'static, V: Value + 'static> Clone for Table<K, V> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<K: Key + 'static, V: Value + 'static> Copy for Table<K, V> {}

/// A table with keys of any length.
pub(crate) type ByBytes = Table<&'static [u8], &'static [u8]>;

/// `meta`: name -> header, settings, state.
pub(crate) const META: ByBytes = Table::new("meta");
/// `textures`: id -> record.
pub(crate) const TEXTURES: Table<u64, &[u8]> = Table::new("textures");
/// `hashes`: content hash -> [hash entry](super::hashes).
pub(crate) const HASHES: Table<&[u8; 32], &[u8; 12]> = Table::new("hashes");
/// `tags`: [tag key](super::tags) -> short checksum of the key.
pub(crate) const TAGS: Table<&[u8], &[u8; 4]> = Table::new("tags");
/// `chunks`: (id, n) -> the n-th chunk of the compressed voxels.
pub(crate) const CHUNKS: Table<(u64, u32), &[u8]> = Table::new("chunks");
/// `rows`: block -> row block.
pub(crate) const ROWS: Table<u32, &[u8]> = Table::new("rows");
/// `descriptors`: (view, block) -> descriptor block.
pub(crate) const DESCRIPTORS: Table<(u8, u32), &[u8]> = Table::new("descriptors");
/// `sums`: id -> exact sums of full@1.
pub(crate) const SUMS: Table<u64, &[u8]> = Table::new("sums");
/// `statistics`: [chunk of a blob](super::blobs).
pub(crate) const STATISTICS: ByBytes = Table::new("statistics");
/// `spaces`: [chunk of a blob](super::blobs).
pub(crate) const SPACES: ByBytes = Table::new("spaces");
/// `points`: [layout or point block](super::points).
pub(crate) const POINTS: ByBytes = Table::new("points");

/// Creates every table but `meta`, so that a table that is missing later is damage.
pub(crate) fn create_all(transaction: &redb::WriteTransaction) -> Result<(), redb::TableError> {
    transaction.open_table(TEXTURES.definition())?;
    transaction.open_table(HASHES.definition())?;
    transaction.open_table(TAGS.definition())?;
    transaction.open_table(CHUNKS.definition())?;
    transaction.open_table(ROWS.definition())?;
    transaction.open_table(DESCRIPTORS.definition())?;
    transaction.open_table(SUMS.definition())?;
    transaction.open_table(STATISTICS.definition())?;
    transaction.open_table(SPACES.definition())?;
    transaction.open_table(POINTS.definition())?;
    Ok(())
}
