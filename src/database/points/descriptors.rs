//! The moments of single textures.

use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::hlac::{MASK_COUNT, View};
use crate::store::{Reads, StoreError, ViewCode};

/// The moments of a texture in every view that it has.
pub(crate) fn moments(state: &impl Reads, id: u64) -> Result<Vec<(View, [f32; MASK_COUNT])>, Error> {
    let mut moments = Vec::new();
    for &view in Scheme::of(state).views().iter() {
        if let Some(row) = state.descriptor(id, ViewCode(view.code()))? {
            moments.push((view, row));
        }
    }
    Ok(moments)
}

/// The moments of a texture, which must be there.
pub(crate) fn known_moments(state: &impl Reads, id: u64) -> Result<Vec<(View, [f32; MASK_COUNT])>, Error> {
    known(state, id)?;
    moments(state, id)
}

pub(crate) fn known(state: &impl Reads, id: u64) -> Result<(), Error> {
    state.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
    Ok(())
}
