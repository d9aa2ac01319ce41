//! Random histories against a plain model in memory, each ending with a verification.

use std::collections::BTreeMap;

use hlacdb::internals::store::{
    DESCRIPTOR_ROWS, NewTexture, Reads, Settings, Store, StoreError, Transaction, ViewCode, point_rows_per_block,
};
use proptest::prelude::*;

use super::{Scratch, moments, settings, texture, volume};

const WIDTHS: [u16; 2] = [3, 400];

#[derive(Clone, Debug)]
enum Op {
    Add(u64),
    Import(u64, usize),
    Remove(usize),
    SetTag(usize, u8, u8),
    UnsetTag(usize, u8),
    SetDescriptor(usize, u64),
    Statistics(u8, usize),
    Space(bool, usize),
    BeginPoints,
    AppendPoints(usize),
    CompactRows,
    Settings(u8),
}

#[derive(Clone, Copy, Debug)]
enum Then {
    Commit,
    Abort,
    Reopen,
    Compact,
}

/// Which texture: often one of the first, so that histories come back to it.
fn which() -> impl Strategy<Value = usize> {
    prop_oneof![2 => 0..3_usize, 1 => any::<usize>()]
}

fn op() -> impl Strategy<Value = Op> {
    prop_oneof![
        4 => (0..40_u64).prop_map(Op::Add),
        2 => (0..1000_u64, 1..400_usize).prop_map(|(seed, count)| Op::Import(seed, count)),
        3 => which().prop_map(Op::Remove),
        4 => (which(), 0..2_u8, 0..3_u8).prop_map(|(which, key, value)| Op::SetTag(which, key, value)),
        1 => (which(), 0..3_u8).prop_map(|(which, key)| Op::UnsetTag(which, key)),
        1 => (which(), 0..99_u64).prop_map(|(which, seed)| Op::SetDescriptor(which, seed)),
        1 => (0..3_u8, 0..10_000_usize).prop_map(|(key, length)| Op::Statistics(key, length)),
        1 => (any::<bool>(), 0..10_000_usize).prop_map(|(keep, length)| Op::Space(keep, length)),
        1 => Just(Op::BeginPoints),
        3 => (1..400_usize).prop_map(Op::AppendPoints),
        1 => Just(Op::CompactRows),
        1 => (0..9_u8).prop_map(Op::Settings),
    ]
}

fn history() -> impl Strategy<Value = Vec<(Vec<Op>, Then)>> {
    let then =
        prop_oneof![4 => Just(Then::Commit), 1 => Just(Then::Abort), 1 => Just(Then::Reopen), 1 => Just(Then::Compact)];
    prop::collection::vec((prop::collection::vec(op(), 1..8), then), 1..8)
}

#[derive(Clone, Debug, Default, PartialEq)]
struct Known {
    name: String,
    tags: BTreeMap<String, String>,
    volume: Option<u64>,
    descriptors: BTreeMap<u8, u64>,
}

/// What the store should hold, as plainly as can be.
#[derive(Clone, Debug, Default)]
struct Model {
    textures: BTreeMap<u64, Known>,
    given: u64,
    rows: Vec<(u64, bool)>,
    statistics: BTreeMap<String, Vec<u8>>,
    space: Option<Vec<u8>>,
    /// For each row that has a point, a number from which the coordinates come.
    points: Option<Vec<u32>>,
    settings: Settings,
}

fn blob(length: usize) -> Vec<u8> {
    (0..length * 60).map(|i| (i * 7 / 3) as u8).collect()
}

fn coordinates(numbers: &[u32], width: u16) -> Vec<f32> {
    numbers.iter().flat_map(|&number| (0..width).map(move |axis| number as f32 * 1000.0 + f32::from(axis))).collect()
}

impl Model {
    fn nth(&self, which: usize) -> Option<u64> {
        self.textures.keys().copied().nth(which % self.textures.len().max(1))
    }

    fn push(&mut self, known: Known) -> u64 {
        self.given += 1;
        self.textures.insert(self.given, known);
        self.rows.push((self.given, true));
        self.given
    }

    fn compact(&mut self) {
        let mut alive = self.rows.iter().map(|&(_, live)| live);
        if let Some(points) = &mut self.points {
            points.retain(|_| alive.next().unwrap());
        }
        self.rows.retain(|&(_, live)| live);
    }

    fn apply(&mut self, op: &Op, transaction: &mut Transaction) {
        match *op {
            Op::Add(seed) => {
                let there = self.textures.iter().find(|(_, known)| known.volume == Some(seed)).map(|(&id, _)| id);
                let new = texture(seed);
                let known = Known {
                    name: new.name.clone(),
                    tags: new.tags.clone(),
                    volume: Some(seed),
                    descriptors: [(0, seed), (3, seed + 1_000_000)].into(),
                };
                match (transaction.add(new), there) {
                    (Err(StoreError::Duplicate { id }), Some(there)) => assert_eq!(id, there),
                    (Ok(id), None) => assert_eq!(id, self.push(known)),
                    (got, there) => panic!("{got:?} {there:?}"),
                }
            }
            Op::Import(seed, count) => {
                for seed in seed..seed + count as u64 {
                    let view = if seed.is_multiple_of(5) { 7 } else { 0 };
                    let name = format!("row {seed}");
                    let descriptors = vec![(ViewCode(view), moments(seed))];
                    let new = NewTexture { name: name.clone(), descriptors, ..NewTexture::default() };
                    let known = Known { name, descriptors: [(view, seed)].into(), ..Known::default() };
                    assert_eq!(transaction.add(new).unwrap(), self.push(known));
                }
            }
            Op::Remove(which) => {
                let Some(id) = self.nth(which) else { return };
                let known = self.textures.remove(&id).unwrap();
                assert_eq!(transaction.remove(id).unwrap().name, known.name);
                self.rows.iter_mut().find(|(row, _)| *row == id).unwrap().1 = false;
            }
            Op::SetTag(which, key, value) => {
                let Some(id) = self.nth(which) else { return };
                let (key, value) = (format!("k{key}"), "v".repeat(usize::from(value)));
                transaction.set_tag(id, &key, &value).unwrap();
                self.textures.get_mut(&id).unwrap().tags.insert(key, value);
            }
            Op::UnsetTag(which, key) => {
                let Some(id) = self.nth(which) else { return };
                let key = format!("k{key}");
                let had = self.textures.get_mut(&id).unwrap().tags.remove(&key).is_some();
                assert_eq!(transaction.unset_tag(id, &key).unwrap(), had);
            }
            Op::SetDescriptor(which, seed) => {
                let Some(id) = self.nth(which) else { return };
                transaction.set_descriptors(id, &[(ViewCode(0), None), (ViewCode(9), Some(moments(seed)))]).unwrap();
                let known = &mut self.textures.get_mut(&id).unwrap().descriptors;
                known.remove(&0);
                known.insert(9, seed);
            }
            Op::Statistics(key, length) => {
                transaction.put_statistics(&format!("s{key}"), &blob(length)).unwrap();
                self.statistics.insert(format!("s{key}"), blob(length));
            }
            Op::Space(true, length) => {
                transaction.put_space("default", &blob(length)).unwrap();
                self.space = Some(blob(length));
            }
            Op::Space(false, _) => {
                assert_eq!(transaction.drop_space("default").unwrap(), self.space.take().is_some());
                self.points = None;
            }
            Op::BeginPoints => {
                transaction.begin_points("default", &WIDTHS).unwrap();
                self.points = Some(Vec::new());
            }
            Op::AppendPoints(count) => {
                let Some(points) = &mut self.points else { return };
                let from = points.len();
                let numbers: Vec<u32> = (from..self.rows.len().min(from + count)).map(|n| n as u32).collect();
                let parts = WIDTHS.map(|width| coordinates(&numbers, width));
                transaction.append_points("default", &[&parts[0], &parts[1]]).unwrap();
                points.extend(numbers);
            }
            Op::CompactRows => {
                transaction.compact_rows(&()).unwrap();
                self.compact();
            }
            Op::Settings(view) => {
                self.settings.views.push(ViewCode(view));
                transaction.put_settings(self.settings.clone()).unwrap();
            }
        }
    }

    /// Everything that can be asked.
    fn compare(&self, state: &impl Reads) {
        let counts = state.counts();
        assert_eq!(counts.textures as usize, self.textures.len());
        assert_eq!((counts.rows as usize, counts.next_id), (self.rows.len(), self.given + 1));
        assert_eq!(state.settings(), &self.settings);
        let rows = state.rows().unwrap();
        assert_eq!(rows.ids(), self.rows.iter().map(|&(id, _)| id).collect::<Vec<_>>());
        for (row, &(id, live)) in self.rows.iter().enumerate() {
            assert_eq!((rows.is_live(row), rows.row_of(id)), (live, live.then_some(row)));
        }
        let records: Vec<_> = state.records().map(Result::unwrap).collect();
        assert_eq!(records.len(), self.textures.len());
        for (record, (id, known)) in records.iter().zip(&self.textures) {
            assert_eq!((record.id, &record.name, &record.tags), (*id, &known.name, &known.tags));
            let Some(seed) = known.volume else { continue };
            assert_eq!(state.voxels(*id).unwrap().unwrap(), volume(seed));
            assert_eq!(state.sums(*id).unwrap().unwrap(), texture(seed).sums.unwrap());
            assert_eq!(state.find(&volume(seed).content_hash()).unwrap(), Some(*id));
            assert_eq!(state.row(*id).unwrap(), rows.row_of(*id).map(|row| row as u64));
        }
        self.compare_descriptors(state);
        self.compare_tags(state);
        for (key, bytes) in &self.statistics {
            assert_eq!(state.statistics(key).unwrap().as_ref(), Some(bytes));
        }
        assert_eq!(state.statistics_keys().unwrap(), self.statistics.keys().cloned().collect::<Vec<_>>());
        assert_eq!(state.space("default").unwrap(), self.space);
        self.compare_points(state);
    }

    fn compare_descriptors(&self, state: &impl Reads) {
        for view in [0, 3, 7, 9] {
            for block in 0..state.descriptor_blocks() {
                let rows = state.descriptors(ViewCode(view), block).unwrap().unwrap_or_default();
                for row in 0..DESCRIPTOR_ROWS {
                    let Some(&(id, live)) = self.rows.get(block as usize * DESCRIPTOR_ROWS + row) else { continue };
                    if !live {
                        continue;
                    }
                    let expected = self.textures[&id].descriptors.get(&view).map(|&seed| moments(seed));
                    assert_eq!(rows.row(row), expected.as_ref(), "view {view}, id {id}");
                }
            }
        }
    }

    fn compare_tags(&self, state: &impl Reads) {
        let mut tags: BTreeMap<(String, String), Vec<u64>> = BTreeMap::new();
        for (&id, known) in &self.textures {
            for (key, value) in &known.tags {
                tags.entry((key.clone(), value.clone())).or_default().push(id);
            }
        }
        let mut keys: Vec<String> = tags.keys().map(|(key, _)| key.clone()).collect();
        keys.dedup();
        assert_eq!(state.tag_keys().unwrap(), keys);
        for key in &keys {
            let of_key = tags.iter().filter(|((of, _), _)| of == key);
            let values: Vec<_> = of_key.map(|((_, value), ids)| (value.clone(), ids.len() as u64)).collect();
            assert_eq!(state.tag_values(key).unwrap(), values);
        }
        for ((key, value), ids) in &tags {
            assert_eq!(&state.tagged(key, value).unwrap(), ids);
        }
        assert!(state.tagged("k0", "vvvvv").unwrap().is_empty());
    }

    fn compare_points(&self, state: &impl Reads) {
        let layout = state.points_layout("default").unwrap();
        assert_eq!(layout.as_ref().map(|layout| layout.rows as usize), self.points.as_ref().map(Vec::len));
        let (Some(layout), Some(points)) = (layout, &self.points) else { return };
        for (part, width) in (0_u8..).zip(WIDTHS) {
            let mut read = Vec::new();
            for block in 0..layout.blocks(part) {
                let some = state.points("default", &layout, part, block).unwrap();
                assert!(some.len() <= point_rows_per_block(width.into()) * usize::from(width));
                read.extend(some);
            }
            assert_eq!(read, coordinates(points, width));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 200, ..hlacdb_testing::cases(24) })]

    #[test]
    fn random_histories_match_the_model(history in history()) {
        let scratch = Scratch::new();
        let mut store = scratch.create();
        let mut model = Model { settings: settings(), ..Model::default() };
        let mut revision = 1;
        for (ops, then) in history {
            let before = model.clone();
            let mut transaction = store.write().unwrap();
            for op in &ops {
                model.apply(op, &mut transaction);
            }
            model.compare(&transaction);
            if let Then::Abort = then {
                drop(transaction);
                model = before;
            } else {
                revision += 1;
                prop_assert_eq!(transaction.commit().unwrap(), revision);
            }
            if let Then::Reopen = then {
                drop(store);
                store = Store::open(scratch.path()).unwrap();
            }
            if let Then::Compact = then {
                revision += u64::from(store.compact(&()).unwrap().rows_removed > 0);
                model.compact();
            }
            prop_assert_eq!(store.read().unwrap().revision(), revision);
            model.compare(&store.read().unwrap());
        }
        let report = store.read().unwrap().verify(Some(&|_, _, _| Vec::new()), &()).unwrap();
        prop_assert_eq!(report.damage, []);
        prop_assert_eq!(report.checked["textures"], model.textures.len() as u64);
    }
}
