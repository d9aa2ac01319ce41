//! Queries on a warm index, and index builds.
//!
//! ```sh
//! cargo bench --bench query                        # everything
//! cargo bench --bench query -- index/100000        # one size
//! cargo bench --bench query -- database            # whole queries to a database
//! ```
//!
//! For 600 to a million points of 32 coordinates, prints the median and the 95th percentile over a thousand query points that
//! are not rows, for the linear scan and the k-d tree, after checking that both give the same bits. Then criterion measures
//! the same for comparison between versions, and whole queries to a database of 600 textures, whose names and tags are read
//! from the store.

// A benchmark without its input cannot continue.
#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs)]

#[path = "support/points.rs"]
mod points;

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use hlacdb::hlac::View;
use hlacdb::internals::index::{Index, IndexMethod, KdTree, KnnQuery, Points};
use hlacdb::space::Metric;
use hlacdb::{OpenOptions, Query};
use points::{DIMS, Origin};

const SIZES: [usize; 4] = [600, 10_000, 100_000, 1_000_000];
const QUERIES: usize = 1000;

/// An index with a tree.
fn index(rows: usize, coordinates: &[f32]) -> Index {
    let ids: Vec<u64> = (1..=rows as u64).collect();
    let mut index = Index::from_points(Points::from_rows(Metric::L2, DIMS, &ids, coordinates).unwrap());
    index.rebuild();
    index
}

fn search(index: &Index, point: &[f32], k: usize, method: IndexMethod) -> Vec<(u64, u64)> {
    let hits = index.search(&KnnQuery::nearest(point, k), method).unwrap();
    hits.iter().map(|hit| (hit.id, hit.distance.to_bits())).collect()
}

/// Median and 95th percentile, in microseconds.
fn figures(mut times: Vec<Duration>) -> String {
    times.sort();
    let at = |share: usize| times[times.len() * share / 100].as_secs_f64() * 1e6;
    format!("{:9.1} {:9.1}", at(50), at(95))
}

/// Compares the answers, then prints the table of medians.
fn table(index: &Index, queries: &[f32]) {
    let rows = index.points().len();
    for k in [10, 30] {
        for point in queries.chunks_exact(DIMS).take(100) {
            assert_eq!(
                search(index, point, k, IndexMethod::Linear),
                search(index, point, k, IndexMethod::KdTree),
                "{rows} rows"
            );
        }
        for method in [IndexMethod::Linear, IndexMethod::KdTree, IndexMethod::Auto] {
            let times = queries.chunks_exact(DIMS).map(|point| {
                let start = Instant::now();
                black_box(index.search(&KnnQuery::nearest(point, k), method).unwrap());
                start.elapsed()
            });
            println!("{rows:>8} {k:>3} {:<7} {}", method.name(), figures(times.collect()));
        }
    }
}

fn index_benches(criterion: &mut Criterion) {
    let origin = Origin::find();
    let queries = origin.drawn(QUERIES, 99);
    println!("points: {}", origin.name());
    println!("    rows   k index   median us    95 % us");
    for rows in SIZES {
        let coordinates = origin.points(rows, rows as u64);
        let index = index(rows, &coordinates);
        table(&index, &queries);
        let mut group = criterion.benchmark_group(format!("index/{rows}"));
        group.sample_size(20);
        for k in [10, 30] {
            for method in [IndexMethod::Linear, IndexMethod::KdTree] {
                let mut points = queries.chunks_exact(DIMS).cycle();
                group.bench_function(BenchmarkId::new(method.name(), k), |bench| {
                    bench.iter_batched(
                        || points.next().unwrap(),
                        |point| index.search(&KnnQuery::nearest(point, k), method).unwrap(),
                        BatchSize::SmallInput,
                    );
                });
            }
        }
        group.sample_size(10);
        group.bench_function("build", |bench| bench.iter(|| KdTree::build(index.points()).unwrap().rows()));
        group.finish();
    }
}

/// The paper's query: the nearest 30 of 600 textures, with names and tags.
fn database_benches(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().unwrap();
    let database = OpenOptions::new().views(&[View::Full]).open(folder.path().join("t.hlacdb")).unwrap();
    let rows: Vec<f32> =
        (0..600 * 251).map(|at| (at as f32 * 0.618_034).fract() * 0.5 + (at / 251 % 7) as f32 * 0.05).collect();
    let array = folder.path().join("rows.npy");
    hlacdb::arrays::write_npy(&array, &[600, 251], &rows).unwrap();
    let tags = [("family".to_owned(), "drawn".to_owned())].into();
    database.import(&array, &[View::Full], None, &tags, &()).unwrap();
    let ask = |id: u64| database.query(&Query::texture(id).k(30)).unwrap();
    let times = (0..2000).map(|at| {
        let start = Instant::now();
        black_box(ask(1 + at % 600));
        start.elapsed()
    });
    println!("     600  30 with names and tags {}", figures(times.collect()));
    let mut group = criterion.benchmark_group("database");
    let mut ids = (1..=600).cycle();
    group.bench_function("top 30 of 600", |bench| {
        bench.iter_batched(|| ids.next().unwrap(), ask, BatchSize::SmallInput);
    });
    let mut ids = (1..=600).cycle();
    group.bench_function("top 30 of 600, filtered", |bench| {
        let ask = |id| database.query(&Query::texture(id).k(30).filter("family", "drawn")).unwrap();
        bench.iter_batched(|| ids.next().unwrap(), ask, BatchSize::SmallInput);
    });
    group.finish();
}

criterion_group!(benches, database_benches, index_benches);
criterion_main!(benches);
