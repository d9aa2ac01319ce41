//! Copies: one consistent state as a store of its own.

use std::fs;
use std::path::Path;

use redb::{Key, Value, WriteTransaction};

use crate::progress::Progress;
use crate::store::access::meta;
use crate::store::access::open::StoreOptions;
use crate::store::access::reads::{Reads, sealed::Source as _};
use crate::store::access::snapshot::Snapshot;
use crate::store::access::tables::WriteTable;
use crate::store::error::StoreError;
use crate::store::format::tables::{
    CHUNKS, DESCRIPTORS, HASHES, META, POINTS, ROWS, SPACES, STATISTICS, SUMS, TAGS, TEXTURES, Table,
};
use crate::store::os::files;
use crate::store::upkeep::job::Job;

/// The number of entries after which progress is reported.
const STEP: u64 = 64;

/// What [`Snapshot::copy_to`] wrote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CopyReport {
    /// The number of entries of all tables.
    pub entries: u64,
    /// The length of the new file in bytes.
    pub bytes: u64,
}

impl Snapshot {
    /// Writes this state as a store of its own at `path`, where nothing may exist. Every entry of every table is copied as it
    /// is, so that ids, rows and revision are the same. A writer may continue meanwhile.
    ///
    /// `verify` gets the state of the finished copy before the file gets its name. If it fails, there is no copy.
    ///
    /// # Errors
    /// [`OpenError::Exists`], [`OpenError::Io`], [`StoreError::Cancelled`], [`StoreError::Damage`] if this state cannot be
    /// read; the error of `verify`.
    pub fn copy_to<E: From<StoreError>>(
        &self,
        path: impl AsRef<Path>,
        progress: &dyn Progress,
        verify: impl FnOnce(&Snapshot) -> Result<(), E>,
    ) -> Result<CopyReport, E> {
        let path = path.as_ref();
        let entries = files::create_whole(path, |file| {
            let target = StoreOptions::default().create_in(path, file, self.settings())?;
            let mut copy = Copy { snapshot: self, job: Job::new("the copy", progress), entries: 0 };
            let transaction = target.begin()?;
            copy.everything(&transaction)?;
            meta::commit(transaction)?;
            target.compact_pages()?;
            verify(&target.read()?)?;
            Ok::<_, E>(copy.entries)
        })?;
        Ok(CopyReport { entries, bytes: fs::metadata(path).map_or(0, |file| file.len()) })
    }
}

struct Copy<'a> {
    snapshot: &'a Snapshot,
    job: Job<'a>,
    entries: u64,
}

impl Copy<'_> {
    fn everything(&mut self, target: &WriteTransaction) -> Result<(), StoreError> {
        self.table(target, META, "copying settings")?;
        self.table(target, TEXTURES, "copying records")?;
        self.table(target, HASHES, "copying hashes")?;
        self.table(target, TAGS, "copying tags")?;
        self.table(target, CHUNKS, "copying voxels")?;
        self.table(target, ROWS, "copying rows")?;
        self.table(target, DESCRIPTORS, "copying descriptors")?;
        self.table(target, SUMS, "copying sums")?;
        self.table(target, STATISTICS, "copying statistics")?;
        self.table(target, SPACES, "copying spaces")?;
        self.table(target, POINTS, "copying points")
    }

    fn table<K: Key + 'static, V: Value + 'static>(
        &mut self,
        target: &WriteTransaction,
        table: Table<K, V>,
        stage: &'static str,
    ) -> Result<(), StoreError> {
        let from = self.snapshot.tables().source.table(table)?;
        let total = from.len()?;
        let mut to = WriteTable::open(target, table)?;
        self.job.begin(stage, total)?;
        for (entry, number) in from.entries()?.zip(1..) {
            let entry = entry?;
            to.insert(entry.key()?, entry.value()?)?;
            self.entries += 1;
            if u64::is_multiple_of(number, STEP) {
                self.job.advance(STEP)?;
            }
        }
        self.job.advance(total % STEP)
    }
}
