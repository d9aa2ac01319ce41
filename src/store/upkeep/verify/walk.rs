//! [`Walk`]: one verification in progress.

use std::collections::{BTreeMap, HashMap};

use super::report::CheckReport;
use crate::progress::Progress;
use crate::store::access::snapshot::Snapshot;
use crate::store::damage::{Damage, DamageKey};
use crate::store::error::StoreError;
use crate::store::format::record::Record;
use crate::store::upkeep::job::Job;

/// The number of values after which progress is reported.
const STEP: u64 = 256;

/// What a record says about other tables.
#[derive(Default)]
pub(crate) struct Expected {
    pub(crate) hash: Option<[u8; 32]>,
    pub(crate) tags: BTreeMap<String, String>,
    pub(crate) chunks: u32,
    pub(crate) bytes: u64,
    pub(crate) has_sums: bool,
}

impl From<Record> for Expected {
    fn from(record: Record) -> Self {
        Self {
            hash: record.content.map(|content| content.hash),
            tags: record.tags,
            chunks: record.voxels.map_or(0, |voxels| voxels.chunks),
            bytes: record.voxels.map_or(0, |voxels| voxels.bytes),
            has_sums: record.has_sums,
        }
    }
}

/// One verification in progress.
pub(crate) struct Walk<'a> {
    pub(crate) snapshot: &'a Snapshot,
    /// What the record of each texture says; `None` for a record that cannot be read.
    pub(crate) textures: HashMap<u64, Option<Expected>>,
    job: Job<'a>,
    found: CheckReport,
}

impl<'a> Walk<'a> {
    pub(crate) fn new(snapshot: &'a Snapshot, progress: &'a dyn Progress) -> Self {
        let mut found = CheckReport::default();
        found.checked.insert("meta", 3);
        Self { snapshot, textures: HashMap::new(), job: Job::new("verification", progress), found }
    }

    /// What was found.
    pub(crate) fn finish(mut self) -> CheckReport {
        self.found.damage.sort();
        self.found.damage.dedup();
        self.found
    }

    /// Runs the check of one table. Damage that ends it goes into the report, and the next table can be checked.
    pub(crate) fn table(&mut self, check: impl FnOnce(&mut Self) -> Result<(), StoreError>) -> Result<(), StoreError> {
        let done = check(self);
        self.contain(done)
    }

    /// Moves damage into the report; other errors are returned.
    pub(crate) fn contain(&mut self, done: Result<(), StoreError>) -> Result<(), StoreError> {
        match done {
            Err(StoreError::Damage(damage)) => {
                self.found.damage.push(damage);
                Ok(())
            }
            other => other,
        }
    }

    /// Adds damage to the report.
    pub(crate) fn damage(&mut self, table: &'static str, key: DamageKey, what: impl Into<String>) {
        self.add(Damage::new(table, key, what));
    }

    /// Adds damage to the report.
    pub(crate) fn add(&mut self, damage: Damage) {
        self.found.damage.push(damage);
    }

    /// The damage that was found so far.
    pub(crate) fn damage_so_far(&self) -> &[Damage] {
        &self.found.damage
    }

    /// Begins a table of `total` values, so that it is in the report even if it is empty.
    pub(crate) fn begin(&mut self, table: &'static str, stage: &'static str, total: u64) -> Result<(), StoreError> {
        self.found.checked.insert(table, 0);
        self.job.begin(stage, total)
    }

    /// Counts a value of a table as checked.
    pub(crate) fn count(&mut self, table: &'static str) -> Result<(), StoreError> {
        let checked = self.found.checked.entry(table).or_default();
        *checked += 1;
        match checked.is_multiple_of(STEP) {
            true => self.job.advance(STEP),
            false => Ok(()),
        }
    }

    /// Counts `more` slow steps as checked, and reports them at once.
    pub(crate) fn count_slow(&mut self, table: &'static str, more: u64) -> Result<(), StoreError> {
        *self.found.checked.entry(table).or_default() += more;
        self.job.advance(more)
    }

    /// The value at `key` belongs to the texture `id`, whose record must exist and satisfy `matches`. Nothing is expected of
    /// a record that cannot be read: it is reported already.
    pub(crate) fn expect(
        &mut self,
        table: &'static str,
        key: DamageKey,
        id: u64,
        matches: impl Fn(&Expected) -> bool,
        otherwise: &str,
    ) {
        match self.textures.get(&id) {
            None => self.damage(table, key, format!("it belongs to texture {id}, which does not exist")),
            Some(Some(expected)) if !matches(expected) => {
                self.damage(table, key, format!("texture {id} {otherwise}"));
            }
            Some(_) => {}
        }
    }

    /// Calls `check` for every texture whose record can be read.
    pub(crate) fn each_texture(
        &mut self,
        mut check: impl FnMut(&mut Self, u64, &Expected) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let textures = std::mem::take(&mut self.textures);
        let mut readable = textures.iter().filter_map(|(&id, expected)| Some((id, expected.as_ref()?)));
        let done = readable.try_for_each(|(id, expected)| check(self, id, expected));
        self.textures = textures;
        done
    }
}
