//! Which textures a damaged store has, and the row of each.

use std::collections::{BTreeMap, BTreeSet};

use super::damaged::{Damaged, Found};
use crate::store::format::header::State;
use crate::store::format::rows::{ROWS_PER_BLOCK, RowBlock};
use crate::store::format::tables::TEXTURES;

/// The number of ids that are tried one by one if no table lists all of them.
const MAX_TRIED: u64 = 1 << 24;

/// The textures of a damaged store.
pub(crate) struct Places {
    /// The old row of each texture; `None` if it is unknown.
    pub(crate) rows: BTreeMap<u64, Option<u64>>,
    /// The highest id that was ever assigned, as far as is known.
    pub(crate) highest: u64,
    /// The number of row blocks that were derived from others.
    pub(crate) blocks_derived: u64,
}

impl Places {
    /// Finds textures and rows.
    pub(crate) fn find(old: Damaged<'_>, state: Option<State>) -> Self {
        let blocks = old.row_blocks(state);
        let mut ids = BTreeSet::new();
        let complete = old.each(TEXTURES, |id, _| {
            ids.insert(id);
        });
        let mut rows: BTreeMap<u64, Option<u64>> = BTreeMap::new();
        let mut removed = BTreeSet::new();
        for (&number, block) in blocks.iter().filter_map(|(number, block)| Some((number, block.as_ref()?))) {
            for (at, &id) in block.ids.iter().enumerate() {
                if block.live.get(at) {
                    rows.insert(id, Some(u64::from(number) * ROWS_PER_BLOCK as u64 + at as u64));
                } else {
                    removed.insert(id);
                }
            }
        }
        if !complete && blocks.values().any(Option::is_none) {
            // Neither table lists all textures: try every id that may have been assigned.
            let last = state.map_or(MAX_TRIED, |state| state.next_id).min(MAX_TRIED);
            ids.extend((1..last).filter(|&id| !matches!(old.get(TEXTURES, id), Found::Nothing)));
        }
        // A record at an id without a row that cannot be read there is one whose key was damaged.
        ids.retain(|&id| rows.contains_key(&id) || !removed.contains(&id) && old.record(id).1.is_some());
        let highest = ids.last().copied().max(rows.keys().last().copied()).max(removed.last().copied()).unwrap_or(0);
        let blocks_derived = place(&ids, &mut rows, &blocks, state);
        for &id in ids.iter().filter(|id| !removed.contains(id)) {
            rows.entry(id).or_insert(None);
        }
        Self { rows, highest, blocks_derived }
    }
}

/// Finds the rows of textures whose row block cannot be read. Ids ascend with rows, so if a gap between intact blocks has as
/// many textures as rows, each texture has its own row. Returns the number of blocks in such gaps.
fn place(
    ids: &BTreeSet<u64>,
    rows: &mut BTreeMap<u64, Option<u64>>,
    blocks: &BTreeMap<u32, Option<RowBlock>>,
    state: Option<State>,
) -> u64 {
    let full = ROWS_PER_BLOCK as u64;
    let mut derived = 0;
    let mut lost = blocks.iter().filter(|(_, block)| block.is_none()).map(|(&number, _)| number).peekable();
    while let Some(first) = lost.next() {
        let mut last = first;
        while lost.next_if_eq(&(last + 1)).is_some() {
            last += 1;
        }
        let edge = |number: Option<u32>, pick: fn(&RowBlock) -> Option<u64>| {
            number.and_then(|number| blocks.get(&number)?.as_ref().and_then(pick))
        };
        let above = edge(first.checked_sub(1), |block| block.ids.last().copied()).map_or(0, |id| id + 1);
        let below = edge(last.checked_add(1), |block| block.ids.first().copied()).unwrap_or(u64::MAX);
        let from = u64::from(first) * full;
        let until = ((u64::from(last) + 1) * full).min(state.map_or(u64::MAX, |state| state.rows));
        let found: Vec<u64> = ids.range(above..below.max(above)).copied().collect();
        let certain = state.is_some() && found.len() as u64 == until.saturating_sub(from);
        for (row, &id) in (from..).zip(&found) {
            rows.entry(id).or_insert(certain.then_some(row));
        }
        derived += u64::from(last - first) + 1;
    }
    derived
}
