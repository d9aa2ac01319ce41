//! The tables of a store, as docs/format.md names them: the tests change them behind the store's back.

use redb::TableDefinition;

type Bytes = TableDefinition<'static, &'static [u8], &'static [u8]>;
type ById = TableDefinition<'static, u64, &'static [u8]>;

pub(crate) const TEXTURES: ById = TableDefinition::new("textures");
pub(crate) const SUMS: ById = TableDefinition::new("sums");
pub(crate) const HASHES: TableDefinition<&[u8; 32], &[u8; 12]> = TableDefinition::new("hashes");
pub(crate) const TAGS: TableDefinition<&[u8], &[u8; 4]> = TableDefinition::new("tags");
pub(crate) const CHUNKS: TableDefinition<(u64, u32), &[u8]> = TableDefinition::new("chunks");
pub(crate) const ROWS: TableDefinition<u32, &[u8]> = TableDefinition::new("rows");
pub(crate) const DESCRIPTORS: TableDefinition<(u8, u32), &[u8]> = TableDefinition::new("descriptors");
pub(crate) const META: Bytes = TableDefinition::new("meta");
pub(crate) const STATISTICS: Bytes = TableDefinition::new("statistics");
pub(crate) const SPACES: Bytes = TableDefinition::new("spaces");
pub(crate) const POINTS: Bytes = TableDefinition::new("points");
