//! Copies: a consistent snapshot as a store of its own.

use std::fs;
use std::path::Path;

use redb::{Key, TableDefinition, Value, WriteTransaction};

use crate::store::access::handle::{Options, Store, give_name, passing_name};
use crate::store::access::reads::Reads;
use crate::store::access::reads::sealed::Source as _;
use crate::store::access::snapshot::Snapshot;
use crate::store::error::StoreError;
use crate::store::format::keys;
use crate::store::open_error::OpenError;
use crate::store::progress::{Report, silent, tell};

const DOING: &str = "the copy";
/// The caller is told after as many entries.
const STEP: u64 = 64;

/// What [`Snapshot::copy_to`] wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Copied {
    /// Entries of all tables.
    pub entries: u64,
    /// The length of the new file in bytes.
    pub bytes: u64,
}

impl Snapshot {
    /// Writes this state as a store of its own at `path`, where nothing may be: every entry of every table as it is, so that
    /// ids, rows and revision are the same. A writer may go on meanwhile. The copy is verified before it gets its name.
    ///
    /// # Errors
    /// [`OpenError::Exists`], [`OpenError::Io`], [`StoreError::Cancelled`]; [`StoreError::Damage`] where this state, and
    /// so the copy, is damaged: then there is no copy.
    pub fn copy_to(&self, path: impl AsRef<Path>, report: Report<'_>) -> Result<Copied, StoreError> {
        let path = path.as_ref();
        if path.symlink_metadata().is_ok() {
            return Err(StoreError::Open(OpenError::Exists { path: path.into() }));
        }
        let passing = passing_name(path);
        let made = self.copy_under(&passing, report).and_then(|entries| {
            give_name(&passing, path).map_err(|source| match source.kind() {
                std::io::ErrorKind::AlreadyExists => StoreError::Open(OpenError::Exists { path: path.into() }),
                _ => StoreError::Open(OpenError::Io { doing: "creating", path: path.into(), source }),
            })?;
            Ok(Copied { entries, bytes: fs::metadata(path).map_or(0, |file| file.len()) })
        });
        if made.is_err() {
            // The failure is what matters; a passing file that cannot be removed is harmless.
            let _ = fs::remove_file(&passing);
        }
        made
    }

    fn copy_under(&self, passing: &Path, report: Report<'_>) -> Result<u64, StoreError> {
        let target = Options::default().create(passing, self.settings())?;
        let mut copy = Copy { snapshot: self, report, entries: 0 };
        target.rewrite(|transaction| copy.everything(transaction))?;
        let entries = copy.entries;
        target.compact_pages()?;
        let found = target.read()?.verify(None, &mut silent)?;
        match found.damage.into_iter().next() {
            Some(damage) => Err(damage.into()),
            None => Ok(entries),
        }
    }
}

struct Copy<'a, 'r> {
    snapshot: &'a Snapshot,
    report: Report<'r>,
    entries: u64,
}

impl Copy<'_, '_> {
    fn everything(&mut self, target: &WriteTransaction) -> Result<(), StoreError> {
        self.table(target, keys::META, "copying settings")?;
        self.table(target, keys::TEXTURES, "copying records")?;
        self.table(target, keys::HASHES, "copying hashes")?;
        self.table(target, keys::TAGS, "copying tags")?;
        self.table(target, keys::CHUNKS, "copying voxels")?;
        self.table(target, keys::ROWS, "copying rows")?;
        self.table(target, keys::DESCRIPTORS, "copying descriptors")?;
        self.table(target, keys::SUMS, "copying sums")?;
        self.table(target, keys::STATISTICS, "copying statistics")?;
        self.table(target, keys::SPACES, "copying spaces")?;
        self.table(target, keys::POINTS, "copying points")
    }

    fn table<K, V>(
        &mut self,
        target: &WriteTransaction,
        definition: TableDefinition<'static, K, V>,
        phase: &'static str,
    ) -> Result<(), StoreError>
    where
        K: Key + 'static,
        V: Value + 'static,
    {
        let from = self.snapshot.tables().source.table(definition)?;
        let total = from.len()?;
        let mut to = target.open_table(definition).map_err(StoreError::when("opening a table"))?;
        tell(self.report, DOING, phase, 0, total)?;
        for (number, entry) in (1..).zip(from.range::<K::SelfType<'_>>(..)?) {
            let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
            to.insert(key.value(), value.value()).map_err(StoreError::when("writing the copy"))?;
            self.entries += 1;
            if u64::is_multiple_of(number, STEP) || number == total {
                tell(self.report, DOING, phase, number, total)?;
            }
        }
        Ok(())
    }
}

impl Store {
    /// One transaction over the bare tables.
    pub(in crate::store) fn rewrite(
        &self,
        act: impl FnOnce(&WriteTransaction) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let transaction = self.begin()?;
        crate::store::os::panic_boundary::guarded("(file)", || act(&transaction))?;
        transaction.commit().map_err(StoreError::when("committing"))
    }
}
