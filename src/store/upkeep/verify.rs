//! Verification: every value, every checksum, every link.

use std::collections::{BTreeMap, HashMap};

use rayon::prelude::*;

use crate::store::access::blobs::{self, Blobs};
use crate::store::access::reads::sealed::Source as _;
use crate::store::access::reads::{self, Reads};
use crate::store::access::snapshot::Snapshot;
use crate::store::error::Damage;
use crate::store::error::StoreError;
use crate::store::format::descriptors::{DESCRIPTOR_ROWS, DescriptorBlock};
use crate::store::format::frame::{self, Kind};
use crate::store::format::keys;
use crate::store::format::record::{Content, Record};
use crate::store::format::sums;
use crate::store::os::panic_boundary::guarded;
use crate::store::progress::{Report, tell};
use crate::volume::Volume;

const DOING: &str = "verification";
/// The caller is told after as many values.
const STEP: u64 = 256;

/// What [`Snapshot::verify`] found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct VerifyReport {
    /// How many values of each table were checked; with a deep check also `volumes`.
    pub checked: BTreeMap<&'static str, u64>,
    /// What is not as it was written.
    pub damage: Vec<Damage>,
}

impl VerifyReport {
    /// Whether nothing is damaged.
    pub fn is_ok(&self) -> bool {
        self.damage.is_empty()
    }
}

/// The caller's look at a texture whose voxels were decompressed and whose hash matches: it describes them anew and
/// compares. Returns what is damaged. Called from several threads.
pub type DeepCheck<'a> = &'a (dyn Fn(&Snapshot, &Record, &Volume) -> Vec<Damage> + Sync);

impl Snapshot {
    /// Walks everything: frames and checksums, counts, and the links between tables both ways. Damage does not stop it.
    /// With `deep`, voxels are decompressed and hashed as well, and each volume is shown to `deep`; as many at once as
    /// rayon has threads.
    ///
    /// # Errors
    /// [`StoreError::Cancelled`], [`StoreError::Engine`]; damage is no error but part of the report.
    pub fn verify(&self, deep: Option<DeepCheck<'_>>, report: Report<'_>) -> Result<VerifyReport, StoreError> {
        let mut walk = Walk { snapshot: self, known: HashMap::new(), report, found: VerifyReport::default() };
        walk.found.checked.insert("meta", 3);
        walk.everything()?;
        if let Some(deep) = deep {
            walk.volumes(deep)?;
        }
        walk.found.damage.sort();
        walk.found.damage.dedup();
        Ok(walk.found)
    }
}

/// What a record says of other tables; `None` for a record that cannot be read.
type Said = Option<RecordSays>;

#[derive(Default)]
struct RecordSays {
    content: Option<Content>,
    tags: BTreeMap<String, String>,
    pieces: u32,
    bytes: u64,
    has_sums: bool,
}

struct Walk<'a, 'r> {
    snapshot: &'a Snapshot,
    known: HashMap<u64, Said>,
    report: Report<'r>,
    found: VerifyReport,
}

impl Walk<'_, '_> {
    /// Every table. Each walk goes on where the one before it met damage.
    fn everything(&mut self) -> Result<(), StoreError> {
        self.walk("textures", Self::textures)?;
        self.walk("rows", Self::rows)?;
        self.walk("hashes", Self::hashes)?;
        self.walk("tags", Self::tags)?;
        self.walk("chunks", Self::chunks)?;
        self.walk("sums", Self::sums)?;
        self.walk("descriptors", Self::descriptors)?;
        self.walk("statistics", |this| this.blobs(blobs::STATISTICS))?;
        self.walk("spaces", |this| this.blobs(blobs::SPACES))?;
        self.walk("points", Self::points)
    }

    fn walk(
        &mut self,
        table: &'static str,
        walk: impl FnOnce(&mut Self) -> Result<(), StoreError>,
    ) -> Result<(), StoreError> {
        let done = guarded(table, || walk(self));
        self.contain(done)
    }

    /// Puts damage into the report; other errors go up.
    fn contain(&mut self, done: Result<(), StoreError>) -> Result<(), StoreError> {
        match done {
            Err(StoreError::Damage(damage)) => {
                self.found.damage.push(damage);
                Ok(())
            }
            other => other,
        }
    }

    fn damage(&mut self, table: &'static str, key: impl Into<String>, what: impl Into<String>) {
        self.found.damage.push(Damage { table, key: key.into(), what: what.into() });
    }

    fn count(&mut self, table: &'static str, phase: &'static str, total: u64) -> Result<(), StoreError> {
        let checked = self.found.checked.entry(table).or_default();
        *checked += 1;
        if checked.is_multiple_of(STEP) {
            return tell(self.report, DOING, phase, *checked, total);
        }
        Ok(())
    }

    /// Begins a table, so that it is in the report even when it is empty.
    fn begin(&mut self, table: &'static str, phase: &'static str, total: u64) -> Result<(), StoreError> {
        self.found.checked.insert(table, 0);
        tell(self.report, DOING, phase, 0, total)
    }

    fn textures(&mut self) -> Result<(), StoreError> {
        const PHASE: &str = "checking records";
        let tables = self.snapshot.tables();
        let (live, next_id) = (tables.state.live, tables.state.next_id);
        let table = tables.source.table(keys::TEXTURES)?;
        self.begin("textures", PHASE, live)?;
        for entry in table.range::<u64>(..)? {
            let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
            let id = key.value();
            self.count("textures", PHASE, live)?;
            if id == 0 || id >= next_id {
                self.damage("textures", format!("id {id}"), format!("ids run from 1 to below {next_id}"));
            }
            let says = match reads::read_record(id, value.value()) {
                Ok(record) => Some(RecordSays {
                    pieces: record.voxels.map_or(0, |voxels| voxels.pieces),
                    bytes: record.voxels.map_or(0, |voxels| voxels.bytes),
                    content: record.content,
                    tags: record.tags,
                    has_sums: record.has_sums,
                }),
                Err(error) => {
                    self.contain(Err(error))?;
                    None
                }
            };
            self.known.insert(id, says);
        }
        let found = self.known.len() as u64;
        if found != live {
            self.damage("meta", "state", format!("{live} textures are counted, {found} are there"));
        }
        Ok(())
    }

    fn rows(&mut self) -> Result<(), StoreError> {
        let tables = self.snapshot.tables();
        let total = tables.source.table(keys::ROWS)?.len()?;
        let blocks = reads::row_blocks(tables);
        self.begin("rows", "checking rows", total)?;
        if total != u64::from(blocks) {
            self.damage("rows", "", format!("{total} blocks are there, the counters say {blocks}"));
        }
        let mut last = 0;
        let mut whole = true;
        let mut alive = std::collections::HashSet::new();
        for block in 0..blocks {
            self.count("rows", "checking rows", total)?;
            let rows = match reads::row_block(tables, block) {
                Ok(rows) => rows,
                Err(error) => {
                    whole = false;
                    self.contain(Err(error))?;
                    continue;
                }
            };
            if rows.ids.first().is_some_and(|&first| first <= last) {
                self.damage("rows", format!("block {block}"), "the ids do not ascend from the block before");
            }
            last = rows.ids.last().copied().unwrap_or(last);
            for (row, &id) in rows.ids.iter().enumerate() {
                if rows.live.get(row) {
                    alive.insert(id);
                    if !self.known.contains_key(&id) {
                        self.damage("rows", format!("block {block}, row {row}"), format!("there is no texture {id}"));
                    }
                } else if self.known.contains_key(&id) {
                    let what = format!("texture {id} is there, but its row is dead");
                    self.damage("rows", format!("block {block}, row {row}"), what);
                }
            }
        }
        if whole {
            let mut missing: Vec<u64> = self.known.keys().copied().filter(|id| !alive.contains(id)).collect();
            missing.sort_unstable();
            missing.iter().for_each(|id| self.damage("rows", format!("id {id}"), "the texture has no row"));
        }
        Ok(())
    }

    fn hashes(&mut self) -> Result<(), StoreError> {
        const PHASE: &str = "checking hashes";
        let table = self.snapshot.tables().source.table(keys::HASHES)?;
        let total = table.len()?;
        self.begin("hashes", PHASE, total)?;
        for entry in table.range::<&[u8; 32]>(..)? {
            let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
            self.count("hashes", PHASE, total)?;
            match reads::read_hash(key.value(), value.value()) {
                Ok(id) => {
                    let right = |says: &RecordSays| says.content.as_ref().is_some_and(|c| c.hash == *key.value());
                    let name = blake3::Hash::from_bytes(*key.value()).to_string();
                    self.expect("hashes", name, id, right, "has another hash");
                }
                Err(error) => self.contain(Err(error))?,
            }
        }
        for (id, hash) in self.each_said(|says| says.content.as_ref().map(|content| content.hash)) {
            if table.get(&hash)?.is_none() {
                self.damage("hashes", format!("id {id}"), "the texture's hash is missing");
            }
        }
        Ok(())
    }

    fn tags(&mut self) -> Result<(), StoreError> {
        const PHASE: &str = "checking tags";
        let table = self.snapshot.tables().source.table(keys::TAGS)?;
        let total = table.len()?;
        self.begin("tags", PHASE, total)?;
        for entry in table.range::<&[u8]>(..)? {
            let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
            self.count("tags", PHASE, total)?;
            let name = key.value().escape_ascii().to_string();
            match keys::parse_tag(key.value()) {
                Some((tag, text, id)) if frame::short_sum(key.value()) == *value.value() => {
                    let right = |says: &RecordSays| says.tags.get(tag).is_some_and(|value| value == text);
                    self.expect("tags", name, id, right, "has another value for this tag, or none");
                }
                _ => self.damage("tags", name, "the checksum does not match"),
            }
        }
        for (id, tags) in self.each_said(|says| Some(says.tags.clone())) {
            for (key, value) in tags {
                if table.get(&*keys::tag(&key, &value, id))?.is_none() {
                    self.damage("tags", format!("id {id}"), format!("the texture's tag {key} is missing"));
                }
            }
        }
        Ok(())
    }

    fn chunks(&mut self) -> Result<(), StoreError> {
        const PHASE: &str = "checking voxels";
        let table = self.snapshot.tables().source.table(keys::CHUNKS)?;
        let total = table.len()?;
        self.begin("chunks", PHASE, total)?;
        let mut there: HashMap<u64, (u32, u64)> = HashMap::new();
        for entry in table.range::<(u64, u32)>(..)? {
            let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
            let (id, n) = key.value();
            self.count("chunks", PHASE, total)?;
            let name = format!("id {id}, piece {n}");
            let piece = frame::open(Kind::Voxels, &keys::chunk_bytes(id, n), value.value());
            let (pieces, bytes) = there.entry(id).or_default();
            *pieces += 1;
            match piece {
                Ok(piece) => *bytes += piece.len() as u64,
                Err(what) => self.damage("chunks", name.clone(), what),
            }
            self.expect("chunks", name, id, |says| n < says.pieces, "has no such piece");
        }
        let damaged: Vec<String> = self.found.damage.iter().map(|damage| damage.key.clone()).collect();
        for (id, said) in self.each_said(|says| Some((says.pieces, says.bytes))) {
            let found = there.get(&id).copied().unwrap_or_default();
            // A piece that is damaged has been reported; its length does not count.
            if found != said && !damaged.iter().any(|key| key.starts_with(&format!("id {id}, piece"))) {
                let what = format!("{} pieces of {} bytes, the record says {} of {}", found.0, found.1, said.0, said.1);
                self.damage("chunks", format!("id {id}"), what);
            }
        }
        Ok(())
    }

    fn sums(&mut self) -> Result<(), StoreError> {
        const PHASE: &str = "checking sums";
        let table = self.snapshot.tables().source.table(keys::SUMS)?;
        let total = table.len()?;
        self.begin("sums", PHASE, total)?;
        for entry in table.range::<u64>(..)? {
            let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
            self.count("sums", PHASE, total)?;
            self.contain(sums::decode(key.value(), value.value()).map(drop))?;
            self.expect("sums", format!("id {}", key.value()), key.value(), |says| says.has_sums, "has no sums");
        }
        for (id, _) in self.each_said(|says| says.has_sums.then_some(())) {
            if table.get(id)?.is_none() {
                self.damage("sums", format!("id {id}"), "the texture's sums are missing");
            }
        }
        Ok(())
    }

    fn descriptors(&mut self) -> Result<(), StoreError> {
        const PHASE: &str = "checking descriptors";
        let tables = self.snapshot.tables();
        let table = tables.source.table(keys::DESCRIPTORS)?;
        let total = table.len()?;
        self.begin("descriptors", PHASE, total)?;
        for entry in table.range::<(u8, u32)>(..)? {
            let (key, value) = entry.map_err(StoreError::when("reading the store"))?;
            let (view, block) = key.value();
            self.count("descriptors", PHASE, total)?;
            let sound = frame::open(Kind::Descriptors, &keys::descriptor_bytes(view, block), value.value())
                .and_then(DescriptorBlock::decode)
                .and_then(|rows| check_block(&rows, block, tables.state.rows));
            if let Err(what) = sound {
                self.damage("descriptors", format!("view {view}, block {block}"), what);
            }
        }
        Ok(())
    }

    fn blobs(&mut self, blobs: Blobs) -> Result<(), StoreError> {
        const PHASE: &str = "checking statistics and spaces";
        let tables = self.snapshot.tables();
        let table = tables.source.table(blobs.table)?;
        let total = table.len()?;
        self.begin(blobs.name, PHASE, total)?;
        for name in blobs.names(tables)? {
            let there = blobs.get(tables, &name).map(|blob| blob.is_some());
            if let Ok(false) = there {
                self.damage(blobs.name, &name, "the first piece is missing");
            }
            self.contain(there.map(drop))?;
        }
        // Pieces behind a gap are not reached by name.
        let mut expected = None;
        for entry in table.range::<&[u8]>(..)? {
            let (key, _) = entry.map_err(StoreError::when("reading the store"))?;
            self.count(blobs.name, PHASE, total)?;
            let parsed = keys::parse_piece(key.value()).map(|(name, n)| (name.to_owned(), n));
            match (parsed, &expected) {
                (Some((name, n)), Some((last, next))) if name == *last && n == *next => expected = Some((name, n + 1)),
                (Some((name, 0)), _) => expected = Some((name, 1)),
                _ => self.damage(blobs.name, key.value().escape_ascii().to_string(), "the piece belongs to no blob"),
            }
        }
        Ok(())
    }

    fn points(&mut self) -> Result<(), StoreError> {
        const PHASE: &str = "checking points";
        let tables = self.snapshot.tables();
        let total = tables.source.table(keys::POINTS)?.len()?;
        self.begin("points", PHASE, total)?;
        let mut reachable = 0;
        for space in self.snapshot.spaces_with_points()? {
            let layout = match self.snapshot.points_layout(&space) {
                Ok(layout) => layout,
                Err(error) => {
                    self.contain(Err(error))?;
                    continue;
                }
            };
            let Some(layout) = layout else {
                self.damage("points", format!("space {space}"), "the layout is missing");
                continue;
            };
            reachable += 1;
            self.count("points", PHASE, total)?;
            if layout.rows > tables.state.rows {
                let what = format!("{} rows of points, the store has {}", layout.rows, tables.state.rows);
                self.damage("points", format!("space {space}"), what);
            }
            for part in (0..=u8::MAX).take(layout.widths.len()) {
                for block in 0..layout.blocks(part) {
                    reachable += 1;
                    self.count("points", PHASE, total)?;
                    let read = self.snapshot.points(&space, &layout, part, block);
                    self.contain(read.map(drop))?;
                }
            }
        }
        if reachable == total {
            return Ok(());
        }
        let table = tables.source.table(keys::POINTS)?;
        for entry in table.range::<&[u8]>(..)? {
            let (key, _) = entry.map_err(StoreError::when("reading the store"))?;
            let belongs = match keys::parse_points(key.value()) {
                Some((_, None)) => true,
                Some((space, Some((part, block)))) => {
                    // A layout that cannot be read has been reported, and says nothing of its blocks.
                    self.snapshot.points_layout(space).map_or(true, |l| l.is_some_and(|l| block < l.blocks(part)))
                }
                None => false,
            };
            if !belongs {
                self.damage("points", key.value().escape_ascii().to_string(), "the block is in no layout");
            }
        }
        Ok(())
    }

    /// Voxels decompressed, hashed, and shown to the caller.
    fn volumes(&mut self, deep: DeepCheck<'_>) -> Result<(), StoreError> {
        const PHASE: &str = "checking volumes";
        let snapshot = self.snapshot;
        let mut ids: Vec<u64> =
            self.each_said(|says| (says.pieces > 0).then_some(())).into_iter().map(|(id, ())| id).collect();
        ids.sort_unstable();
        self.begin("volumes", PHASE, ids.len() as u64)?;
        for some in ids.chunks(rayon::current_num_threads()) {
            let looks: Vec<Result<Vec<Damage>, StoreError>> =
                some.par_iter().map(|&id| look(snapshot, id, deep)).collect();
            for found in looks {
                let done = found.map(|damage| self.found.damage.extend(damage));
                self.contain(done)?;
            }
            *self.found.checked.entry("volumes").or_default() += some.len() as u64;
            tell(self.report, DOING, PHASE, self.found.checked.get("volumes").copied().unwrap_or(0), ids.len() as u64)?;
        }
        Ok(())
    }

    /// The value at `key` belongs to the texture `id`, whose record must be there and say so. Of a record that cannot be
    /// read nothing is expected: it is damage already.
    fn expect(
        &mut self,
        table: &'static str,
        key: String,
        id: u64,
        right: impl Fn(&RecordSays) -> bool,
        otherwise: &str,
    ) {
        match self.known.get(&id) {
            None => self.damage(table, key, format!("it belongs to texture {id}, which is not there")),
            Some(Some(says)) if !right(says) => self.damage(table, key, format!("texture {id} {otherwise}")),
            Some(_) => {}
        }
    }

    /// What records say, by id.
    fn each_said<T>(&self, pick: impl Fn(&RecordSays) -> Option<T>) -> Vec<(u64, T)> {
        let each = self.known.iter();
        each.filter_map(|(&id, says)| Some((id, pick(says.as_ref()?)?))).collect()
    }
}

fn check_block(rows: &DescriptorBlock, block: u32, all: u64) -> Result<(), String> {
    let from = u64::from(block) * DESCRIPTOR_ROWS as u64;
    if from + rows.len() as u64 > all {
        return Err(format!("the block has rows up to {}, the store {all}", from + rows.len() as u64));
    }
    if rows.present() == 0 {
        return Err("the block has no row that is present".into());
    }
    match rows.values().iter().all(|value| value.is_finite()) {
        true => Ok(()),
        false => Err("a moment is not finite".into()),
    }
}

fn look(snapshot: &Snapshot, id: u64, deep: DeepCheck<'_>) -> Result<Vec<Damage>, StoreError> {
    let (Some(record), Some(volume)) = (snapshot.record(id)?, snapshot.voxels(id)?) else { return Ok(Vec::new()) };
    if record.content.as_ref().is_none_or(|content| content.hash != volume.content_hash()) {
        let what = "the voxels do not have the hash of the record".into();
        return Ok(vec![Damage { table: "chunks", key: format!("id {id}"), what }]);
    }
    Ok(deep(snapshot, &record, &volume))
}
