//! Verification: every value, every checksum, every link between tables.

mod blocks;
mod report;
mod textures;
mod volumes;
mod walk;

pub use report::{CheckReport, DeepCheck};

use crate::progress::Progress;
use crate::store::access::snapshot::Snapshot;
use crate::store::error::StoreError;
use walk::Walk;

impl Snapshot {
    /// Checks everything: frames and checksums, counts, and the links between tables in both directions. Damage does not stop
    /// it. With `deep`, voxels are decompressed and hashed as well and each volume is passed to `deep`, as many at once as
    /// rayon has threads.
    ///
    /// # Errors
    /// [`StoreError::Cancelled`], [`StoreError::Engine`]; damage is not an error but part of the report.
    pub fn verify(&self, deep: Option<DeepCheck<'_>>, progress: &dyn Progress) -> Result<CheckReport, StoreError> {
        let mut walk = Walk::new(self, progress);
        walk.textures()?;
        walk.blocks()?;
        if let Some(deep) = deep {
            walk.volumes(deep)?;
        }
        Ok(walk.finish())
    }
}
