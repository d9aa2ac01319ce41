//! Recomputing statistics, sums and moments: what reindexing and repair do.

use std::collections::BTreeSet;

use rayon::prelude::*;

use crate::database::points::contributions::{contributions, contributions_from_moments, describe, full_sums};
use crate::database::points::statistics_cache::StatisticsCache;
use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::hlac::{MASK_COUNT, Sums, View};
use crate::progress::Progress;
use crate::space::{Contribution, Descriptor, Statistics};
use crate::store::{Reads, StoreError, Transaction, ViewCode};
use crate::volume::Volume;

/// Whether sums and moments are written when statistics are rebuilt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rewrite {
    /// Those of all textures whose voxels are stored.
    All,
    /// None.
    Nothing,
}

/// What the voxels of a texture give.
struct Recomputed {
    sums: Option<Sums>,
    moments: Vec<(ViewCode, Option<[f32; MASK_COUNT]>)>,
    contributions: Vec<Contribution>,
}

impl Recomputed {
    fn of(volume: &Volume, scheme: &Scheme) -> Result<Self, Error> {
        let described = describe(volume, scheme);
        let descriptor = Descriptor::from_sums(&described)?;
        let moments = |&view: &View| (ViewCode(view.code()), descriptor.get(view).copied());
        let moments = scheme.views().iter().map(moments).collect();
        Ok(Self { sums: full_sums(&described), moments, contributions: contributions(&described, scheme)? })
    }

    fn write(&self, transaction: &mut Transaction, id: u64) -> Result<(), Error> {
        transaction.set_descriptors(id, &self.moments)?;
        if let Some(sums) = &self.sums {
            transaction.set_sums(id, sums)?;
        }
        Ok(())
    }
}

/// The most voxels in memory at once, unless one volume has more.
const MAX_VOXELS: u64 = 1 << 28;

/// The most textures in memory at once.
const MAX_TEXTURES: usize = 256;

/// Rebuilds the statistics, and writes sums and moments as `rewrite` says. Textures without intact voxels contribute their
/// stored moments, without octants. Returns the number of textures that were written.
///
/// Textures are described in parallel and written in the order of their ids.
///
/// # Errors
/// [`Error::Cancelled`]; [`Error::Store`].
pub(crate) fn rebuild(
    transaction: &mut Transaction,
    statistics_cache: &mut StatisticsCache,
    rewrite: Rewrite,
    progress: &dyn Progress,
) -> Result<u64, Error> {
    progress.begin("describing", Some(transaction.counts().textures));
    let scheme = Scheme::of(transaction);
    let mut statistics: Vec<Statistics> = scheme.feature_sets().iter().map(Statistics::new).collect();
    let mut written = 0;
    let ids: Vec<u64> = transaction.rows()?.live().map(|(_, id)| id).collect();
    let mut ids = ids.into_iter().peekable();
    while ids.peek().is_some() {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let recomputed: Vec<(u64, Option<Result<Recomputed, Error>>)> = next_volumes(transaction, &mut ids)?
            .into_par_iter()
            .map(|(id, volume)| (id, volume.map(|volume| Recomputed::of(&volume, &scheme))))
            .collect();
        progress.advance(recomputed.len() as u64);
        for (id, recomputed) in recomputed {
            let contributions = match recomputed.transpose()? {
                Some(recomputed) => {
                    if rewrite == Rewrite::All {
                        recomputed.write(transaction, id)?;
                        written += 1;
                    }
                    recomputed.contributions
                }
                None => contributions_from_moments(transaction, id, &scheme)?,
            };
            for contribution in &contributions {
                let feature_set = contribution.feature_set();
                if let Some(statistics) = statistics.iter_mut().find(|one| one.feature_set() == feature_set) {
                    statistics.add(contribution)?;
                }
            }
        }
    }
    statistics_cache.replace(statistics);
    Ok(written)
}

/// The next textures with their voxels, as many as may be in memory at once.
fn next_volumes(
    transaction: &Transaction,
    ids: &mut impl Iterator<Item = u64>,
) -> Result<Vec<(u64, Option<Volume>)>, Error> {
    let mut volumes = Vec::new();
    let mut voxels = 0;
    while voxels < MAX_VOXELS && volumes.len() < MAX_TEXTURES {
        let Some(id) = ids.next() else { break };
        let volume = intact_voxels(transaction, id)?;
        voxels += volume.as_ref().map_or(0, |volume| volume.voxels().len() as u64);
        volumes.push((id, volume));
    }
    Ok(volumes)
}

/// The voxels of a texture; `None` if they are not stored or damaged.
fn intact_voxels(state: &impl Reads, id: u64) -> Result<Option<Volume>, Error> {
    match state.voxels(id) {
        Err(StoreError::Damage(damage)) => {
            tracing::debug!("{damage}: texture {id} contributes its stored moments");
            Ok(None)
        }
        read => Ok(read?),
    }
}

/// Restores the sums and moments of textures from their voxels. If the voxels are not intact, only the moments of `full@1`
/// can be restored, from the sums. Returns the textures that have lost something for good.
pub(crate) fn restore_moments(
    transaction: &mut Transaction,
    ids: &BTreeSet<u64>,
    progress: &dyn Progress,
) -> Result<BTreeSet<u64>, Error> {
    progress.begin("describing", Some(ids.len() as u64));
    let scheme = Scheme::of(transaction);
    let mut lost = BTreeSet::new();
    for &id in ids {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        progress.advance(1);
        if let Some(volume) = intact_voxels(transaction, id)? {
            Recomputed::of(&volume, &scheme)?.write(transaction, id)?;
            continue;
        }
        let full = ViewCode(View::Full.code());
        let sums = match transaction.sums(id) {
            Err(StoreError::Damage(_)) => None,
            read => read?,
        };
        if let Some(sums) = sums
            && scheme.views().contains(&View::Full)
            && transaction.descriptor(id, full)?.is_none()
        {
            transaction.set_descriptors(id, &[(full, Some(sums.descriptor()))])?;
        }
        // Whether the texture had moments of other views is not known any more.
        lost.insert(id);
    }
    Ok(lost)
}
