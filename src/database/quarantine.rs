//! Quarantine: textures of which something is lost.
//!
//! Nothing is written when damage is found: a record that cannot be read is recognised each time by its checksum. Two losses
//! cannot be recognised later: moments that a repair could not restore, and voxels, which are read only when they are needed. A
//! repair notes both in the settings under [`SETTING`], as `id what`, separated by commas.

use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::handle::Database;
use crate::TextureId;
use crate::error::Error;
use crate::store::{DESCRIPTOR_ROWS, Damage, Reads, StoreError, Transaction};

/// The name of the setting.
const SETTING: &str = "quarantined";
const MOMENTS: &str = "moments";
const VOXELS: &str = "voxels";

/// A texture of which something is lost.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct QuarantinedTexture {
    /// The texture.
    pub id: TextureId,
    /// What is lost.
    pub what: String,
    /// True if it is left out of answers. A texture that has lost only its voxels is still found.
    pub left_out: bool,
}

impl Database {
    /// The textures of which something is known to be lost: those whose records cannot be read, and those that a repair has
    /// noted. Reads every record. [`Database::verify`] also finds voxels that were damaged since the last repair.
    ///
    /// # Errors
    /// [`Error::Store`].
    pub fn quarantined(&self) -> Result<Vec<QuarantinedTexture>, Error> {
        quarantined(&self.store().read()?)
    }
}

/// The quarantined textures of one state, in id order.
pub(crate) fn quarantined(state: &impl Reads) -> Result<Vec<QuarantinedTexture>, Error> {
    let mut found: BTreeMap<u64, QuarantinedTexture> = BTreeMap::new();
    for record in state.records() {
        match record {
            Ok(_) => {}
            Err(StoreError::Damage(damage)) => {
                if let Some(id) = damage.texture() {
                    found.insert(id, QuarantinedTexture { id: id.into(), what: damage.to_string(), left_out: true });
                }
            }
            Err(error) => return Err(error.into()),
        }
    }
    for (id, what) in noted(state) {
        if !found.contains_key(&id) && state.record(id)?.is_some() {
            let left_out = what == MOMENTS;
            found.insert(id, QuarantinedTexture { id: id.into(), what: format!("its {what} are lost"), left_out });
        }
    }
    Ok(found.into_values().collect())
}

/// Adds the textures whose moments are in a block that cannot be read.
pub(crate) fn add_block(
    state: &impl Reads,
    block: u32,
    damage: &Damage,
    found: &mut Vec<QuarantinedTexture>,
) -> Result<(), Error> {
    let first = block as usize * DESCRIPTOR_ROWS;
    for (_, id) in state.rows()?.live().filter(|(row, _)| (first..first + DESCRIPTOR_ROWS).contains(row)) {
        if !found.iter().any(|texture| texture.id == id) {
            found.push(QuarantinedTexture { id: id.into(), what: damage.to_string(), left_out: false });
        }
    }
    found.sort_by_key(|texture| texture.id);
    Ok(())
}

/// The textures that answers leave out because a repair noted that their moments are lost. Adds a warning if there are any.
pub(crate) fn left_out(state: &impl Reads, warnings: &mut Vec<String>) -> Vec<u64> {
    let ids: Vec<u64> = noted(state).filter(|(_, what)| *what == MOMENTS).map(|(id, _)| id).collect();
    if !ids.is_empty() {
        let shown: Vec<String> = ids.iter().map(u64::to_string).collect();
        warnings.push(format!("textures {} are left out: their moments are lost", shown.join(", ")));
    }
    ids
}

/// What the setting notes: ids, and what each has lost.
fn noted(state: &impl Reads) -> impl Iterator<Item = (u64, &str)> {
    let text = state.settings().further.get(SETTING).map_or("", String::as_str);
    text.split(',').filter_map(|entry| {
        let (id, what) = entry.split_once(' ')?;
        Some((id.parse().ok()?, what))
    })
}

/// Writes the setting: textures that lost their moments or their voxels. Earlier notes of moments are kept for textures that
/// still exist, since moments cannot be restored later.
pub(crate) fn note(
    transaction: &mut Transaction,
    moments: &BTreeSet<u64>,
    voxels: &BTreeSet<u64>,
) -> Result<(), Error> {
    let mut notes: BTreeMap<u64, &str> = voxels.iter().map(|&id| (id, VOXELS)).collect();
    notes.extend(moments.iter().map(|&id| (id, MOMENTS)));
    let earlier: Vec<u64> = noted(transaction).filter(|(_, what)| *what == MOMENTS).map(|(id, _)| id).collect();
    for id in earlier {
        if transaction.row(id)?.is_some() {
            notes.insert(id, MOMENTS);
        }
    }
    let mut settings = transaction.settings().clone();
    let text: Vec<String> = notes.into_iter().map(|(id, what)| format!("{id} {what}")).collect();
    match text.is_empty() {
        true => drop(settings.further.remove(SETTING)),
        false => drop(settings.further.insert(SETTING.into(), text.join(","))),
    }
    if settings != *transaction.settings() {
        transaction.put_settings(settings)?;
    }
    Ok(())
}
