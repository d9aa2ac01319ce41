//! Stores of thousands of textures: mass removal in a running server, and spaces that load at the same time.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Barrier;

use hlacdb::hlac::{MASK_COUNT, View};
use hlacdb::serve::ServerOptions;
use hlacdb::{Database, OpenOptions, arrays};
use serde_json::{Value, json};

use super::server::TestServer;

const TEXTURES: u64 = 9000;

/// A store of textures without voxels, whose moments vary in three directions.
fn fill(path: &Path) -> Database {
    let rows: Vec<f32> = (0..TEXTURES as usize)
        .flat_map(|row| {
            let share = |factor: f64| (row as f64 * factor).fract();
            let (mean, contrast, phase) = (0.2 + 0.5 * share(0.618_034), share(0.414_214), share(0.732_051));
            (0..MASK_COUNT).map(move |mask| {
                let cells = if mask == 0 {
                    1
                } else if mask < 14 {
                    2
                } else {
                    3
                };
                let detail = 1.0 + 0.1 * contrast * (6.0 * phase + mask as f64 * 0.37).sin();
                (mean.powi(cells) * detail).min(1.0) as f32
            })
        })
        .collect();
    let array = path.with_extension("npy");
    arrays::write_npy(&array, &[TEXTURES as usize, MASK_COUNT], &rows).unwrap();
    let database = OpenOptions::new().views(&[View::Full]).open(path).unwrap();
    let report = database.import(&array, &[View::Full], None, &BTreeMap::new(), &()).unwrap();
    assert_eq!(report.added, TEXTURES);
    database
}

/// The hits of a query by one texture: ids and distances.
fn hits(server: &TestServer, id: u64, k: u64, space: &str) -> Vec<(u64, f64)> {
    let answer = server.post("query", &json!({"ids": [id], "k": k, "space": space, "exclude_self": false})).json();
    let hit = |hit: &Value| (hit["id"].as_u64().unwrap(), hit["distance"].as_f64().unwrap());
    answer["hits"].as_array().unwrap().iter().map(hit).collect()
}

/// After more than 2048 textures and more than a quarter of all have been removed, trees that were built before no longer
/// fit. Queries stay exact, before and after new trees are built in the background.
#[test]
fn queries_stay_exact_after_mass_removal_in_a_running_server() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.hlacdb");
    let writer = fill(&path);
    let reader = OpenOptions::new().read_only(true).open(&path).unwrap();
    let server = TestServer::serving(folder, reader, ServerOptions::new().read_only(true));
    let queried = [1, 77, 1234, 4000, 8999];
    let before: Vec<Vec<(u64, f64)>> = queried.iter().map(|&id| hits(&server, id, TEXTURES, "default")).collect();
    // Enough queries that a tree is worth building.
    for id in 1..=40 {
        assert_eq!(hits(&server, id, 1, "default")[0], (id, 0.0));
    }
    let removed: Vec<u64> = (1..=TEXTURES).filter(|id| id % 5 < 2 && !queried.contains(id)).collect();
    assert!(removed.len() > 2048 && removed.len() as u64 > TEXTURES / 4);
    writer.remove(&removed).unwrap();
    for _ in 0..12 {
        for (id, ranking) in queried.iter().zip(&before) {
            let expected: Vec<(u64, f64)> =
                ranking.iter().filter(|(id, _)| removed.binary_search(id).is_err()).take(30).copied().collect();
            assert_eq!(hits(&server, *id, 30, "default"), expected, "the nearest to {id}");
        }
    }
    assert_eq!(server.json("health")["textures"], TEXTURES - removed.len() as u64);
    assert_eq!(server.json("textures?limit=1")["total"], TEXTURES - removed.len() as u64);
}

/// The first queries of a server may ask for several spaces at once, from many connections.
#[test]
fn two_spaces_load_at_the_same_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.hlacdb");
    drop(fill(&path));
    let spaces = ["default", "paper"];
    let queried = [3_u64, 500, 7777];
    let open = || OpenOptions::new().read_only(true).open(&path).unwrap();
    let serve = || TestServer::serving(tempfile::tempdir().unwrap(), open(), ServerOptions::new().read_only(true));
    // The reference: one query after another.
    let reference = serve();
    let expected: BTreeMap<(&str, u64), Vec<(u64, f64)>> =
        spaces.iter().flat_map(|space| queried.map(|id| ((*space, id), hits(&reference, id, 20, space)))).collect();
    assert_ne!(expected[&("default", 3)], expected[&("paper", 3)]);
    let server = serve();
    let start = Barrier::new(8);
    std::thread::scope(|scope| {
        for client in 0..8 {
            let (server, start, expected) = (&server, &start, &expected);
            scope.spawn(move || {
                start.wait();
                for turn in 0..6 {
                    let space = spaces[(client + turn) % 2];
                    let id = queried[(client / 2 + turn) % 3];
                    assert_eq!(hits(server, id, 20, space), expected[&(space, id)], "{space}, {id}");
                }
            });
        }
    });
}
