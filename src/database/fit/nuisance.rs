//! The nuisance scatter of a store: how much its textures differ from copies of themselves under nuisances that the user
//! declares, such as noise and rotation. It replaces the prior's scatter in all likeness spaces.

use rayon::prelude::*;

use crate::database::points::fitting::{NUISANCE_SETTING, nuisance_key};
use crate::database::scheme::Scheme;
use crate::error::{Error, MaintenanceError};
use crate::progress::Progress;
use crate::space::{Contribution, FeatureSet, NuisanceStatistics, SpaceKind};
use crate::store::{Reads, Transaction};
use crate::synth::Nuisance;
use crate::volume::Volume;

/// The most textures that are sampled, evenly spread over the store.
const MAX_TEXTURES: usize = 512;

/// The most copies of each texture: a small store makes up for its size by more of them.
const MAX_COPIES: usize = 8;

/// The number of textures that are described at a time.
const BATCH: usize = 32;

/// Drops the store's nuisance scatter, so that the prior's is used again.
pub(crate) fn reset(transaction: &mut Transaction) -> Result<(), Error> {
    for feature_set in Scheme::of(transaction).feature_sets() {
        transaction.drop_statistics(&nuisance_key(&feature_set))?;
    }
    let mut settings = transaction.settings().clone();
    settings.further.remove(NUISANCE_SETTING);
    Ok(transaction.put_settings(settings)?)
}

/// Estimates the nuisance scatter of every likeness space, on at most [`MAX_TEXTURES`] textures whose voxels are stored.
/// Returns the number of pairs of a texture and a copy. The same store and nuisance give the same scatter, to the bit.
///
/// # Errors
/// [`MaintenanceError::NoVoxels`]; [`Error::Cancelled`]; [`Error::Store`].
pub(crate) fn estimate(
    transaction: &mut Transaction,
    nuisance: &Nuisance,
    progress: &dyn Progress,
) -> Result<u64, Error> {
    let scheme = Scheme::of(transaction);
    let likeness = scheme.definitions().iter().filter(|one| matches!(one.kind, SpaceKind::Likeness { .. }));
    let mut feature_sets: Vec<FeatureSet> = likeness.map(|definition| definition.feature_set.clone()).collect();
    feature_sets.dedup();
    let mut scatters: Vec<NuisanceStatistics> = feature_sets.iter().map(NuisanceStatistics::new).collect();
    let ids = sample(transaction)?;
    if ids.is_empty() {
        return Err(MaintenanceError::NoVoxels.into());
    }
    let copies = (MAX_TEXTURES / ids.len()).clamp(1, MAX_COPIES) as u64;
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
            .map(|(id, volume)| with_copies(*id, volume, nuisance, copies, &feature_sets))
            .collect::<Result<_, _>>()?;
        for texture_and_copies in &described {
            let Some((texture, copies)) = texture_and_copies.split_first() else { continue };
            for copy in copies {
                add_pair(&mut scatters, texture, copy)?;
                pairs += 1;
            }
        }
        progress.advance(batch.len() as u64);
    }
    for scatter in &scatters {
        transaction.put_statistics(&nuisance_key(scatter.feature_set()), &scatter.encode())?;
    }
    let mut settings = transaction.settings().clone();
    settings.further.insert(NUISANCE_SETTING.to_owned(), nuisance.to_string());
    transaction.put_settings(settings)?;
    Ok(pairs)
}

/// Adds a texture and a copy to the scatter of every feature set that both have contributions to.
fn add_pair(scatters: &mut [NuisanceStatistics], texture: &[Contribution], copy: &[Contribution]) -> Result<(), Error> {
    for scatter in scatters {
        let of = |contributions: &[Contribution]| {
            contributions.iter().find(|one| one.feature_set() == scatter.feature_set()).cloned()
        };
        if let Some((texture, copy)) = of(texture).zip(of(copy)) {
            scatter.add(&texture, &copy)?;
        }
    }
    Ok(())
}

/// The contributions of a texture, then those of its copies. A feature set whose views they do not have is left out.
fn with_copies(
    id: u64,
    volume: &Volume,
    nuisance: &Nuisance,
    copies: u64,
    feature_sets: &[FeatureSet],
) -> Result<Vec<Vec<Contribution>>, Error> {
    let mut views: Vec<_> = feature_sets.iter().flat_map(|set| set.views().iter().copied()).collect();
    views.sort_unstable();
    views.dedup();
    let contributions = |volume: &Volume| -> Result<Vec<Contribution>, Error> {
        let described = crate::describe(volume, &views);
        let each = feature_sets.iter().filter_map(|set| Contribution::from_sums(set, &described).transpose());
        Ok(each.collect::<Result<_, _>>()?)
    };
    let copy = |number: u64| contributions(&nuisance.draw(id * MAX_COPIES as u64 + number).apply(volume));
    std::iter::once(contributions(volume)).chain((0..copies).map(copy)).collect()
}

/// At most [`MAX_TEXTURES`] ids of textures whose voxels are stored, evenly spread.
fn sample(transaction: &Transaction) -> Result<Vec<u64>, Error> {
    let mut ids = Vec::new();
    for record in transaction.records() {
        let record = record?;
        if record.voxels.is_some() {
            ids.push(record.id);
        }
    }
    let count = ids.len().min(MAX_TEXTURES);
    Ok((0..count).filter_map(|position| ids.get(position * ids.len() / count).copied()).collect())
}
