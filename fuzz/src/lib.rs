//! What is fuzzed: each target is a plain function over bytes, which libFuzzer and the stable runner both drive.
//!
//! The property is the same everywhere: any bytes give a value or one error, without a panic, within the limits on memory.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock};

use hlacdb::internals::space::NuisanceStatistics;
use hlacdb::serve::ServerOptions;
use hlacdb::serve::fuzz::InProcessServer;
use hlacdb::space::{Space, Statistics};
use hlacdb::synth::Recipe;
use hlacdb::volume::{
    self, Endian, Intensity, MIN_SIDE, RawLayout, ReadOptions, SampleType, SlabReader, Volume, VolumeFile,
};
use hlacdb::{Database, Meta, OpenOptions, Query};

/// Every target by name.
pub const TARGETS: &[(&str, fn(&[u8]))] = &[
    ("npy", npy),
    ("npz", npz),
    ("nrrd", nrrd),
    ("metaimage", metaimage),
    ("nifti", nifti),
    ("tiff", tiff),
    ("vox", vox),
    ("raw", raw),
    ("slices", slices),
    ("values", values),
    ("statistics", statistics),
    ("space", space),
    ("recipe", recipe),
    ("list", list),
    ("filter", filter),
    ("http", http),
];

/// The files that a target's inputs are first made of.
pub fn seeds(target: &str) -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let with = |folder: &str, endings: &[&str]| {
        let entries = fs::read_dir(root.join(folder)).into_iter().flatten().flatten().map(|entry| entry.path());
        let fits = |path: &PathBuf| endings.iter().any(|ending| path.to_string_lossy().ends_with(ending));
        let mut files: Vec<PathBuf> = entries.filter(|path| path.is_file() && fits(path)).collect();
        files.sort();
        files
    };
    let volumes = |endings: &[&str]| with("crates/volume/tests/fixtures/volumes", endings);
    let mut seeds = match target {
        "npy" => volumes(&[".npy"]),
        "npz" => volumes(&[".npz"]),
        "nrrd" => volumes(&[".nrrd", ".nhdr"]),
        "metaimage" => volumes(&[".mha", ".mhd"]),
        "nifti" => volumes(&[".nii", ".nii.gz"]),
        "raw" => volumes(&[".raw"]),
        "tiff" => with("crates/volume/tests/fixtures/pictures", &[".tif"]),
        "slices" => [with("crates/volume/tests/fixtures/pictures/png", &[".png"]), with("crates/volume/tests/fixtures/pictures/jpeg_grey", &[".jpg"])].concat(),
        "recipe" => with("datasets", &[".toml"]),
        _ => Vec::new(),
    };
    seeds.extend(with(&format!("fuzz/seeds/{target}"), &[""]));
    seeds
}

/// Voxels that a header may promise here: what lies must be found out before it takes memory.
const LIMIT: u64 = 1 << 16;

/// A folder of this process.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let base = if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() };
        let folder = base.join(format!("hlacdb-fuzz-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder for inputs");
        // What a detached header may name.
        for name in ["data.raw", "data.raw.gz", "a.raw", "a.zraw"] {
            fs::write(folder.join(name), [7; 4096]).expect("a data file");
        }
        folder
    })
}

fn read(name: &str, data: &[u8]) {
    let path = folder().join(name);
    fs::write(&path, data).expect("the input as a file");
    for intensity in [Intensity::Full, Intensity::Auto] {
        survives(&path, &ReadOptions::new().max_voxels(LIMIT).intensity(intensity));
    }
}

fn survives(path: &Path, options: &ReadOptions) {
    match volume::read(path, options) {
        Ok((volume, _)) => {
            assert!(volume.voxels().len() as u64 <= 3 * LIMIT);
            parts_equal(&volume, path, options);
        }
        Err(error) => {
            let said = hlacdb::chain(&error);
            assert!(!said.contains('\n') && said.len() < 2000, "one sentence, one line: {said}");
            parts_survive(path, options);
        }
    }
}

/// A box and the slabs of a file that is read whole are parts of the whole.
fn parts_equal(whole: &Volume, path: &Path, options: &ReadOptions) {
    let mut file = VolumeFile::open(path, options).expect("the file was read");
    let origin = whole.shape().map(|side| side - MIN_SIDE);
    let block = file.read_block(origin, [MIN_SIDE; 3]).expect("the file was read");
    assert_eq!(Some(block), whole.block(origin, [MIN_SIDE; 3]));
    let Some(mut slabs) = SlabReader::new(file) else { return };
    let mut voxels = Vec::new();
    while let Some(slab) = slabs.read(2).expect("the file was read") {
        voxels.extend_from_slice(slab.voxels);
    }
    assert!(voxels == whole.voxels());
}

/// Parts of a file that is not read whole are read or refused.
fn parts_survive(path: &Path, options: &ReadOptions) {
    let Ok(mut file) = VolumeFile::open(path, options) else { return };
    let _ = file.read_block([0; 3], [MIN_SIDE; 3]);
    let Some(mut slabs) = SlabReader::new(file) else { return };
    while let Ok(Some(_)) = slabs.read(2) {}
}

/// numpy arrays.
pub fn npy(data: &[u8]) {
    read("a.npy", data);
}

/// Archives of numpy arrays.
pub fn npz(data: &[u8]) {
    read("a.npz", data);
}

/// NRRD, attached and detached.
pub fn nrrd(data: &[u8]) {
    read("a.nhdr", data);
}

/// MetaImage, attached and detached.
pub fn metaimage(data: &[u8]) {
    read("a.mhd", data);
}

/// NIfTI, plain and compressed.
pub fn nifti(data: &[u8]) {
    read("a.nii", data);
}

/// TIFF.
pub fn tiff(data: &[u8]) {
    read("a.tif", data);
}

/// MagicaVoxel models.
pub fn vox(data: &[u8]) {
    read("a.vox", data);
}

/// Samples without a header: the layout is drawn from the first bytes.
pub fn raw(data: &[u8]) {
    let Some((&[z, y, x, offset, kind], rest)) = data.split_first_chunk::<5>() else { return };
    let samples = [SampleType::U8, SampleType::I16, SampleType::F16, SampleType::F64, SampleType::U64][usize::from(kind) % 5];
    let endian = if kind & 128 == 0 { Endian::Little } else { Endian::Big };
    let shape = [z, y, x].map(usize::from);
    let path = folder().join("bare.raw");
    fs::write(&path, rest).expect("the input as a file");
    let layout = RawLayout::new(shape, samples, endian).offset(offset.into());
    survives(&path, &ReadOptions::new().max_voxels(LIMIT).raw(layout));
}

/// A folder of slices: three pictures, the input among them.
pub fn slices(data: &[u8]) {
    let path = folder().join("slices");
    fs::create_dir_all(&path).expect("a folder for slices");
    for name in ["s1", "s2", "s3"] {
        let ending = if data.starts_with(b"\xff\xd8") { "jpg" } else { "png" };
        let other = if ending == "jpg" { "png" } else { "jpg" };
        let _ = fs::remove_file(path.join(format!("{name}.{other}")));
        fs::write(path.join(format!("{name}.{ending}")), data).expect("the input as a file");
    }
    survives(&path, &ReadOptions::new().max_voxels(LIMIT));
}

/// Values of a store: frames, records, rows, descriptors, points, sums, keys.
pub fn values(data: &[u8]) {
    hlacdb::fuzz_values(data);
}

/// Statistics at rest.
pub fn statistics(data: &[u8]) {
    if let Ok(statistics) = Statistics::decode(data) {
        let _ = (statistics.covariance(), statistics.extremes());
    }
    let _ = NuisanceStatistics::decode(data);
}

/// Spaces at rest.
pub fn space(data: &[u8]) {
    if let Ok(space) = Space::decode(data) {
        let _ = (space.axes(), space.definition().formula());
    }
}

/// Recipes: parsed, and their textures counted, not made.
pub fn recipe(data: &[u8]) {
    if let Ok(text) = std::str::from_utf8(data) {
        match Recipe::parse(text) {
            Ok(recipe) => assert!(recipe.count() > 0),
            Err(error) => assert!(!error.to_string().contains('\n'), "one sentence, one line: {error}"),
        }
    }
}

/// The list of an export of whole textures.
pub fn list(data: &[u8]) {
    hlacdb::fuzz_list(data);
}

/// The tags of the small store: what a filter could mistake for one another.
const TAGS: &[(&str, &str)] = &[
    ("kind", "ball"),
    ("kind", "stripes"),
    ("kin", "d=ball"),
    ("site", "a=b"),
    ("site", " "),
    ("\u{1f9f1}", "caf\u{e9}"),
    ("a", "b"),
    ("a", "b="),
    ("aa", "b"),
];

/// A small store that is only read, one texture a tag.
fn small() -> Database {
    let path = folder().join("store").join("textures.hlacdb");
    if !path.exists() {
        fs::create_dir_all(folder().join("store")).expect("a folder for the store");
        let database = Database::open(&path).expect("a store");
        for (number, &(key, value)) in TAGS.iter().enumerate() {
            let voxel = |z, y, x| ((z * (number + 2) + y * 5 + x * x) * 7 % 256) as u8;
            let volume = Volume::from_fn([8, 8, 8 + number % 3], voxel).expect("a volume");
            database.add(&volume, Meta::named(format!("texture {number}")).tag(key, value)).expect("a texture");
        }
    }
    OpenOptions::new().read_only(true).open(&path).expect("the store")
}

/// `--where KEY=VALUE`, one a line: what is found is what looking at every texture finds.
pub fn filter(data: &[u8]) {
    static STORE: OnceLock<Database> = OnceLock::new();
    let Ok(text) = std::str::from_utf8(data) else { return };
    let store = STORE.get_or_init(small);
    let filters: Vec<_> = text.lines().filter_map(hlacdb::serve::fuzz::filter).collect();
    let fits = |(key, value): &(&str, &str)| filters.iter().all(|filter| (filter.key(), filter.value()) == (*key, *value));
    let expected: BTreeSet<u64> = (1..).zip(TAGS).filter(|(_, tag)| fits(tag)).map(|(id, _)| id).collect();
    let listed = store.textures(&filters).expect("a filter only finds or finds nothing");
    assert_eq!(listed.iter().map(|texture| texture.id.get()).collect::<BTreeSet<_>>(), expected, "{filters:?}");
    let query = Query::texture(1).k(TAGS.len()).filters(filters.iter().cloned());
    let answer = store.query(&query).expect("a filter only finds or finds nothing");
    assert_eq!(answer.hits.iter().map(|hit| hit.id.get()).collect::<BTreeSet<_>>(), expected, "{filters:?}");
}

/// Requests to the server, each as its text: any answer will do but the server's own failure, or a path of this machine.
/// `UPLOAD` stands for the token of the volume that was asked with last.
pub fn http(data: &[u8]) {
    static SERVER: OnceLock<Mutex<(InProcessServer, Vec<u8>)>> = OnceLock::new();
    let opened = || {
        let options = ServerOptions::new().read_only(true).max_voxels(LIMIT).max_body(1 << 20);
        Mutex::new((InProcessServer::open(small(), options).expect("a server"), b"UPLOAD".to_vec()))
    };
    let mut held = SERVER.get_or_init(opened).lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let (server, token) = &mut *held;
    let request = replaced(data, b"UPLOAD", token);
    let Some((status, body)) = server.answer(&request) else { return };
    assert!(status < 500, "{status}: {}", String::from_utf8_lossy(&body));
    for path in [folder().to_path_buf(), std::env::temp_dir().join("hlacdb-")] {
        let path = path.to_string_lossy();
        let told = position(&body, path.as_bytes()).is_some() && position(&request, path.as_bytes()).is_none();
        assert!(!told, "a path of this machine: {}", String::from_utf8_lossy(&body));
    }
    if let (200, Some(at)) = (status, position(&body, b"{\"token\":\"")) {
        let rest = &body[at + 10..];
        *token = rest[..position(rest, b"\"").unwrap_or(0)].to_vec();
    }
}

fn position(text: &[u8], part: &[u8]) -> Option<usize> {
    text.windows(part.len()).position(|window| window == part)
}

fn replaced(text: &[u8], part: &[u8], by: &[u8]) -> Vec<u8> {
    match position(text, part) {
        Some(at) => [&text[..at], by, &text[at + part.len()..]].concat(),
        None => text.to_vec(),
    }
}
