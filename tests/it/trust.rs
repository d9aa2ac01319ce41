//! A store that can be trusted: damage, repair, crashes, several processes, copies, hostile files.
//!
//! What takes long is short by default; `HLACDB_TRUST=long` runs all of it.

mod copies;
mod faults;
mod fixtures;
mod flips;
mod hostile;
mod processes;
mod repair;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hlacdb::volume::Volume;
use hlacdb::{Database, Meta, Query};
use redb::{Builder, ConcurrencyMode, Key, ReadableTable, TableDefinition, Value, WriteTransaction};

/// Whether everything is asked for.
pub(crate) fn long() -> bool {
    std::env::var_os("HLACDB_TRUST").is_some_and(|value| value == "long")
}

/// A small volume, different for every number.
pub(crate) fn volume(number: u64, side: usize) -> Volume {
    let n = number as usize;
    Volume::from_fn([side, side + n % 3, side], |z, y, x| {
        ((z * (n + 1) + y * (n / 3 + 2) + x * 5 + (z * x + n * y) / 7) * 13 % (50 + n % 200)) as u8
    })
    .unwrap()
}

/// A store of `textures` with everything a store can have, and its path.
pub(crate) fn filled(folder: &Path, textures: u64, side: usize) -> PathBuf {
    let path = folder.join("textures.hlacdb");
    let database = Database::open(&path).unwrap();
    let prepared = (1..=textures).map(|n| {
        let meta =
            Meta::named(format!("texture {n}")).tag("third", (n % 3).to_string()).path(format!("/scans/{n}.npy"));
        database.prepare(volume(n, side), meta, Default::default()).unwrap()
    });
    database.commit(prepared.collect()).unwrap();
    path
}

/// What a store says: all that must be the same after damage was repaired.
#[derive(Debug, PartialEq)]
pub(crate) struct Told {
    textures: Vec<hlacdb::Texture>,
    tagged: BTreeMap<hlacdb::TextureId, String>,
    sums: Vec<Option<hlacdb::hlac::Sums>>,
    covariance: Vec<f64>,
    hits: Vec<Vec<(u64, f64)>>,
}

pub(crate) fn told(path: &Path) -> Told {
    let database = Database::open(path).unwrap();
    let textures = database.textures(&[]).unwrap();
    let ids: Vec<u64> = textures.iter().map(|texture| texture.id.get()).collect();
    let ask = |id: u64| {
        let answer = database.query(&Query::texture(id).k(ids.len())).unwrap();
        answer.hits.iter().map(|hit| (hit.id.get(), hit.distance)).collect()
    };
    Told {
        tagged: database.labels("third").unwrap(),
        sums: ids.iter().map(|&id| database.sums(id).unwrap()).collect(),
        covariance: database.covariance().unwrap(),
        hits: ids.iter().take(5).map(|&id| ask(id)).collect(),
        textures,
    }
}

/// Changes a store behind its back.
pub(crate) fn edit(path: &Path, change: impl FnOnce(&WriteTransaction)) {
    let database = Builder::new().set_concurrency_mode(ConcurrencyMode::SingleWriter).open(path).unwrap();
    let mut transaction = database.begin_write().unwrap();
    transaction.set_quick_repair(true);
    change(&transaction);
    transaction.commit().unwrap();
}

/// Flips a bit in the value of the `nth` entry of a table.
pub(crate) fn flip<K: Key + 'static>(
    table: TableDefinition<'static, K, &'static [u8]>,
    nth: usize,
    bit: usize,
) -> impl FnOnce(&WriteTransaction) {
    move |transaction| {
        let mut table = transaction.open_table(table).unwrap();
        let (key, mut value) = {
            let (key, value) = table.iter().unwrap().nth(nth).unwrap().unwrap();
            (K::as_bytes(&key.value()).as_ref().to_vec(), value.value().to_vec())
        };
        let at = bit % (value.len() * 8);
        value[at / 8] ^= 1 << (at % 8);
        table.insert(K::from_bytes(&key), &value[..]).unwrap();
    }
}

/// Takes the first entry of a table away.
pub(crate) fn drop_first<K: Key + 'static, V: Value + 'static>(
    table: TableDefinition<'static, K, V>,
) -> impl FnOnce(&WriteTransaction) {
    move |transaction| drop(transaction.open_table(table).unwrap().pop_first().unwrap().unwrap())
}
