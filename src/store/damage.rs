//! [`Damage`]: a stored value that is not what was written.

use std::fmt;

use serde::{Serialize, Serializer};

/// The table name of damage that concerns the file as a whole.
pub(crate) const FILE: &str = "(file)";

/// A stored value that is not what was written, named by table and key so that it can be isolated and repaired.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[non_exhaustive]
pub struct Damage {
    /// The table, as docs/format.md names it, or `(file)`.
    pub table: &'static str,
    /// The entry of the table.
    pub key: DamageKey,
    /// What was found and what was expected.
    pub what: String,
}

/// The entry of a table that is damaged. [`Display`](fmt::Display) gives a readable form such as `id 7` or
/// `view 3, block 12`; serialised, it is that string.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum DamageKey {
    /// The table or the file as a whole.
    Whole,
    /// Pages of the table that the storage engine cannot read.
    Pages,
    /// An entry with a name: a part of `meta`, a missing table, statistics, a space.
    Name(String),
    /// Whatever the table holds of one texture.
    Texture(u64),
    /// One chunk of a texture's voxels.
    Chunk {
        /// The texture's id.
        texture: u64,
        /// The number of the chunk, from 0.
        number: u32,
    },
    /// A block of rows.
    RowBlock(u32),
    /// One row of a block.
    Row {
        /// The number of the block.
        block: u32,
        /// The row within the block.
        row: u32,
    },
    /// A block of the moments of one view.
    DescriptorBlock {
        /// The code of the view.
        view: u8,
        /// The number of the block.
        block: u32,
    },
    /// All points of a space, or their layout.
    Space(String),
    /// A block of the points of a space.
    PointBlock {
        /// The name of the space.
        space: String,
        /// The part of the points.
        part: u8,
        /// The number of the block.
        block: u32,
    },
    /// The entry of a content hash.
    ContentHash([u8; 32]),
    /// The bytes of a key without a meaning of its own, e.g. the key of a tag.
    Bytes(Vec<u8>),
}

impl Damage {
    /// Damage of the entry `key` of `table`.
    pub fn new(table: &'static str, key: DamageKey, what: impl Into<String>) -> Self {
        Self { table, key, what: what.into() }
    }

    /// The id of the texture that is affected, if the damage is limited to one.
    pub fn texture(&self) -> Option<u64> {
        match self.key {
            DamageKey::Texture(texture) | DamageKey::Chunk { texture, .. } => Some(texture),
            _ => None,
        }
    }
}

impl std::error::Error for Damage {}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.table {
            FILE => f.write_str("damage in the file")?,
            table => write!(f, "damage in table {table}")?,
        }
        if self.key != DamageKey::Whole {
            write!(f, " at {}", self.key)?;
        }
        write!(f, ": {}", self.what)
    }
}

impl fmt::Display for DamageKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Whole => Ok(()),
            Self::Pages => f.write_str("(pages)"),
            Self::Name(name) => f.write_str(name),
            Self::Texture(id) => write!(f, "id {id}"),
            Self::Chunk { texture, number } => write!(f, "id {texture}, chunk {number}"),
            Self::RowBlock(block) => write!(f, "block {block}"),
            Self::Row { block, row } => write!(f, "block {block}, row {row}"),
            Self::DescriptorBlock { view, block } => write!(f, "view {view}, block {block}"),
            Self::Space(space) => write!(f, "space {space}"),
            Self::PointBlock { space, part, block } => write!(f, "space {space}, part {part}, block {block}"),
            Self::ContentHash(hash) => f.write_str(&blake3::Hash::from_bytes(*hash).to_hex()),
            Self::Bytes(bytes) => write!(f, "{}", bytes.escape_ascii()),
        }
    }
}

impl Serialize for DamageKey {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn damage_names_the_texture_that_it_is_limited_to() {
        let of = |key: DamageKey| Damage::new("chunks", key, "the checksum does not match");
        let chunk = of(DamageKey::Chunk { texture: 7, number: 2 });
        assert_eq!(chunk.texture(), Some(7));
        assert_eq!(chunk.to_string(), "damage in table chunks at id 7, chunk 2: the checksum does not match");
        assert_eq!(of(DamageKey::Texture(9)).texture(), Some(9));
        assert_eq!(of(DamageKey::Name("id 9".into())).texture(), None, "a name is no id, whatever it says");
        assert_eq!(of(DamageKey::RowBlock(9)).texture(), None);
        assert_eq!(
            Damage::new(FILE, DamageKey::Whole, "it ends early").to_string(),
            "damage in the file: it ends early"
        );
    }
}
