//! Version 0 to 1: bare items become framed records, rows and descriptor blocks.
//!
//! docs/format.md describes both layouts. The code that writes version 1 belongs to this hop and is frozen with it.

use std::collections::BTreeMap;

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use redb::{ReadableTable, TableDefinition, WriteTransaction};
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::xxh3_64;

use super::MigrationError;

const ITEMS: TableDefinition<u64, &[u8]> = TableDefinition::new("items");
const META: TableDefinition<&[u8], &[u8]> = TableDefinition::new("meta");
const TEXTURES: TableDefinition<u64, &[u8]> = TableDefinition::new("textures");
const HASHES: TableDefinition<&[u8; 32], &[u8; 12]> = TableDefinition::new("hashes");
const TAGS: TableDefinition<&[u8], &[u8; 4]> = TableDefinition::new("tags");
const CHUNKS: TableDefinition<(u64, u32), &[u8]> = TableDefinition::new("chunks");
const ROWS: TableDefinition<u32, &[u8]> = TableDefinition::new("rows");
const DESCRIPTORS: TableDefinition<(u8, u32), &[u8]> = TableDefinition::new("descriptors");
const SUMS: TableDefinition<u64, &[u8]> = TableDefinition::new("sums");
const STATISTICS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("statistics");
const SPACES: TableDefinition<&[u8], &[u8]> = TableDefinition::new("spaces");
const POINTS: TableDefinition<&[u8], &[u8]> = TableDefinition::new("points");

const MASKS: usize = 251;
const ROW_BLOCK: u64 = 1024;
const DESCRIPTOR_BLOCK: u64 = 256;
/// The code of the view full@1.
const FULL: u8 = 0;

const fn bincode_v1() -> Configuration<LittleEndian, Fixint, Limit<{ 1 << 24 }>> {
    bincode::config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<{ 1 << 24 }>()
}

/// A texture in version 0.
#[derive(Deserialize)]
struct Item {
    name: String,
    shape: [u64; 3],
    channels: u8,
    hash: [u8; 32],
    tags: Vec<(String, String)>,
    moments: Vec<f32>,
}

/// A record of version 1 with the fields that version 0 has.
#[derive(Serialize)]
struct Record {
    name: String,
    path: Option<Vec<u8>>,
    content: Option<([u64; 3], u8, [u8; 32])>,
    provenance: Option<()>,
    cut: Option<()>,
    tags: BTreeMap<String, String>,
    voxels: Option<()>,
    has_sums: bool,
}

/// Rows that are collected until their block is full.
#[derive(Default)]
struct Blocks {
    rows: u64,
    ids: Vec<u64>,
    moments: Vec<f32>,
}

pub(super) fn run(transaction: &WriteTransaction) -> Result<(), MigrationError> {
    create_tables(transaction).map_err(MigrationError::engine)?;
    let mut blocks = Blocks::default();
    let mut next_id = 1;
    {
        let items = transaction.open_table(ITEMS).map_err(MigrationError::engine)?;
        for entry in items.iter().map_err(MigrationError::engine)? {
            let (key, value) = entry.map_err(MigrationError::engine)?;
            let id = key.value();
            let invalid = |what: String| MigrationError::invalid("items", format!("id {id}"), what);
            let item = decode(value.value()).map_err(invalid)?;
            if id == 0 || id == u64::MAX {
                return Err(invalid("ids start at 1".into()));
            }
            next_id = id + 1;
            blocks.push(transaction, id, &item.moments)?;
            insert(transaction, id, item)?;
        }
    }
    blocks.finish(transaction)?;
    let count = blocks.rows;
    // Settings: views [full@1], volumes kept, nothing further. State: revision, next id, textures, rows.
    put_meta(transaction, 1, b"settings", &(vec![FULL], 0_u32, BTreeMap::<String, String>::new()))?;
    put_meta(transaction, 2, b"state", &[1, next_id, count, count])?;
    transaction.delete_table(ITEMS).map(drop).map_err(MigrationError::engine)
}

fn create_tables(transaction: &WriteTransaction) -> Result<(), redb::TableError> {
    transaction.open_table(TEXTURES)?;
    transaction.open_table(HASHES)?;
    transaction.open_table(TAGS)?;
    transaction.open_table(CHUNKS)?;
    transaction.open_table(ROWS)?;
    transaction.open_table(DESCRIPTORS)?;
    transaction.open_table(SUMS)?;
    transaction.open_table(STATISTICS)?;
    transaction.open_table(SPACES)?;
    transaction.open_table(POINTS)?;
    Ok(())
}

/// Decodes an item; the error says what version 0 does not allow in it.
fn decode(bytes: &[u8]) -> Result<Item, String> {
    let (item, used): (Item, usize) = bincode::serde::decode_from_slice(bytes, bincode_v1())
        .map_err(|error| format!("the item cannot be decoded: {error}"))?;
    if used != bytes.len() {
        return Err(format!("the item ends after {used} of {} bytes", bytes.len()));
    }
    if item.moments.len() != MASKS || !item.moments.iter().all(|moment| moment.is_finite()) {
        return Err(format!("{} moments, expected {MASKS} finite ones", item.moments.len()));
    }
    if item.channels != 1 && item.channels != 3 || item.shape.iter().any(|&side| side < 3) {
        return Err(format!("shape {:?} with {} channels is not a volume", item.shape, item.channels));
    }
    for (number, (key, value)) in item.tags.iter().enumerate() {
        if !(1..=255).contains(&key.len()) || value.len() > 4096 || key.contains('\0') || value.contains('\0') {
            return Err(format!("the tag {} is malformed", key.escape_debug()));
        }
        if item.tags.iter().take(number).any(|(other, _)| other == key) {
            return Err(format!("the tag {} is given twice", key.escape_debug()));
        }
    }
    Ok(item)
}

/// Record, hash and tags.
fn insert(transaction: &WriteTransaction, id: u64, item: Item) -> Result<(), MigrationError> {
    let Item { name, shape, channels, hash, tags, moments: _ } = item;
    let mut table = transaction.open_table(HASHES).map_err(MigrationError::engine)?;
    let sum = short_sum(&[&hash[..], &id.to_le_bytes()].concat());
    let mut value = [0; 12];
    for (byte, from) in value.iter_mut().zip(id.to_le_bytes().into_iter().chain(sum)) {
        *byte = from;
    }
    if table.insert(&hash, &value).map_err(MigrationError::engine)?.is_some() {
        return Err(MigrationError::invalid("items", format!("id {id}"), "two items have the same hash"));
    }
    let mut table = transaction.open_table(TAGS).map_err(MigrationError::engine)?;
    for (tag, text) in &tags {
        let mut key = format!("{tag}\0{text}\0").into_bytes();
        key.extend(id.to_be_bytes());
        table.insert(&key[..], &short_sum(&key)).map_err(MigrationError::engine)?;
    }
    let record = Record {
        name,
        path: None,
        content: Some((shape, channels, hash)),
        provenance: None,
        cut: None,
        tags: tags.into_iter().collect(),
        voxels: None,
        has_sums: false,
    };
    let payload = encode(&record)?;
    let mut table = transaction.open_table(TEXTURES).map_err(MigrationError::engine)?;
    let value = frame(3, &id.to_le_bytes(), &payload);
    table.insert(id, &value[..]).map(drop).map_err(MigrationError::engine)
}

impl Blocks {
    fn push(&mut self, transaction: &WriteTransaction, id: u64, moments: &[f32]) -> Result<(), MigrationError> {
        self.ids.push(id);
        self.moments.extend_from_slice(moments);
        self.rows += 1;
        if self.rows.is_multiple_of(ROW_BLOCK) {
            self.write_rows(transaction)?;
        }
        if self.rows.is_multiple_of(DESCRIPTOR_BLOCK) {
            self.write_descriptors(transaction)?;
        }
        Ok(())
    }

    fn finish(&mut self, transaction: &WriteTransaction) -> Result<(), MigrationError> {
        self.write_rows(transaction)?;
        self.write_descriptors(transaction)
    }

    fn write_rows(&mut self, transaction: &WriteTransaction) -> Result<(), MigrationError> {
        let ids = std::mem::take(&mut self.ids);
        let Some(&first) = ids.first() else { return Ok(()) };
        let mut payload = (ids.len() as u64).to_le_bytes().to_vec();
        payload.extend(first.to_le_bytes());
        payload.extend(all_set(ids.len()));
        for pair in ids.windows(2) {
            if let [before, after] = pair {
                leb128(&mut payload, after - before);
            }
        }
        let block = ((self.rows - 1) / ROW_BLOCK) as u32;
        let mut table = transaction.open_table(ROWS).map_err(MigrationError::engine)?;
        let value = frame(5, &block.to_le_bytes(), &payload);
        table.insert(block, &value[..]).map(drop).map_err(MigrationError::engine)
    }

    fn write_descriptors(&mut self, transaction: &WriteTransaction) -> Result<(), MigrationError> {
        let moments = std::mem::take(&mut self.moments);
        if moments.is_empty() {
            return Ok(());
        }
        let rows = moments.len() / MASKS;
        let mut payload = (rows as u64).to_le_bytes().to_vec();
        payload.extend(all_set(rows));
        payload.resize(8 + rows.div_ceil(64) * 8, 0);
        payload.extend(moments.iter().flat_map(|moment| moment.to_le_bytes()));
        let block = ((self.rows - 1) / DESCRIPTOR_BLOCK) as u32;
        let [b0, b1, b2, b3] = block.to_le_bytes();
        let value = frame(6, &[FULL, b0, b1, b2, b3], &payload);
        let mut table = transaction.open_table(DESCRIPTORS).map_err(MigrationError::engine)?;
        table.insert((FULL, block), &value[..]).map(drop).map_err(MigrationError::engine)
    }
}

fn put_meta<T: Serialize>(
    transaction: &WriteTransaction,
    kind: u8,
    key: &[u8],
    record: &T,
) -> Result<(), MigrationError> {
    let value = frame(kind, key, &encode(record)?);
    let mut table = transaction.open_table(META).map_err(MigrationError::engine)?;
    table.insert(key, &value[..]).map(drop).map_err(MigrationError::engine)
}

fn encode<T: Serialize>(record: &T) -> Result<Vec<u8>, MigrationError> {
    bincode::serde::encode_to_vec(record, bincode_v1())
        .map_err(|error| MigrationError::invalid("items", "", format!("a record cannot be encoded: {error}")))
}

/// Kind, version 1, two zeros, length, XXH3-64 of these 8 bytes, key and payload; then the payload.
fn frame(kind: u8, key: &[u8], payload: &[u8]) -> Vec<u8> {
    let mut value = vec![kind, 1, 0, 0];
    value.extend((payload.len() as u32).to_le_bytes());
    let sum = xxh3_64(&[&value[..], key, payload].concat());
    value.extend(sum.to_le_bytes());
    value.extend_from_slice(payload);
    value
}

fn short_sum(bytes: &[u8]) -> [u8; 4] {
    (xxh3_64(bytes) as u32).to_le_bytes()
}

/// `rows` set bits, spare bits 0.
fn all_set(rows: usize) -> Vec<u8> {
    let mut bits = vec![0xFF; rows / 8];
    if !rows.is_multiple_of(8) {
        bits.push((1 << (rows % 8)) - 1);
    }
    bits
}

fn leb128(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}
