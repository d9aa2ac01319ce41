//! The store through its public door: files, handles, states.

mod damage;
mod faults;
pub(crate) mod migrate;
mod model;

use std::path::PathBuf;
use std::sync::Mutex;

use hlacdb::hlac::MASK_COUNT;
use hlacdb::internals::store::{
    CompressedVoxels, Damage, DamageKey, NewTexture, OpenError, Reads, Record, Settings, Snapshot, Store, StoreError,
    ViewCode, Volumes,
};
use hlacdb::volume::Volume;
use tempfile::TempDir;

use crate::support::noise;

/// A store in a folder that goes with it.
pub(crate) struct Scratch {
    folder: TempDir,
}

impl Scratch {
    pub(crate) fn new() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    pub(crate) fn path(&self) -> PathBuf {
        self.folder.path().join("textures.hlacdb")
    }

    pub(crate) fn create(&self) -> Store {
        Store::create(self.path(), &settings()).unwrap()
    }

    fn files(&self) -> Vec<String> {
        let names = std::fs::read_dir(&self.folder).unwrap();
        names.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect()
    }
}

pub(crate) fn settings() -> Settings {
    let further = [("space".to_owned(), "default".to_owned())].into();
    Settings { views: vec![ViewCode(0), ViewCode(3)], volumes: Volumes::Keep, further }
}

pub(crate) fn moments(seed: u64) -> [f32; MASK_COUNT] {
    let mut next = noise(seed);
    [(); MASK_COUNT].map(|()| (next() % (1 << 24)) as f32 / (1 << 24) as f32)
}

pub(crate) fn volume(seed: u64) -> Volume {
    let mut next = noise(seed);
    let shape = [3 + next() as usize % 4, 3 + next() as usize % 20, 3 + next() as usize % 30];
    let channels = if next().is_multiple_of(4) { 3 } else { 1 };
    let voxels = (0..shape.iter().product::<usize>() * channels).map(|_| next() as u8).collect();
    Volume::new(shape, channels, voxels).unwrap()
}

/// Progress that records the stages.
#[derive(Default)]
struct Stages(Mutex<Vec<String>>);

impl hlacdb::Progress for Stages {
    fn begin(&self, stage: &str, _: Option<u64>) {
        self.0.lock().unwrap().push(stage.to_owned());
    }
}

/// Progress that cancels at once.
struct Stop;

impl hlacdb::Progress for Stop {
    fn cancelled(&self) -> bool {
        true
    }
}

/// Progress whose first call panics, as a bug in the caller's code does.
struct Bug;

impl hlacdb::Progress for Bug {
    fn begin(&self, _: &str, _: Option<u64>) {
        panic!("a bug in a progress callback");
    }
}

/// A texture with everything.
pub(crate) fn texture(seed: u64) -> NewTexture {
    let volume = volume(seed);
    NewTexture {
        name: format!("texture {seed}"),
        path: Some(format!("/data/\u{e9}{seed}.nrrd").into_bytes().into_iter().chain([0xFF]).collect()),
        voxels: Some(CompressedVoxels::new(&volume).unwrap()),
        sums: Some(hlacdb::octant_sums(&volume).total()),
        tags: [("family".to_owned(), format!("f{}", seed % 3)), ("seed".to_owned(), seed.to_string())].into(),
        descriptors: vec![(ViewCode(0), moments(seed)), (ViewCode(3), moments(seed + 1_000_000))],
        ..NewTexture::default()
    }
}

#[test]
fn what_goes_in_comes_out() {
    let scratch = Scratch::new();
    let store = scratch.create();
    assert_eq!(scratch.files(), ["textures.hlacdb"]);
    let mut transaction = store.write().unwrap();
    assert_eq!(transaction.add(texture(1)).unwrap(), 1);
    assert_eq!(transaction.add(texture(2)).unwrap(), 2);
    transaction.put_statistics("full", &[7; 700_000]).unwrap();
    transaction.put_space("default", b"fitted").unwrap();
    assert_eq!(transaction.commit().unwrap(), 2);
    drop(store);

    let store = Store::open(scratch.path()).unwrap();
    let state = store.read().unwrap();
    assert_eq!((state.revision(), state.counts().textures, state.counts().next_id), (2, 2, 3));
    assert_eq!(state.settings(), &settings());
    let record = state.record(2).unwrap().unwrap();
    assert_eq!(record.name, "texture 2");
    #[cfg(unix)]
    assert_eq!(hlacdb::internals::store::path_bytes(&record.path().unwrap()), record.path.clone().unwrap());
    assert_eq!(state.voxels(2).unwrap().unwrap(), volume(2));
    assert_eq!(state.sums(2).unwrap().unwrap(), hlacdb::octant_sums(&volume(2)).total());
    assert_eq!(state.descriptor(2, ViewCode(3)).unwrap().unwrap(), moments(1_000_002));
    assert_eq!(state.descriptor(2, ViewCode(9)).unwrap(), None);
    assert_eq!(state.find(&volume(2).content_hash()).unwrap(), Some(2));
    assert_eq!(state.find(&[0; 32]).unwrap(), None);
    assert_eq!((state.record(3).unwrap(), state.voxels(3).unwrap(), state.row(3).unwrap()), (None, None, None));
    assert_eq!(state.statistics("full").unwrap().unwrap(), [7; 700_000]);
    assert_eq!(state.space("default").unwrap().unwrap(), b"fitted");
    assert_eq!(state.described_views().unwrap(), [ViewCode(0), ViewCode(3)]);
    assert!(state.sizes().unwrap()["chunks"].stored > 0);
    assert!(state.verify(Some(&|_, _, _| Vec::new()), &()).unwrap().is_ok());
}

#[test]
fn a_deep_check_sees_every_volume_and_its_findings_are_reported() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let mut transaction = store.write().unwrap();
    for seed in 1..=5 {
        transaction.add(texture(seed)).unwrap();
    }
    transaction.add(NewTexture::default()).unwrap();
    transaction.commit().unwrap();
    let deep = |state: &Snapshot, record: &Record, seen: &Volume| {
        assert_eq!(seen, &volume(record.id));
        let same = state.sums(record.id).unwrap().unwrap() == hlacdb::octant_sums(seen).total() && record.id != 4;
        let damage = Damage::new("sums", DamageKey::Texture(record.id), "other sums");
        if same { Vec::new() } else { vec![damage] }
    };
    let stages = Stages::default();
    let report = store.read().unwrap().verify(Some(&deep), &stages).unwrap();
    assert_eq!((report.checked["volumes"], report.checked["textures"], report.is_ok()), (5, 6, false));
    assert_eq!(report.damage[0].to_string(), "damage in table sums at id 4: other sums");
    let stages = stages.0.into_inner().unwrap();
    assert!(["checking records", "checking volumes"].iter().all(|stage| stages.iter().any(|one| one == stage)));
}

#[test]
fn the_same_inputs_make_the_same_bytes() {
    let bytes = [(); 2].map(|()| {
        let scratch = Scratch::new();
        let store = scratch.create();
        for batch in 0..3 {
            let mut transaction = store.write().unwrap();
            for i in 0..5 {
                transaction.add(texture(batch * 5 + i)).unwrap();
            }
            transaction.commit().unwrap();
        }
        drop(store);
        std::fs::read(scratch.path()).unwrap()
    });
    assert_eq!(bytes[0], bytes[1]);
}

#[test]
fn what_cannot_be_stored_is_refused_and_leaves_nothing() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let mut transaction = store.write().unwrap();
    transaction.add(texture(1)).unwrap();
    assert!(matches!(transaction.add(texture(1)), Err(StoreError::Duplicate { id: 1 })));
    let with = |change: &dyn Fn(&mut NewTexture)| {
        let mut new = texture(2);
        change(&mut new);
        new
    };
    let bad = [
        with(&|new| new.descriptors[1].1[250] = f32::NAN),
        with(&|new| new.descriptors[1].0 = ViewCode(0)),
        with(&|new| drop(new.tags.insert("a\0b".into(), String::new()))),
        with(&|new| drop(new.tags.insert(String::new(), String::new()))),
        with(&|new| drop(new.tags.insert("k".into(), "v".repeat(5000)))),
        with(&|new| new.content = Some(hlacdb::internals::store::Content::of(&volume(3)))),
    ];
    for new in bad {
        assert!(matches!(transaction.add(new), Err(StoreError::Invalid { .. })));
    }
    assert!(matches!(transaction.remove(9), Err(StoreError::NoSuchTexture { id: 9 })));
    assert!(matches!(transaction.set_tag(9, "k", "v"), Err(StoreError::NoSuchTexture { id: 9 })));
    assert!(matches!(transaction.put_space("", b""), Err(StoreError::Invalid { .. })));
    assert!(matches!(transaction.append_points("none", &[&[]]), Err(StoreError::Invalid { .. })));
    transaction.begin_points("default", &[2, 1]).unwrap();
    assert!(transaction.append_points("default", &[&[0.0; 2]]).is_err(), "a part is missing");
    assert!(transaction.append_points("default", &[&[0.0; 2], &[0.0; 2]]).is_err(), "rows differ");
    assert!(transaction.append_points("default", &[&[0.0; 4], &[0.0; 2]]).is_err(), "more rows than the store");
    transaction.append_points("default", &[&[0.0; 2], &[0.0; 1]]).unwrap();
    transaction.commit().unwrap();
    assert_eq!(store.read().unwrap().counts().textures, 1);
    assert!(store.read().unwrap().verify(None, &()).unwrap().is_ok());
}

/// Regression: the entry of a tag begins as a key with a NUL in it does, and was taken for its own.
#[test]
fn a_tag_is_found_by_its_key_and_value_alone() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let mut transaction = store.write().unwrap();
    let tags = [("family".to_owned(), "stone".to_owned())].into();
    let id = transaction.add(NewTexture { tags, ..NewTexture::default() }).unwrap();
    transaction.commit().unwrap();
    let state = store.read().unwrap();
    assert_eq!(state.tagged("family", "stone").unwrap(), [id]);
    for (key, value) in [("family\0stone", ""), ("family", "stone\0"), ("family", ""), ("", "stone"), ("", "")] {
        assert_eq!(state.tagged(key, value).unwrap(), [0; 0], "{key:?} {value:?}");
    }
    assert_eq!(state.tag_values("family").unwrap(), [("stone".to_owned(), 1)]);
    assert_eq!(state.tag_values("family\0stone").unwrap(), []);
}

#[test]
fn opening_tells_what_is_wrong_and_creates_nothing() {
    let scratch = Scratch::new();
    let path = scratch.path();
    assert!(matches!(Store::open(&path), Err(StoreError::Open(OpenError::NoStore { .. }))));
    assert!(matches!(Store::open_read_only(&path), Err(StoreError::Open(OpenError::NoStore { .. }))));
    assert!(!path.exists());
    for (content, says) in
        [(&b""[..], "empty"), (b"NRRD0004\n", "NRRD"), (b"re", "re"), (b"redb\x1A\x0A\xA9\x0D", "redb")]
    {
        std::fs::write(&path, content).unwrap();
        for opened in [Store::open(&path), Store::open_read_only(&path)] {
            let error = opened.unwrap_err();
            assert!(
                matches!(error, StoreError::Open(OpenError::NotAStore { .. })) && error.to_string().contains(says),
                "{error}"
            );
        }
        assert_eq!(std::fs::read(&path).unwrap(), content);
        assert!(matches!(Store::create(&path, &settings()), Err(StoreError::Open(OpenError::Exists { .. }))));
    }
    let folder = scratch.folder.path();
    assert!(matches!(Store::open(folder), Err(StoreError::Open(OpenError::NotAStore { .. }))));
    assert!(matches!(Store::create(folder, &settings()), Err(StoreError::Open(OpenError::Exists { .. }))));
    assert!(matches!(
        Store::create(folder.join("no/such/store"), &settings()),
        Err(StoreError::Open(OpenError::Io { .. }))
    ));
    std::fs::remove_file(&path).unwrap();
    let foreign = redb::Database::create(&path).unwrap();
    let transaction = foreign.begin_write().unwrap();
    transaction.open_table(redb::TableDefinition::<u64, u64>::new("meta")).unwrap();
    transaction.commit().unwrap();
    drop(foreign);
    for opened in [Store::open(&path), Store::open_read_only(&path)] {
        assert!(opened.unwrap_err().to_string().contains("another program"));
    }
    assert_eq!(scratch.files(), ["textures.hlacdb"]);
}

#[test]
fn one_writes_others_read_and_follow() {
    let scratch = Scratch::new();
    let writer = scratch.create();
    let error = Store::open(scratch.path()).unwrap_err();
    assert!(matches!(error, StoreError::Open(OpenError::HeldByWriter { .. })), "{error}");
    let reader = Store::open_read_only(scratch.path()).unwrap();
    assert!(reader.is_read_only() && matches!(reader.write(), Err(StoreError::ReadOnly)));
    assert!(matches!(reader.compact(&()), Err(StoreError::ReadOnly)));
    let before = reader.read().unwrap();
    let mut transaction = writer.write().unwrap();
    transaction.add(texture(1)).unwrap();
    assert_eq!(reader.read().unwrap().counts().textures, 0);
    transaction.commit().unwrap();
    assert_eq!((before.counts().textures, before.record(1).unwrap()), (0, None), "a snapshot stands still");
    assert_eq!(reader.read().unwrap().record(1).unwrap().unwrap().name, "texture 1");
    drop(writer);
    let writer = Store::open(scratch.path()).unwrap();
    let mut transaction = writer.write().unwrap();
    transaction.remove(1).unwrap();
    transaction.commit().unwrap();
    assert_eq!(reader.read().unwrap().counts().textures, 0);
    assert_eq!(before.revision(), 1);
}

#[test]
fn a_snapshot_of_this_handle_keeps_compaction_waiting() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let snapshot = store.read().unwrap();
    assert!(matches!(store.compact(&()), Err(StoreError::Busy { .. })));
    drop(snapshot);
    store.compact(&()).unwrap();
}

#[test]
fn long_jobs_stop_when_told() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let mut transaction = store.write().unwrap();
    transaction.add(texture(1)).unwrap();
    transaction.add(texture(2)).unwrap();
    transaction.remove(1).unwrap();
    transaction.commit().unwrap();
    assert!(matches!(store.compact(&Stop), Err(StoreError::Cancelled { .. })));
    assert!(matches!(store.read().unwrap().verify(None, &Stop), Err(StoreError::Cancelled { .. })));
    assert_eq!(store.read().unwrap().counts().rows, 2, "nothing was compacted");
}

/// Only the engine's panics are damage: a bug is reported as a bug.
#[test]
fn a_panic_of_our_own_code_is_not_reported_as_damage() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let mut transaction = store.write().unwrap();
    transaction.add(texture(1)).unwrap();
    transaction.add(texture(2)).unwrap();
    transaction.remove(1).unwrap();
    transaction.commit().unwrap();
    let bug = |call: &dyn Fn() -> bool| {
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(call)).unwrap_err();
        assert_eq!(panic.downcast_ref::<&str>(), Some(&"a bug in a progress callback"));
    };
    bug(&|| store.read().unwrap().verify(None, &Bug).is_ok());
    bug(&|| store.compact(&Bug).is_ok());
    // The store is none the worse for it.
    assert!(store.read().unwrap().verify(None, &()).unwrap().is_ok());
    assert_eq!(store.compact(&()).unwrap().rows_removed, 1);
}

#[test]
fn a_removed_texture_gives_its_space_back() {
    let scratch = Scratch::new();
    let store = scratch.create();
    let mut transaction = store.write().unwrap();
    let voxels = |seed| {
        let mut next = noise(seed);
        Volume::from_fn([64; 3], |_, _, _| next() as u8).unwrap()
    };
    for seed in 0..8 {
        let voxels = CompressedVoxels::new(&voxels(seed)).unwrap();
        transaction.add(NewTexture { voxels: Some(voxels), ..NewTexture::default() }).unwrap();
    }
    transaction.commit().unwrap();
    let mut transaction = store.write().unwrap();
    for id in 1..8 {
        transaction.remove(id).unwrap();
    }
    transaction.commit().unwrap();
    let report = store.compact(&()).unwrap();
    assert_eq!(report.rows_removed, 7);
    assert!(report.bytes_after < 1 << 20 && report.bytes_before > 2 << 20, "{report:?}");
    assert_eq!(store.read().unwrap().voxels(8).unwrap().unwrap(), voxels(7));
}

#[test]
fn a_store_lives_in_memory_too() {
    let store = Store::options()
        .cache_bytes(1 << 20)
        .create_with_backend(redb::backends::InMemoryBackend::new(), &settings())
        .unwrap();
    let mut transaction = store.write().unwrap();
    transaction.add(texture(1)).unwrap();
    transaction.commit().unwrap();
    assert!(store.read().unwrap().verify(None, &()).unwrap().is_ok());
}
