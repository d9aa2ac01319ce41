//! Voxels: decompressed, hashed, and passed to the caller's check.

use rayon::prelude::*;

use super::report::DeepCheck;
use super::walk::{Expected, Walk};
use crate::store::access::reads::Reads;
use crate::store::access::snapshot::Snapshot;
use crate::store::damage::{Damage, DamageKey};
use crate::store::error::StoreError;
use crate::store::format::tables::CHUNKS;

/// The name of volumes in the report.
const VOLUMES: &str = "volumes";

impl Walk<'_> {
    /// Checks the voxels of every texture that has any.
    pub(crate) fn volumes(&mut self, deep: DeepCheck<'_>) -> Result<(), StoreError> {
        let snapshot = self.snapshot;
        let with_voxels = |(&id, expected): (&u64, &Option<Expected>)| {
            expected.as_ref().filter(|expected| expected.chunks > 0).map(|_| id)
        };
        let mut ids: Vec<u64> = self.textures.iter().filter_map(with_voxels).collect();
        ids.sort_unstable();
        self.begin(VOLUMES, "checking volumes", ids.len() as u64)?;
        for batch in ids.chunks(rayon::current_num_threads()) {
            let found: Vec<Result<Vec<Damage>, StoreError>> =
                batch.par_iter().map(|&id| check_volume(snapshot, id, deep)).collect();
            for found in found {
                let done = found.map(|damage| damage.into_iter().for_each(|one| self.add(one)));
                self.contain(done)?;
            }
            self.count_slow(VOLUMES, batch.len() as u64)?;
        }
        Ok(())
    }
}

fn check_volume(snapshot: &Snapshot, id: u64, deep: DeepCheck<'_>) -> Result<Vec<Damage>, StoreError> {
    let (Some(record), Some(volume)) = (snapshot.record(id)?, snapshot.voxels(id)?) else { return Ok(Vec::new()) };
    if record.content.as_ref().is_none_or(|content| content.hash != volume.content_hash()) {
        let what = "the voxels do not have the hash of the record";
        return Ok(vec![Damage::new(CHUNKS.name, DamageKey::Texture(id), what)]);
    }
    Ok(deep(snapshot, &record, &volume))
}
