//! What should not matter, learned from the store's own textures: the scatter between a texture and copies of it under
//! the nuisances that the user declares. It takes the place of the prior's in every likeness space.

use rayon::prelude::*;

use crate::database::scheme::Scheme;
use crate::error::{Error, MaintenanceError};
use crate::progress::Progress;
use crate::space::{Contribution, FeatureSet, NuisanceStatistics, SpaceKind};
use crate::store::{Reads, Transaction};
use crate::synth::Nuisance;
use crate::volume::Volume;

/// So many textures are looked at, at most, evenly spread over the store.
const MOST_TEXTURES: usize = 512;

/// So many copies of each texture, at most: a small store makes up for its size by more of them.
const MOST_COPIES: usize = 8;

/// The setting that holds the words of the nuisance.
const SETTING: &str = "nuisance";

/// Textures described at a time.
const BATCH: usize = 32;

/// The statistics' key of the nuisance scatter of a recipe.
pub(crate) fn key(recipe: &FeatureSet) -> String {
    format!("nuisance:{}", recipe.key())
}

/// The store's own nuisance scatter of a recipe; `None` where it was never estimated and the prior's counts.
pub(crate) fn load(state: &impl Reads, recipe: &FeatureSet) -> Result<Option<NuisanceStatistics>, Error> {
    let bytes = state.statistics(&key(recipe))?;
    Ok(bytes.map(|bytes| NuisanceStatistics::decode(&bytes)).transpose()?)
}

/// The words of the nuisance that was last estimated.
pub(crate) fn declared(state: &impl Reads) -> Option<String> {
    state.settings().further.get(SETTING).cloned()
}

/// Forgets what was estimated: the prior's scatter counts again.
pub(crate) fn forget(transaction: &mut Transaction) -> Result<(), Error> {
    for recipe in Scheme::of(transaction).recipes() {
        transaction.drop_statistics(&key(&recipe))?;
    }
    let mut settings = transaction.settings().clone();
    settings.further.remove(SETTING);
    Ok(transaction.put_settings(settings)?)
}

/// Estimates the scatter of every likeness recipe anew, on at most [`MOST_TEXTURES`] textures whose voxels are kept.
/// Returns how many pairs of a texture and a copy were looked at. The same store and nuisance give the same scatter, to
/// the bit.
///
/// # Errors
/// [`MaintenanceError::NoVoxels`] where no voxels are kept; [`Error::Cancelled`]; [`Error::Store`].
pub(crate) fn estimate(
    transaction: &mut Transaction,
    nuisance: &Nuisance,
    progress: &dyn Progress,
) -> Result<u64, Error> {
    let scheme = Scheme::of(transaction);
    let likeness = scheme.definitions().iter().filter(|one| matches!(one.kind, SpaceKind::Likeness { .. }));
    let mut recipes: Vec<FeatureSet> = likeness.map(|definition| definition.feature_set.clone()).collect();
    recipes.dedup();
    let mut scatters: Vec<NuisanceStatistics> = recipes.iter().map(NuisanceStatistics::new).collect();
    let ids = sample(transaction)?;
    if ids.is_empty() {
        return Err(MaintenanceError::NoVoxels.into());
    }
    let copies = (MOST_TEXTURES / ids.len()).clamp(1, MOST_COPIES) as u64;
    progress.begin("nuisances", Some(ids.len() as u64));
    let mut pairs = 0;
    for batch in ids.chunks(BATCH) {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let volumes: Vec<(u64, Volume)> =
            batch.iter().filter_map(|&id| Some((id, transaction.voxels(id).ok().flatten()?))).collect();
        let described: Vec<Vec<Vec<Contribution>>> = volumes
            .par_iter()
            .map(|(id, volume)| family(*id, volume, nuisance, copies, &recipes))
            .collect::<Result<_, _>>()?;
        for family in &described {
            let Some((texture, copies)) = family.split_first() else { continue };
            for copy in copies {
                for scatter in &mut scatters {
                    let of = |parts: &[Contribution]| {
                        parts.iter().find(|part| part.feature_set() == scatter.feature_set()).cloned()
                    };
                    if let Some((texture, copy)) = of(texture).zip(of(copy)) {
                        scatter.add(&texture, &copy)?;
                    }
                }
                pairs += 1;
            }
        }
        progress.advance(batch.len() as u64);
    }
    for scatter in &scatters {
        transaction.put_statistics(&key(scatter.feature_set()), &scatter.encode())?;
    }
    let mut settings = transaction.settings().clone();
    settings.further.insert(SETTING.to_owned(), nuisance.to_string());
    transaction.put_settings(settings)?;
    Ok(pairs)
}

/// What a texture and its copies give for each recipe, the texture first. A recipe whose views they lack is left out.
fn family(
    id: u64,
    volume: &Volume,
    nuisance: &Nuisance,
    copies: u64,
    recipes: &[FeatureSet],
) -> Result<Vec<Vec<Contribution>>, Error> {
    let mut views: Vec<_> = recipes.iter().flat_map(|recipe| recipe.views().iter().copied()).collect();
    views.sort_unstable();
    views.dedup();
    let parts = |volume: &Volume| -> Result<Vec<Contribution>, Error> {
        let described = crate::describe(volume, &views);
        let parts = recipes.iter().filter_map(|recipe| Contribution::from_sums(recipe, &described).transpose());
        Ok(parts.collect::<Result<_, _>>()?)
    };
    let copy = |at: u64| parts(&nuisance.draw(id * MOST_COPIES as u64 + at).apply(volume));
    std::iter::once(parts(volume)).chain((0..copies).map(copy)).collect()
}

/// At most [`MOST_TEXTURES`] ids of textures whose voxels are kept, evenly spread.
fn sample(transaction: &Transaction) -> Result<Vec<u64>, Error> {
    let mut ids = Vec::new();
    for record in transaction.records() {
        let record = record?;
        if record.voxels.is_some() {
            ids.push(record.id);
        }
    }
    let count = ids.len().min(MOST_TEXTURES);
    let spread = (0..count).filter_map(|at| ids.get(at * ids.len() / count).copied());
    Ok(spread.collect())
}
