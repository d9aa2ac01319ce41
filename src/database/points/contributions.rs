//! What a texture adds to the statistics of each feature set.

use super::descriptors::descriptor;
use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::hlac::{MASK_COUNT, OctantSums, Sums, View};
use crate::space::{Contribution, Descriptor, FeatureSet};
use crate::store::{DESCRIPTOR_ROWS, NewTexture, Reads, StoreError, ViewCode};

/// What a described texture adds to the statistics of a store that keeps `views`.
pub(crate) fn contributions(described: &[(View, OctantSums)], views: &Scheme) -> Result<Vec<Contribution>, Error> {
    let recipes = views.recipes();
    let contributions = recipes.iter().filter_map(|recipe| Contribution::from_sums(recipe, described).transpose());
    Ok(contributions.collect::<Result<_, _>>()?)
}

/// The views to describe: those that are kept, and `full@1`, whose exact sums are kept in any case.
pub(crate) fn with_full(views: &[View]) -> Vec<View> {
    let mut wanted = views.to_vec();
    if !wanted.contains(&View::Full) {
        wanted.push(View::Full);
    }
    wanted
}

/// The exact sums of `full@1` of a described texture; `None` where that view was not described.
pub(crate) fn full_sums(described: &[(View, OctantSums)]) -> Option<Sums> {
    described.iter().find(|(view, _)| *view == View::Full).map(|(_, octants)| octants.total())
}

/// What a texture adds to the statistics: described anew from its voxels, or, where they are not kept, by its moments.
pub(crate) fn contributions_of(state: &impl Reads, id: u64, views: &Scheme) -> Result<Vec<Contribution>, Error> {
    match state.voxels(id) {
        Ok(Some(volume)) => contributions(&crate::describe(&volume, &with_full(views.views())), views),
        Ok(None) => contributions_of_moments(state, id, views),
        // Damaged voxels do not stop a texture from being removed.
        Err(StoreError::Damage(_)) => contributions_of_moments(state, id, views),
        Err(error) => Err(error.into()),
    }
}

/// What a texture adds to the statistics by the moments that are kept of it, whatever has become of its record.
pub(crate) fn contributions_of_moments(
    state: &impl Reads,
    id: u64,
    views: &Scheme,
) -> Result<Vec<Contribution>, Error> {
    let descriptor = descriptor(state, id)?;
    Ok(views.recipes().iter().filter_map(|features| Contribution::from_descriptor(features, &descriptor)).collect())
}

/// What a texture that comes with moments adds to the statistics of each recipe.
pub(crate) fn described_contributions(
    texture: &NewTexture,
    recipes: &[FeatureSet],
) -> Result<Vec<Contribution>, Error> {
    let known = |(code, moments): &(ViewCode, [f32; MASK_COUNT])| Some((View::from_code(code.0)?, *moments));
    let descriptor = Descriptor::from_moments(texture.descriptors.iter().filter_map(known))?;
    Ok(recipes.iter().filter_map(|features| Contribution::from_descriptor(features, &descriptor)).collect())
}

/// What every texture adds to the statistics of a recipe, without octants: block by block, so that memory does not grow
/// with the store.
pub(crate) fn contribution_blocks<'a>(
    state: &'a impl Reads,
    recipe: &'a FeatureSet,
) -> Result<impl Iterator<Item = Result<Vec<Contribution>, Error>> + 'a, Error> {
    let rows = state.rows()?;
    Ok((0..state.descriptor_blocks()).map(move |block| {
        let moments = crate::database::points::stored::BlockMoments::read(state, recipe, block)?;
        let first = block as usize * DESCRIPTOR_ROWS;
        let live = (first..first + DESCRIPTOR_ROWS).filter(|&row| rows.is_live(row));
        let parts = live
            .filter_map(|row| Contribution::from_moments(recipe, |view| moments.row(view, row - first)).transpose());
        Ok(parts.collect::<Result<_, _>>()?)
    }))
}
