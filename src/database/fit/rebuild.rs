//! Statistics, sums and moments from nothing: what reindexing with `reextract` and repairing do.

use std::collections::BTreeSet;

use rayon::prelude::*;

use crate::database::points::contributions::{contributions, contributions_of_moments, full_sums, with_full};
use crate::database::points::statistics_cache::StatisticsCache;
use crate::database::scheme::Scheme;
use crate::error::Error;
use crate::hlac::{MASK_COUNT, Sums, View};
use crate::progress::Progress;
use crate::space::{Contribution, Descriptor, Statistics};
use crate::store::{Reads, StoreError, Transaction, ViewCode};
use crate::volume::Volume;

/// Which textures are written anew while statistics are rebuilt.
pub(crate) enum Rewrite<'a> {
    /// All whose voxels are kept.
    All,
    /// These, where their voxels are whole.
    These(&'a BTreeSet<u64>),
}

impl Rewrite<'_> {
    fn includes(&self, id: u64) -> bool {
        match self {
            Self::All => true,
            Self::These(ids) => ids.contains(&id),
        }
    }
}

/// A texture's voxels described: sums, moments by view, and what it adds to the statistics.
struct Recomputed {
    sums: Option<Sums>,
    moments: Vec<(ViewCode, Option<[f32; MASK_COUNT]>)>,
    parts: Vec<Contribution>,
}

impl Recomputed {
    fn of(volume: &Volume, views: &Scheme) -> Result<Self, Error> {
        let described = crate::describe(volume, &with_full(views.views()));
        let descriptor = Descriptor::from_sums(&described)?;
        let moments = views.views().iter().map(|&view| (ViewCode(view.code()), descriptor.get(view).copied()));
        Ok(Self { sums: full_sums(&described), moments: moments.collect(), parts: contributions(&described, views)? })
    }

    fn write(&self, transaction: &mut Transaction, id: u64) -> Result<(), Error> {
        transaction.set_descriptors(id, &self.moments)?;
        if let Some(sums) = &self.sums {
            transaction.set_sums(id, sums)?;
        }
        Ok(())
    }
}

/// So many voxels are in memory at once, at most, unless one volume has more.
const VOXELS_AT_ONCE: u64 = 1 << 28;

/// Builds the statistics from nothing, and describes textures anew as `rewrite` says: of textures whose voxels are not kept
/// (or not whole) the moments count as they are, without octants. Returns how many were written anew.
///
/// Textures are described in parallel and written in the order of their ids.
///
/// # Errors
/// [`Error::Cancelled`]; [`Error::Store`].
pub(crate) fn rebuild(
    transaction: &mut Transaction,
    statistics_cache: &mut StatisticsCache,
    rewrite: &Rewrite<'_>,
    progress: &dyn Progress,
) -> Result<u64, Error> {
    progress.begin("describing", Some(transaction.counts().textures));
    let views = Scheme::of(transaction);
    let mut statistics: Vec<Statistics> = views.recipes().iter().map(Statistics::new).collect();
    let mut written = 0;
    let ids: Vec<u64> = transaction.rows()?.live().map(|(_, id)| id).collect();
    let mut ids = ids.into_iter().peekable();
    while ids.peek().is_some() {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let some = gather(transaction, &mut ids)?;
        let described: Vec<(u64, Option<Result<Recomputed, Error>>)> = some
            .into_par_iter()
            .map(|(id, volume)| (id, volume.map(|volume| Recomputed::of(&volume, &views))))
            .collect();
        progress.advance(described.len() as u64);
        for (id, anew) in described {
            let parts = match anew.transpose()? {
                Some(anew) => {
                    if rewrite.includes(id) {
                        anew.write(transaction, id)?;
                        written += 1;
                    }
                    anew.parts
                }
                None => contributions_of_moments(transaction, id, &views)?,
            };
            for part in &parts {
                if let Some(kept) = statistics.iter_mut().find(|kept| kept.feature_set() == part.feature_set()) {
                    kept.add(part)?;
                }
            }
        }
    }
    statistics_cache.replace(statistics);
    Ok(written)
}

/// The next textures with their voxels, as many as may be in memory at once.
fn gather(transaction: &Transaction, ids: &mut impl Iterator<Item = u64>) -> Result<Vec<(u64, Option<Volume>)>, Error> {
    let mut some = Vec::new();
    let mut voxels = 0;
    while voxels < VOXELS_AT_ONCE && some.len() < 256 {
        let Some(id) = ids.next() else { break };
        let volume = whole_voxels(transaction, id)?;
        voxels += volume.as_ref().map_or(0, |volume| volume.voxels().len() as u64);
        some.push((id, volume));
    }
    Ok(some)
}

/// A texture's voxels; `None` where they are not kept or not whole.
pub(crate) fn whole_voxels(state: &impl Reads, id: u64) -> Result<Option<Volume>, Error> {
    match state.voxels(id) {
        Err(StoreError::Damage(damage)) => {
            tracing::debug!("{damage}: texture {id} counts by the moments that are kept of it");
            Ok(None)
        }
        read => Ok(read?),
    }
}

/// Describes textures anew from their voxels; of those whose voxels are not whole, the moments of `full@1` come from the sums.
/// Returns those of which more was lost than that.
pub(crate) fn describe_anew(
    transaction: &mut Transaction,
    ids: &BTreeSet<u64>,
    progress: &dyn Progress,
) -> Result<BTreeSet<u64>, Error> {
    progress.begin("describing", Some(ids.len() as u64));
    let views = Scheme::of(transaction);
    let mut lost = BTreeSet::new();
    for &id in ids {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        progress.advance(1);
        if let Some(volume) = whole_voxels(transaction, id)? {
            Recomputed::of(&volume, &views)?.write(transaction, id)?;
            continue;
        }
        let full = ViewCode(View::Full.code());
        let sums = match transaction.sums(id) {
            Err(StoreError::Damage(_)) => None,
            read => read?,
        };
        if let Some(sums) = sums
            && views.views().contains(&View::Full)
            && transaction.descriptor(id, full)?.is_none()
        {
            transaction.set_descriptors(id, &[(full, Some(sums.descriptor()))])?;
        }
        // What the voxels would have told of other views nobody knows: the texture may lack them by right.
        lost.insert(id);
    }
    Ok(lost)
}
