//! Quarantine: textures of which something is lost.
//!
//! Nothing is written when damage is met: a texture whose record cannot be read is found out each time, by its checksum.
//! What can no longer be found out (moments that were lost and left out by a repair, voxels that are looked at only when
//! asked for) the repair notes in the settings, under [`NOTE`], as `id what` separated by commas.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::handle::Database;
use crate::TextureId;
use crate::error::Error;
use crate::store::{DESCRIPTOR_ROWS, Damage, Reads, StoreError, Transaction};

/// The name of the note among the settings.
const NOTE: &str = "quarantined";
const MOMENTS: &str = "moments";
const VOXELS: &str = "voxels";

/// A texture of which something is lost.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Quarantined {
    /// The texture.
    pub id: TextureId,
    /// What is lost.
    pub what: String,
    /// True where it is left out of answers; one that has lost its voxels alone is still found.
    pub left_out: bool,
}

impl Database {
    /// The textures of which something is known to be lost: those whose records cannot be read, and those that a repair has
    /// noted. Reads every record. Voxels that went bad since the last repair are found by [`Database::verify`].
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn quarantined(&self) -> Result<Vec<Quarantined>, Error> {
        listed(&self.store().read()?)
    }
}

/// Those of one state, in id order.
pub(crate) fn listed(state: &impl Reads) -> Result<Vec<Quarantined>, Error> {
    let mut found: BTreeMap<u64, Quarantined> = BTreeMap::new();
    for record in state.records() {
        match record {
            Ok(_) => {}
            Err(StoreError::Damage(damage)) => {
                if let Some(id) = damage.texture() {
                    found.insert(id, Quarantined { id: id.into(), what: damage.to_string(), left_out: true });
                }
            }
            Err(error) => return Err(error.into()),
        }
    }
    for (id, what) in noted(state) {
        if !found.contains_key(&id) && state.record(id)?.is_some() {
            let left_out = what == MOMENTS;
            found.insert(id, Quarantined { id: id.into(), what: format!("its {what} are lost"), left_out });
        }
    }
    Ok(found.into_values().collect())
}

/// Adds the textures whose moments lie in a block that cannot be read.
pub(crate) fn of_block(
    state: &impl Reads,
    block: u32,
    damage: &Damage,
    found: &mut Vec<Quarantined>,
) -> Result<(), Error> {
    let first = block as usize * DESCRIPTOR_ROWS;
    for (_, id) in state.rows()?.live().filter(|(row, _)| (first..first + DESCRIPTOR_ROWS).contains(row)) {
        if !found.iter().any(|known| known.id == id) {
            found.push(Quarantined { id: id.into(), what: damage.to_string(), left_out: false });
        }
    }
    found.sort_by_key(|known| known.id);
    Ok(())
}

/// The textures that answers leave out because a repair noted that their moments are lost, with a word to the asker.
pub(crate) fn left_out(state: &impl Reads, warnings: &mut Vec<String>) -> Vec<u64> {
    let ids: Vec<u64> = noted(state).filter(|(_, what)| *what == MOMENTS).map(|(id, _)| id).collect();
    if !ids.is_empty() {
        let shown: Vec<String> = ids.iter().map(u64::to_string).collect();
        warnings.push(format!("left out, because their moments are lost: textures {}", shown.join(", ")));
    }
    ids
}

fn noted(state: &impl Reads) -> impl Iterator<Item = (u64, &str)> {
    let note = state.settings().further.get(NOTE).map_or("", String::as_str);
    note.split(',').filter_map(|entry| {
        let (id, what) = entry.split_once(' ')?;
        Some((id.parse().ok()?, what))
    })
}

/// Writes the note; where there is nothing to note any more it goes.
pub(crate) fn note(
    transaction: &mut Transaction,
    moments: &BTreeSet<u64>,
    voxels: &BTreeSet<u64>,
) -> Result<(), Error> {
    let mut notes: BTreeMap<u64, &str> = voxels.iter().map(|&id| (id, VOXELS)).collect();
    notes.extend(moments.iter().map(|&id| (id, MOMENTS)));
    let earlier: Vec<u64> = noted(transaction).filter(|(_, what)| *what == MOMENTS).map(|(id, _)| id).collect();
    for id in earlier {
        // Moments do not come back by themselves; what was removed since needs no note.
        if transaction.row(id)?.is_some() {
            notes.insert(id, MOMENTS);
        }
    }
    let mut settings = transaction.settings().clone();
    let text: Vec<String> = notes.into_iter().map(|(id, what)| format!("{id} {what}")).collect();
    match text.is_empty() {
        true => drop(settings.further.remove(NOTE)),
        false => drop(settings.further.insert(NOTE.into(), text.join(","))),
    }
    if settings != *transaction.settings() {
        transaction.put_settings(settings)?;
    }
    Ok(())
}
