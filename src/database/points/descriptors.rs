//! The descriptors of single textures.

use crate::database::scheme::Scheme;
use crate::error::{Error, ExampleKind, QueryError};
use crate::space::{Descriptor, Features, Space};
use crate::store::{Reads, StoreError, ViewCode};

/// The moments of a texture in every view that the store keeps and the texture has; empty for an unknown id.
pub(crate) fn descriptor(state: &impl Reads, id: u64) -> Result<Descriptor, Error> {
    let mut moments = Vec::new();
    for &view in Scheme::of(state).views() {
        if let Some(row) = state.descriptor(id, ViewCode(view.code()))? {
            moments.push((view, row));
        }
    }
    Ok(Descriptor::from_moments(moments)?)
}

/// The descriptor of a texture, which must exist.
pub(crate) fn existing_descriptor(state: &impl Reads, id: u64) -> Result<Descriptor, Error> {
    check_exists(state, id)?;
    descriptor(state, id)
}

/// Refuses an id that no texture has.
pub(crate) fn check_exists(state: &impl Reads, id: u64) -> Result<(), Error> {
    state.record(id)?.ok_or(StoreError::NoSuchTexture { id })?;
    Ok(())
}

/// The features that a space uses, from the descriptor of an example.
pub(crate) fn features(space: &Space, descriptor: &Descriptor, example: ExampleKind) -> Result<Features, Error> {
    let feature_set = space.feature_set();
    if !descriptor.overlaps(feature_set) {
        let (space, needs) = (space.name().to_owned(), feature_set.views().to_vec());
        return Err(QueryError::MissingViews { space, needs, example }.into());
    }
    Ok(descriptor.features(feature_set))
}
