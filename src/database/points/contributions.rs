//! What a texture adds to the statistics of each feature set.

use super::descriptors::descriptor;
use super::stored::BlockMoments;
use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::hlac::{MASK_COUNT, OctantSums, Sums, View};
use crate::space::{Contribution, Descriptor, FeatureSet};
use crate::store::{DESCRIPTOR_ROWS, NewTexture, Reads, StoreError, ViewCode};
use crate::volume::Volume;

/// The exact sums of a volume in all views of a scheme, and in `full@1`, whose sums are always stored.
pub(crate) fn describe(volume: &Volume, scheme: &Scheme) -> Vec<(View, OctantSums)> {
    let mut views = scheme.views().to_vec();
    if !views.contains(&View::Full) {
        views.push(View::Full);
    }
    crate::describe(volume, &views)
}

/// The exact sums of `full@1` of a described texture; `None` if that view was not described.
pub(crate) fn full_sums(described: &[(View, OctantSums)]) -> Option<Sums> {
    described.iter().find(|(view, _)| *view == View::Full).map(|(_, octants)| octants.total())
}

/// The contributions of a described texture.
pub(crate) fn contributions(described: &[(View, OctantSums)], scheme: &Scheme) -> Result<Vec<Contribution>, Error> {
    let feature_sets = scheme.feature_sets();
    let contributions = feature_sets.iter().filter_map(|set| Contribution::from_sums(set, described).transpose());
    Ok(contributions.collect::<Result<_, _>>()?)
}

/// The contributions of a stored texture: from its voxels, or from its moments if the voxels are not stored or damaged.
pub(crate) fn stored_contributions(state: &impl Reads, id: u64, scheme: &Scheme) -> Result<Vec<Contribution>, Error> {
    match state.voxels(id) {
        Ok(Some(volume)) => contributions(&describe(&volume, scheme), scheme),
        Ok(None) | Err(StoreError::Damage(_)) => contributions_from_moments(state, id, scheme),
        Err(error) => Err(error.into()),
    }
}

/// The contributions of a stored texture from its moments. Its record is not read.
pub(crate) fn contributions_from_moments(
    state: &impl Reads,
    id: u64,
    scheme: &Scheme,
) -> Result<Vec<Contribution>, Error> {
    let descriptor = descriptor(state, id)?;
    Ok(scheme.feature_sets().iter().filter_map(|set| Contribution::from_descriptor(set, &descriptor)).collect())
}

/// The contributions of a new texture that comes with moments.
pub(crate) fn new_contributions(texture: &NewTexture, feature_sets: &[FeatureSet]) -> Result<Vec<Contribution>, Error> {
    let known = |(code, moments): &(ViewCode, [f32; MASK_COUNT])| Some((View::from_code(code.0)?, *moments));
    let descriptor = Descriptor::from_moments(texture.descriptors.iter().filter_map(known))?;
    Ok(feature_sets.iter().filter_map(|set| Contribution::from_descriptor(set, &descriptor)).collect())
}

/// The contributions of all textures to one feature set, from their moments. They are read block by block, so that memory does
/// not grow with the store.
pub(crate) fn contribution_blocks<'a>(
    state: &'a impl Reads,
    feature_set: &'a FeatureSet,
) -> Result<impl Iterator<Item = Result<Vec<Contribution>, Error>> + 'a, Error> {
    let rows = state.rows()?;
    Ok((0..state.descriptor_blocks()).map(move |block| {
        let moments = BlockMoments::read(state, feature_set, block)?;
        let first = block as usize * DESCRIPTOR_ROWS;
        let live = (first..first + DESCRIPTOR_ROWS).filter(|&row| rows.is_live(row));
        let contributions = live.filter_map(|row| {
            Contribution::from_moments(feature_set, |view| moments.row(view, row - first)).transpose()
        });
        Ok(contributions.collect::<Result<_, _>>()?)
    }))
}
