//! Migration of a store of version 0, which only this test ever makes.

use std::path::Path;

use hlacdb::internals::migrations::{CURRENT_VERSION, MigrateOptions, MigrationError, migrate};
use hlacdb::internals::store::{FORMAT_VERSION, OpenError, Reads, Store, StoreError, ViewCode};
use redb::{Builder, ConcurrencyMode, TableDefinition};
use serde::Serialize;
use xxhash_rust::xxh3::xxh3_64;

use super::{Scratch, moments};

/// docs/format.md, version 0.
#[derive(Serialize)]
struct Item {
    name: String,
    shape: [u64; 3],
    channels: u8,
    hash: [u8; 32],
    tags: Vec<(String, String)>,
    moments: Vec<f32>,
}

fn item(id: u64) -> Item {
    Item {
        name: format!("old {id}"),
        shape: [4, 5, 6],
        channels: 1,
        hash: [0; 32].map(|_: u8| (id % 251) as u8),
        tags: vec![("parity".into(), (id % 2).to_string()), ("k".into(), String::new())],
        moments: moments(id).to_vec(),
    }
}

fn stamp(version: u32) -> Vec<u8> {
    let mut bytes = b"hlacdb\r\n".to_vec();
    bytes.extend(version.to_le_bytes());
    bytes.extend(version.to_le_bytes());
    bytes.extend(0_u64.to_le_bytes());
    bytes.extend(xxh3_64(&bytes).to_le_bytes());
    bytes
}

fn version_0(path: &Path, items: impl Iterator<Item = (u64, Item)>) {
    fill(&Builder::new().set_concurrency_mode(ConcurrencyMode::SingleWriter).create(path).unwrap(), items);
}

/// A store of version 0 on a backend, as what `bytes` makes of the backend.
pub(crate) fn version_0_on<B: redb::StorageBackend + Clone>(backend: B, bytes: impl Fn(&B) -> Vec<u8>) -> Vec<u8> {
    let mut builder = Builder::new();
    builder.set_concurrency_mode(ConcurrencyMode::ExclusiveWriter);
    let database = builder.create_with_backend(backend.clone()).unwrap();
    fill(&database, items());
    drop(database);
    bytes(&backend)
}

fn fill(database: &redb::Database, items: impl Iterator<Item = (u64, Item)>) {
    let configuration = bincode::config::standard().with_little_endian().with_fixed_int_encoding();
    let transaction = database.begin_write().unwrap();
    {
        let mut meta = transaction.open_table(TableDefinition::<&[u8], &[u8]>::new("meta")).unwrap();
        meta.insert(&b"format"[..], &stamp(0)[..]).unwrap();
        let mut table = transaction.open_table(TableDefinition::<u64, &[u8]>::new("items")).unwrap();
        for (id, item) in items {
            let bytes = bincode::serde::encode_to_vec(&item, configuration).unwrap();
            table.insert(id, &bytes[..]).unwrap();
        }
    }
    transaction.commit().unwrap();
}

/// Ids with gaps, so that the row blocks' gaps are exercised; hashes must differ.
fn ids() -> impl Iterator<Item = u64> {
    (1..=120).chain(400..=460)
}

fn items() -> impl Iterator<Item = (u64, Item)> {
    ids().enumerate().map(|(number, id)| {
        let mut item = item(id);
        item.hash[..8].copy_from_slice(&(number as u64).to_le_bytes());
        (id, item)
    })
}

#[test]
fn the_hops_lead_to_what_the_store_writes() {
    assert_eq!(CURRENT_VERSION, FORMAT_VERSION);
}

#[test]
fn version_0_becomes_current() {
    let scratch = Scratch::new();
    let path = scratch.path();
    version_0(&path, items());
    let before = std::fs::read(&path).unwrap();
    for open in [Store::open, Store::open_read_only] {
        let error = open(path.clone()).unwrap_err();
        assert!(matches!(error, StoreError::Open(OpenError::NeedsMigration { found: 0, .. })), "{error}");
    }
    let check = MigrateOptions::new().check_only(true);
    assert_eq!(migrate(&path, &check).unwrap().hops.len(), 1);
    assert!(matches!(Store::open(&path), Err(StoreError::Open(OpenError::NeedsMigration { .. }))));

    let backup = path.with_extension("backup");
    let options = MigrateOptions::new().backup(&backup);
    let report = migrate(&path, &options).unwrap();
    assert_eq!(
        (report.from, report.to, report.hops.len(), report.backup),
        (0, CURRENT_VERSION, 1, Some(backup.clone()))
    );
    let store = Store::open(&path).unwrap();
    let state = store.read().unwrap();
    assert_eq!(state.verify(None, &()).unwrap().damage, []);
    assert_eq!((state.counts().textures, state.counts().next_id), (181, 461));
    for (id, item) in items() {
        let record = state.record(id).unwrap().unwrap();
        let content = record.content.unwrap();
        assert_eq!((record.name, content.shape, content.hash), (item.name, item.shape, item.hash));
        assert_eq!(
            record.tags.into_iter().collect::<std::collections::BTreeMap<_, _>>(),
            item.tags.into_iter().collect()
        );
        assert_eq!(state.descriptor(id, ViewCode(0)).unwrap().unwrap(), moments(id));
        assert_eq!(state.find(&item.hash).unwrap(), Some(id));
    }
    assert_eq!(state.tagged("parity", "0").unwrap(), ids().filter(|id| id % 2 == 0).collect::<Vec<_>>());
    let mut transaction = store.write().unwrap();
    assert_eq!(transaction.add(super::texture(1)).unwrap(), 461);
    transaction.remove(400).unwrap();
    transaction.commit().unwrap();
    assert_eq!(store.read().unwrap().verify(None, &()).unwrap().damage, []);
    drop((state, store));

    assert_eq!(migrate(&path, &options).unwrap().hops, [""; 0], "current already: no hop, no backup");
    assert_eq!(migrate(&backup, &check).unwrap().from, 0);
    assert!(std::fs::read(&backup).unwrap().len() >= before.len() / 2);
}

#[test]
fn invalid_data_stop_a_hop_and_leave_the_store_as_it_was() {
    type Change = fn(&mut Item);
    let odd: [(&str, Change); 4] = [
        ("moments", |item| item.moments.truncate(250)),
        ("moments", |item| item.moments[3] = f32::INFINITY),
        ("twice", |item| item.tags.push(("k".into(), String::new()))),
        ("channels", |item| item.channels = 2),
    ];
    for (says, change) in odd {
        let scratch = Scratch::new();
        version_0(
            &scratch.path(),
            items().map(|(id, mut item)| {
                if id == 430 {
                    change(&mut item);
                }
                (id, item)
            }),
        );
        let error = migrate(&scratch.path(), &MigrateOptions::default()).unwrap_err();
        assert!(matches!(&error, MigrationError::Invalid { table: "items", key, .. } if key == "id 430"), "{error}");
        assert!(error.to_string().contains(says), "{error}");
        let check = MigrateOptions::new().check_only(true);
        assert_eq!(migrate(&scratch.path(), &check).unwrap().from, 0);
    }
}

#[test]
fn newer_foreign_and_locked_stores_are_refused() {
    let scratch = Scratch::new();
    let path = scratch.path();
    let options = MigrateOptions::default();
    assert!(matches!(migrate(&path, &options), Err(MigrationError::Io { .. })));
    std::fs::write(&path, b"").unwrap();
    assert!(matches!(migrate(&path, &options), Err(MigrationError::NotAStore { .. })));
    std::fs::remove_file(&path).unwrap();
    let store = scratch.create();
    assert!(matches!(migrate(&path, &options), Err(MigrationError::HeldByWriter { .. })));
    drop(store);
    assert_eq!(migrate(&path, &options).unwrap().hops, [""; 0]);

    let database = Builder::new().set_concurrency_mode(ConcurrencyMode::SingleWriter).open(&path).unwrap();
    let transaction = database.begin_write().unwrap();
    let meta = TableDefinition::<&[u8], &[u8]>::new("meta");
    transaction.open_table(meta).unwrap().insert(&b"format"[..], &stamp(9)[..]).unwrap();
    transaction.commit().unwrap();
    drop(database);
    assert!(matches!(migrate(&path, &options), Err(MigrationError::Newer { found: 9, .. })));
    for open in [Store::open, Store::open_read_only] {
        let error = open(path.clone()).unwrap_err();
        assert!(
            matches!(error, StoreError::Open(OpenError::Newer { found: 9, supported: FORMAT_VERSION, .. })),
            "{error}"
        );
    }
}
