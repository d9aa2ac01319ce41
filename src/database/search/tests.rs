//! Trees over thousands of rows, built while queries run.

use std::sync::Arc;

use rand::RngExt;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::database::Database;
use crate::database::points::live::LiveSpace;
use crate::database::scheme::DEFAULT_SPACE;
use crate::hlac::{MASK_COUNT, View};
use crate::index::IndexMethod;
use crate::store::{NewTexture, ViewCode};
use crate::{OpenOptions, Query};

/// A store of textures with random moments of one view.
fn filled(folder: &std::path::Path, textures: usize) -> Database {
    let database = OpenOptions::new().views(&[View::Full]).open(folder.join("textures.hlacdb")).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut texture = || {
        let level: f32 = rng.random_range(0.1..0.9);
        let moments: [f32; MASK_COUNT] = std::array::from_fn(|_| level * rng.random_range(0.3..1.0_f32));
        NewTexture { descriptors: vec![(ViewCode(View::Full.code()), moments)], ..NewTexture::default() }
    };
    let textures = (0..textures).map(|_| texture()).collect();
    database.add_described(textures).unwrap();
    database
}

fn live(database: &Database) -> Arc<LiveSpace> {
    database.spaces.get(DEFAULT_SPACE).unwrap()
}

/// Queries by `method`, one after another, and the indexes that answered them. The hits are those of the scan, to the bit.
fn query_each(database: &Database, ids: impl Iterator<Item = u64>, method: IndexMethod) -> Vec<&'static str> {
    let query = |id| {
        let by = |method| database.query(&Query::texture(id).k(5).index(method)).unwrap();
        let (answer, scanned) = (by(method), by(IndexMethod::Linear));
        let bits = |answer: &crate::Answer| -> Vec<(u64, u64)> {
            answer.hits.iter().map(|hit| (hit.id.get(), hit.distance.to_bits())).collect()
        };
        assert_eq!(bits(&answer), bits(&scanned));
        assert_eq!(answer.hits[0].id, id);
        answer.index
    };
    ids.map(query).collect()
}

#[test]
fn many_queries_from_several_threads_build_one_tree() {
    let folder = tempfile::tempdir().unwrap();
    let database = filled(folder.path(), 5000);
    std::thread::scope(|threads| {
        for thread in 0..4 {
            let database = &database;
            threads.spawn(move || query_each(database, (1..=40).map(|n| n * 100 + thread), IndexMethod::Auto));
        }
    });
    let live = live(&database);
    live.wait_for_build();
    assert_eq!(live.builds(), 1);
    assert_eq!(query_each(&database, 1..20, IndexMethod::Auto), ["kdtree"; 19]);
    live.wait_for_build();
    assert_eq!(live.builds(), 1);
}

#[test]
fn mass_removal_compacts_once_and_is_not_rebuilt_again() {
    let folder = tempfile::tempdir().unwrap();
    let database = filled(folder.path(), 7000);
    query_each(&database, 1..30, IndexMethod::Auto);
    live(&database).wait_for_build();
    assert_eq!(live(&database).builds(), 1);
    database.remove(1..=2400).unwrap();
    for _ in 0..6 {
        query_each(&database, 3000..3010, IndexMethod::Auto);
        live(&database).wait_for_build();
    }
    assert_eq!(live(&database).builds(), 2, "one build for the removal");
    let points = live(&database).state().index.points().clone();
    assert_eq!((points.rows(), points.removed()), (4600, 0));
    assert_eq!(query_each(&database, 5000..5010, IndexMethod::Auto), ["kdtree"; 10]);
}

#[test]
fn a_large_batch_builds_the_tree_first_and_a_small_one_does_not() {
    let folder = tempfile::tempdir().unwrap();
    let database = filled(folder.path(), 5000);
    let batch = |ids: std::ops::Range<u64>, method| {
        let queries: Vec<Query<'_>> = ids.map(|id| Query::texture(id).k(5).index(method)).collect();
        database.query_all(&queries).unwrap()
    };
    let small = batch(1..5, IndexMethod::Auto);
    assert!(small.iter().all(|answer| answer.index == "linear"));
    assert_eq!(live(&database).builds(), 0);
    let all = batch(1..2001, IndexMethod::Auto);
    assert!(all.iter().all(|answer| answer.index == "kdtree"));
    assert_eq!(live(&database).builds(), 1);
    for (answer, scanned) in all.iter().zip(batch(1..2001, IndexMethod::Linear)) {
        assert_eq!(answer.hits, scanned.hits);
    }
    // Queries that no tree answers build none.
    let other = filled(tempfile::tempdir().unwrap().path(), 5000);
    let queries: Vec<Query<'_>> = (1..600).map(|id| Query::texture(id).within(0.001)).collect();
    other.query_all(&queries).unwrap();
    assert_eq!(live(&other).builds(), 0);
}
