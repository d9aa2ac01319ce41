//! The descriptors of single textures.

use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::space::Descriptor;
use crate::store::{Reads, StoreError, ViewCode};

/// The moments of a texture in every view that the store keeps and the texture has; empty for an unknown id.
pub(crate) fn descriptor(state: &impl Reads, id: u64) -> Result<Descriptor, Error> {
    let mut moments = Vec::new();
    for &view in Scheme::of(state).views().iter() {
        if let Some(row) = state.descriptor(id, ViewCode(view.code()))? {
            moments.push((view, row));
        }
    }
    Ok(Descriptor::from_moments(moments)?)
}

/// The descriptor of a texture, which must exist.
pub(crate) fn known_descriptor(state: &impl Reads, id: u64) -> Result<Descriptor, Error> {
    known(state, id)?;
    descriptor(state, id)
}

/// Refuses an id that no texture has.
pub(crate) fn known(state: &impl Reads, id: u64) -> Result<(), Error> {
    state.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
    Ok(())
}
