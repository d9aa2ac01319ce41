//! Disks that fail: at every operation of everything that writes, in four ways. After each the store opens, is whole, is in
//! the state before or the one after, and the work can be done again.

use std::io;

use hlacdb::hlac::View;
use hlacdb::internals::store::{Reads, Store};
use hlacdb::{Database, Error, Hint, Meta, OpenOptions, Query, ReindexOptions, TagEdit};

use super::{long, volume};
use crate::disk::{Disk, Fault};
use crate::store::migrate::version_0_on;

/// What can be done to a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Act {
    Create,
    Ingest,
    Tag,
    Remove,
    ReindexOptions,
    Compact,
    Migrate,
}

impl Act {
    /// Takes the store from the state before to the state after; or, where it is there already, changes nothing that counts.
    fn run(self, disk: &Disk) -> Result<(), Error> {
        if self == Self::Migrate {
            hlacdb::internals::migrations::migrate_with_backend(disk.clone()).map_err(|error| Error::Io {
                doing: "migrating",
                path: None,
                source: io::Error::other(error),
            })?;
            return Ok(());
        }
        let database = options().open_with_backend(disk.clone())?;
        match self {
            Self::Create | Self::Migrate => {}
            Self::Ingest => {
                let prepare = |n: u64| database.prepare(volume(n, 9), Meta::named(n.to_string()), Default::default());
                let prepared = (10..14).map(prepare).collect::<Result<Vec<_>, _>>()?;
                database.commit(prepared)?;
            }
            Self::Tag => drop(database.tag(1, &TagEdit::new().set("mood", "calm").unset("third"))?),
            Self::Remove => match database.remove([2, 3]) {
                Err(Error::Store(hlacdb::StoreError::NoSuchTexture { .. })) => {}
                removed => drop(removed?),
            },
            Self::ReindexOptions => drop(database.reindex(&ReindexOptions::new().reextract(true), &())?),
            Self::Compact => drop(database.compact(&())?),
        }
        Ok(())
    }
}

fn options() -> OpenOptions {
    OpenOptions::new().views(&[View::Full])
}

/// Textures with names and tags; whether spaces were fitted again.
type Held = (Vec<(u64, String, Vec<(String, String)>)>, bool);

/// What a store holds, to compare states by: textures, tags and how often spaces were fitted (but for that, reindexing twice
/// is reindexing once).
fn told(database: &Database) -> Held {
    let textures = database.textures(&[]).unwrap();
    let fitted =
        !textures.is_empty() && database.query(&Query::texture(textures[0].id).k(1)).unwrap().epoch > FITS_AT_START;
    let each = textures.into_iter().map(|texture| (texture.id.get(), texture.name, texture.tags.into_iter().collect()));
    (each.collect(), fitted)
}

/// The number of fits that `start` leaves: one per doubling.
const FITS_AT_START: u64 = 4;

/// A store of eight textures with a tombstone.
fn start() -> Vec<u8> {
    let disk = Disk::default();
    let database = options().open_with_backend(disk.clone()).unwrap();
    for n in 1..=8 {
        database.add(&volume(n, 9), Meta::named(n.to_string()).tag("third", (n % 3).to_string())).unwrap();
    }
    database.remove([5]).unwrap();
    let epoch = database.query(&Query::texture(1).k(1)).unwrap().epoch;
    assert_eq!(epoch, FITS_AT_START);
    drop(database);
    disk.bytes()
}

fn look(act: Act, bytes: &[u8]) -> Held {
    if act == Act::Migrate {
        // What came from version 0 has no statistics before it is reindexed: the store itself is looked at.
        let store = Store::options().open_with_backend(Disk::with(bytes, None)).unwrap();
        let report = store.read().unwrap().verify(None, &()).unwrap();
        assert!(report.is_ok(), "{:?}", report.damage);
        let records = store.read().unwrap().records().map(|record| record.unwrap()).collect::<Vec<_>>();
        return (records.into_iter().map(|one| (one.id, one.name, one.tags.into_iter().collect())).collect(), false);
    }
    let database = options().open_with_backend(Disk::with(bytes, None)).unwrap();
    let report = database.verify(false, &()).unwrap();
    assert!(report.ok(), "{:?}", report.damage);
    told(&database)
}

/// Runs `act` on a disk that fails at every `stride`-th operation; how many operations were made to fail.
fn sweep(act: Act, fault: Fault, begin: &[u8], stride: u64) -> u64 {
    let calm = Disk::with(begin, None);
    act.run(&calm).unwrap();
    let total = calm.operations();
    let after = look(act, &calm.bytes());
    let nothing = || {
        look(act, &{
            let disk = Disk::default();
            Act::Create.run(&disk).unwrap();
            disk.bytes()
        })
    };
    // A store of version 0 cannot be looked at; its state before is that it needs migration.
    let before = match act {
        Act::Create => nothing(),
        Act::Migrate => (Vec::new(), false),
        _ => look(act, begin),
    };
    let mut failed = 0;
    for at in (0..total).step_by(stride as usize) {
        let disk = Disk::with(begin, Some((at, fault)));
        let outcome = act.run(&disk);
        let bytes = disk.after(at);
        let whole = Disk::with(&bytes, None);
        let found = match act {
            // A store that was never made: its file has no name yet, and is made anew.
            Act::Create if outcome.is_err() => None,
            Act::Migrate => match options().open_with_backend(whole.clone()) {
                Ok(_) => Some(look(act, &bytes)),
                Err(error) => {
                    assert_eq!(error.hint(), Some(Hint::MigrateStore), "{act:?} {fault:?} {at}: {error}");
                    None
                }
            },
            _ => Some(look(act, &bytes)),
        };
        match (&outcome, &found) {
            (Ok(()), found) => {
                assert_eq!(found.as_ref(), Some(&after), "{act:?} {fault:?} {at}: acknowledged and lost")
            }
            (Err(_), Some(found)) => assert!(*found == before || *found == after, "{act:?} {fault:?} {at}: {found:?}"),
            (Err(_), None) => {}
        }
        failed += u64::from(outcome.is_err());
        // The work can be taken up again.
        let again = if act == Act::Create && outcome.is_err() { Disk::default() } else { Disk::with(&bytes, None) };
        act.run(&again).unwrap_or_else(|error| panic!("{act:?} {fault:?} {at}: {error}"));
        assert_eq!(look(act, &again.bytes()), after, "{act:?} {fault:?} {at}: taken up again");
    }
    eprintln!("{act:?} {fault:?}: {} of {total} operations, {failed} of them failed the call", total.div_ceil(stride));
    total
}

/// Everything that writes, every way of failing. Each n-th operation by default, every one with HLACDB_TRUST=long.
#[test]
fn a_failing_disk_leaves_the_state_before_or_after() {
    let start = start();
    let old = version_0_on(Disk::default(), Disk::bytes);
    let mut total = 0;
    for act in [Act::Create, Act::Ingest, Act::Tag, Act::Remove, Act::ReindexOptions, Act::Compact, Act::Migrate] {
        let begin: &[u8] = match act {
            Act::Create => &[],
            Act::Migrate => &old,
            _ => &start,
        };
        for (number, fault) in [Fault::Gone, Fault::Once, Fault::Power, Fault::Full].into_iter().enumerate() {
            // Prime strides, so that repeated patterns of operations are met at different places.
            let stride = if long() { 1 } else { [17, 13, 11, 23][number] };
            total += sweep(act, fault, begin, stride);
        }
    }
    eprintln!("{total} operations in all");
}
