//! Values that reads and upkeep share: voxel streams, tags, rows, descriptor blocks and point blocks.

use crate::store::access::tables::Tables;
use crate::store::damage::{Damage, DamageKey};
use crate::store::error::StoreError;
use crate::store::format::descriptors::{DescriptorBlock, ViewCode};
use crate::store::format::points::{self, PointsLayout};
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock};
use crate::store::format::tables::{CHUNKS, DESCRIPTORS, POINTS, ROWS, TAGS};
use crate::store::format::{tags, voxels};

/// Calls `visit` with key, value and id of every tag whose entry begins with `prefix`.
pub(crate) fn each_tag(
    tables: Tables<'_>,
    prefix: &[u8],
    mut visit: impl FnMut(&str, &str, u64),
) -> Result<(), StoreError> {
    let table = tables.source.table(TAGS)?;
    for entry in table.range(prefix..)? {
        let entry = entry?;
        let key = entry.key()?;
        if !key.starts_with(prefix) {
            break;
        }
        let (tag, value, id) = tags::open(key, entry.value()?)?;
        visit(tag, value, id);
    }
    Ok(())
}

/// The compressed voxels of the texture `id`, whose record counts `chunks` chunks of `bytes` bytes in all.
pub(crate) fn voxel_stream(tables: Tables<'_>, id: u64, chunks: u32, bytes: u64) -> Result<Vec<u8>, StoreError> {
    let table = tables.source.table(CHUNKS)?;
    let mut stream = Vec::new();
    for number in 0..chunks {
        let damage = |what: String| Damage::new(CHUNKS.name, DamageKey::Chunk { texture: id, number }, what);
        let value = table.get((id, number))?.ok_or_else(|| damage("the chunk is missing".into()))?;
        stream.extend_from_slice(voxels::open_chunk(id, number, value.get()?).map_err(damage)?);
    }
    if stream.len() as u64 != bytes {
        let what = format!("the voxels have {} compressed bytes, the record says {bytes}", stream.len());
        return Err(StoreError::damage(CHUNKS.name, DamageKey::Texture(id), what));
    }
    Ok(stream)
}

/// The number of row blocks.
pub(crate) fn row_blocks(tables: Tables<'_>) -> u32 {
    tables.state.rows.div_ceil(ROWS_PER_BLOCK as u64) as u32
}

/// A row block; it must have as many rows as the counters say.
pub(crate) fn row_block(tables: Tables<'_>, block: u32) -> Result<RowBlock, StoreError> {
    if let Some(rows) = tables.buffer.and_then(|buffer| buffer.row_block(block)) {
        return Ok(rows.clone());
    }
    let damage = |what: String| StoreError::damage(ROWS.name, DamageKey::RowBlock(block), what);
    let table = tables.source.table(ROWS)?;
    let value = table.get(block)?.ok_or_else(|| damage("the block is missing".into()))?;
    let rows = RowBlock::open(block, value.get()?)?;
    let full = ROWS_PER_BLOCK as u64;
    let expected = tables.state.rows.saturating_sub(u64::from(block) * full).min(full);
    if rows.ids.len() as u64 != expected {
        return Err(damage(format!("the block has {} rows, the counters say {expected}", rows.ids.len())));
    }
    Ok(rows)
}

/// A descriptor block; `None` if no row of the block has the view.
pub(crate) fn descriptor_block(
    tables: Tables<'_>,
    view: ViewCode,
    block: u32,
) -> Result<Option<DescriptorBlock>, StoreError> {
    if let Some(rows) = tables.buffer.and_then(|buffer| buffer.descriptor_block(view, block)) {
        return Ok(Some(rows.clone()));
    }
    match tables.source.table(DESCRIPTORS)?.get((view.0, block))? {
        Some(value) => Ok(Some(DescriptorBlock::open(view, block, value.get()?)?)),
        None => Ok(None),
    }
}

/// The coordinates of a point block. `layout` is that of `space` in this state.
pub(crate) fn point_block(
    tables: Tables<'_>,
    space: &str,
    layout: &PointsLayout,
    part: u8,
    block: u32,
) -> Result<Vec<f32>, StoreError> {
    let Some(&width) = layout.widths.get(usize::from(part)).filter(|_| block < layout.blocks(part)) else {
        return Err(StoreError::invalid(format!("the points of space {space} have no part {part}, block {block}")));
    };
    if let Some(values) = tables.buffer.and_then(|buffer| buffer.point_block(space, part, block)) {
        return Ok(values.to_vec());
    }
    let width = usize::from(width);
    let damage = |what: String| {
        StoreError::damage(POINTS.name, DamageKey::PointBlock { space: space.to_owned(), part, block }, what)
    };
    let key = points::block_key(space, part, block);
    let table = tables.source.table(POINTS)?;
    let value = table.get(&key[..])?.ok_or_else(|| damage("the block is missing".into()))?;
    points::open_block(&key, width, layout.rows_in_block(width, block), value.get()?).map_err(damage)
}
