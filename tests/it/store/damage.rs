//! Damaged stores: what is wrong is named by table and key, and nothing panics.

use std::path::Path;

use hlacdb::internals::store::{Damage, DamageKey, NewTexture, OpenError, Reads, Store, StoreError, ViewCode};
use redb::{ReadableTable, WriteTransaction};

use super::{Scratch, moments, texture};
use crate::tables::{CHUNKS, DESCRIPTORS, HASHES, META, POINTS, ROWS, SPACES, STATISTICS, SUMS, TAGS, TEXTURES};
use crate::trust::{drop_first, edit, flip};

/// A small store with something in every table.
fn filled() -> Scratch {
    let scratch = Scratch::new();
    let store = scratch.create();
    let mut transaction = store.write().unwrap();
    for seed in 1..=3 {
        transaction.add(texture(seed)).unwrap();
    }
    for seed in 0..300 {
        let descriptors = vec![(ViewCode(0), moments(seed))];
        transaction.add(NewTexture { descriptors, ..NewTexture::default() }).unwrap();
    }
    transaction.put_statistics("full", &[1; 10_000]).unwrap();
    transaction.put_space("default", &[2; 100]).unwrap();
    transaction.begin_points("default", &[2, 500]).unwrap();
    transaction.append_points("default", &[&[0.5; 606], &vec![0.25; 151_500]]).unwrap();
    transaction.commit().unwrap();
    drop(store);
    scratch
}

fn damage_of(path: &Path) -> Vec<Damage> {
    let store = Store::open_read_only(path).unwrap();
    store.read().unwrap().verify(Some(&|_, _, _| Vec::new()), &()).unwrap().damage
}

/// The change is found by `verify`, and all damage is told of `table`.
#[track_caller]
fn found(table: &str, key: &str, change: impl FnOnce(&WriteTransaction)) {
    let scratch = filled();
    edit(&scratch.path(), change);
    let damage = damage_of(&scratch.path());
    let names = |one: &Damage| one.table == table && one.key.to_string().contains(key);
    assert!(damage.iter().any(names), "{table} {key}: {damage:?}");
    assert!(damage.iter().all(|one| one.table == table), "{table}: {damage:?}");
}

#[test]
fn a_flipped_bit_in_any_table_is_named() {
    for bit in [3, 40, 70, 131, 100_003] {
        found("textures", "id 1", flip(TEXTURES, 0, bit));
        found("sums", "id 2", flip(SUMS, 1, bit));
        found("chunks", "id 1, chunk 0", flip(CHUNKS, 0, bit));
        found("rows", "block 0", flip(ROWS, 0, bit));
        found("descriptors", "view 0, block 1", flip(DESCRIPTORS, 1, bit));
        found("statistics", "full", flip(STATISTICS, 1, bit));
        found("spaces", "default", flip(SPACES, 0, bit));
        found("points", "space default", flip(POINTS, 0, bit));
        found("points", "space default, part 1, block 1", flip(POINTS, 3, bit));
    }
    let flip_hash = |transaction: &WriteTransaction| {
        let mut table = transaction.open_table(HASHES).unwrap();
        let (key, mut value) = {
            let (key, value) = table.first().unwrap().unwrap();
            (*key.value(), *value.value())
        };
        value[1] ^= 1;
        table.insert(&key, &value).unwrap();
    };
    found("hashes", "", flip_hash);
    let flip_tag = |transaction: &WriteTransaction| {
        let mut table = transaction.open_table(TAGS).unwrap();
        let mut key = table.first().unwrap().unwrap().0.value().to_vec();
        let sum = *table.remove(&key[..]).unwrap().unwrap().value();
        key[0] ^= 1;
        table.insert(&key[..], &sum).unwrap();
    };
    found("tags", "", flip_tag);
}

#[test]
fn missing_and_stray_entries_are_named() {
    found("hashes", "id ", drop_first(HASHES));
    found("tags", "id ", drop_first(TAGS));
    found("sums", "id 1", drop_first(SUMS));
    found("chunks", "id 1", drop_first(CHUNKS));
    found("rows", "block 0", drop_first(ROWS));
    found("statistics", "full", drop_first(STATISTICS));
    found("points", "space default", drop_first(POINTS));
    // Intact values at a wrong key.
    found("sums", "id 77", |transaction| {
        let mut table = transaction.open_table(SUMS).unwrap();
        let value = table.get(1).unwrap().unwrap().value().to_vec();
        table.insert(77, &value[..]).unwrap();
    });
    found("descriptors", "view 0, block 9", |transaction| {
        let mut table = transaction.open_table(DESCRIPTORS).unwrap();
        let value = table.get((0, 0)).unwrap().unwrap().value().to_vec();
        table.insert((0, 9), &value[..]).unwrap();
    });
    // A record that is gone leaves its row, hash, tags, voxels and sums without an owner, and the count wrong.
    let scratch = filled();
    edit(&scratch.path(), drop_first(TEXTURES));
    let tables: Vec<_> = damage_of(&scratch.path()).into_iter().map(|one| one.table).collect();
    for table in ["meta", "rows", "hashes", "tags", "chunks", "sums"] {
        assert!(tables.contains(&table), "{table}: {tables:?}");
    }
}

#[test]
fn reading_what_is_damaged_is_an_error_and_the_rest_goes_on() {
    let scratch = filled();
    edit(&scratch.path(), flip(TEXTURES, 1, 500));
    edit(&scratch.path(), flip(CHUNKS, 0, 500));
    edit(&scratch.path(), flip(DESCRIPTORS, 0, 500));
    let store = Store::open(scratch.path()).unwrap();
    let state = store.read().unwrap();
    let named = |error: StoreError| match error {
        StoreError::Damage(damage) => (damage.table, damage.key.to_string()),
        other => panic!("{other}"),
    };
    assert_eq!(named(state.record(2).unwrap_err()), ("textures", "id 2".to_owned()));
    assert_eq!(named(state.voxels(1).unwrap_err()), ("chunks", "id 1, chunk 0".to_owned()));
    assert_eq!(named(state.descriptor(5, ViewCode(0)).unwrap_err()), ("descriptors", "view 0, block 0".to_owned()));
    assert_eq!((state.records().count(), state.records().filter(Result::is_err).count()), (303, 1));
    assert_eq!(state.descriptor(303, ViewCode(0)).unwrap().unwrap(), moments(299));
    assert!(state.voxels(3).unwrap().is_some() && state.record(1).unwrap().is_some());
    // A failed removal leaves the transaction usable: nothing was written.
    let mut transaction = store.write().unwrap();
    assert!(matches!(transaction.remove(2), Err(StoreError::Damage(_))));
    transaction.remove(3).unwrap();
    // A failed write does not: it may be half done.
    assert!(matches!(transaction.set_descriptors(9, &[(ViewCode(0), None)]), Err(StoreError::Damage(_))));
    assert!(matches!(transaction.commit(), Err(StoreError::Broken)));
    assert_eq!(store.read().unwrap().counts().textures, 303);
}

#[test]
fn a_damaged_head_is_told_on_opening() {
    for (nth, key) in [(0, "format"), (1, "settings"), (2, "state")] {
        let scratch = filled();
        edit(&scratch.path(), flip(META, nth, 77));
        let opened = Store::open(scratch.path()).and_then(|store| store.read().map(drop));
        match opened.unwrap_err() {
            StoreError::Damage(damage) | StoreError::Open(OpenError::DamagedFile { damage, .. }) => {
                assert_eq!((damage.table, damage.key.to_string().as_str()), ("meta", key));
            }
            other => panic!("{other}"),
        }
    }
}

/// A page of zeros makes the engine panic: that is damage of the table's pages.
#[test]
fn a_panic_of_the_engine_on_a_damaged_page_is_damage() {
    let scratch = filled();
    let whole = std::fs::read(scratch.path()).unwrap();
    let mut panicked = 0;
    for page in (1..whole.len() / 4096).step_by(3) {
        let mut bytes = whole.clone();
        bytes[page * 4096..(page + 1) * 4096].fill(0);
        std::fs::write(scratch.path(), &bytes).unwrap();
        let found = match Store::open(scratch.path()).and_then(|store| store.read()?.verify(None, &())) {
            Ok(report) => report.damage,
            Err(StoreError::Damage(damage) | StoreError::Open(OpenError::DamagedFile { damage, .. })) => vec![damage],
            Err(error) => panic!("page {page}: {error}"),
        };
        panicked += found.iter().filter(|one| one.key == DamageKey::Pages && one.what.contains("panicked")).count();
    }
    assert!(panicked > 0);
}
