//! What a verification finds.

use std::collections::BTreeMap;

use crate::store::access::snapshot::Snapshot;
use crate::store::damage::Damage;
use crate::store::format::record::Record;
use crate::volume::Volume;

/// What [`Snapshot::verify`] found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct CheckReport {
    /// The number of values that were checked in each table; with a deep check also `volumes`.
    pub checked: BTreeMap<&'static str, u64>,
    /// What is not as it was written, sorted by table and key.
    pub damage: Vec<Damage>,
}

impl CheckReport {
    /// Whether nothing is damaged.
    pub fn is_ok(&self) -> bool {
        self.damage.is_empty()
    }
}

/// The caller's check of a texture whose voxels were decompressed and whose hash matches: it describes the volume again,
/// compares, and returns what is damaged. It is called from several threads.
pub type DeepCheck<'a> = &'a (dyn Fn(&Snapshot, &Record, &Volume) -> Vec<Damage> + Sync);
