//! The cost of describing a texture in all views, adding it to statistics, fitting a space, and mapping to points.
//!
//! ```sh
//! cargo bench --bench space
//! ```
//!
//! Each benchmark checks its result once before it is timed.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use hlacdb::hlac::{OctantSums, View, kernels};
use hlacdb::internals::space::{Contribution, Prior};
use hlacdb::space::{Definition, Descriptor, FeatureSet, Space, Statistics};
use hlacdb::synth;
use hlacdb::volume::Volume;

/// A texture of 64^3 voxels.
fn texture() -> Volume {
    let recipe = "name = \"bench\"\nseed = 3\nsize = 64\n[[group]]\nfamily = \"fbm\"\ncount = 1\n";
    let specimens = synth::Recipe::parse(recipe).map(|recipe| recipe.specimens()).unwrap_or_default();
    specimens[0].volume()
}

fn described() -> Vec<(View, OctantSums)> {
    hlacdb::describe(&texture(), &View::STANDARD)
}

fn describe(criterion: &mut Criterion) {
    let volume = texture();
    assert_eq!(described()[0].1, hlacdb::octant_sums(&volume));
    let mut group = criterion.benchmark_group(format!("describe 64^3, {}", kernels::active()));
    group.bench_function("plain sums", |bencher| bencher.iter(|| hlacdb::octant_sums(black_box(&volume))));
    group.bench_function("eight views", |bencher| {
        bencher.iter(|| hlacdb::describe(black_box(&volume), &View::STANDARD));
    });
    for view in View::STANDARD {
        group.bench_function(format!("{view} alone"), |bencher| {
            bencher.iter(|| hlacdb::describe(black_box(&volume), &[view]))
        });
    }
    group.finish();
}

fn count(criterion: &mut Criterion) {
    let described = described();
    for feature_set in [FeatureSet::plain(), FeatureSet::oriented(), FeatureSet::pooled()] {
        let contribution = Contribution::from_sums(&feature_set, &described).ok().flatten();
        let Some(contribution) = contribution else { continue };
        let mut statistics = Statistics::new(&feature_set);
        let mut group = criterion.benchmark_group(format!("count {feature_set}"));
        group.bench_function("features", |bencher| {
            bencher.iter(|| Contribution::from_sums(&feature_set, black_box(&described)))
        });
        group.bench_function("add", |bencher| bencher.iter(|| statistics.add(black_box(&contribution))));
        group.bench_function("encode", |bencher| bencher.iter(|| black_box(&statistics).encode()));
        let bytes = statistics.encode();
        assert_eq!(Statistics::decode(&bytes).as_ref(), Ok(&statistics));
        group.bench_function("decode", |bencher| bencher.iter(|| Statistics::decode(black_box(&bytes))));
        group.finish();
    }
}

fn fit(criterion: &mut Criterion) {
    let described = described();
    let mut group = criterion.benchmark_group("fit");
    group.sample_size(20);
    for name in ["oriented", "default"] {
        let Some(definition) = Definition::built_in(name) else { continue };
        let mut statistics = Statistics::new(&definition.feature_set);
        if let Ok(Some(contribution)) = Contribution::from_sums(&definition.feature_set, &described) {
            assert!(statistics.add(&contribution).is_ok());
        }
        let prior = Prior::shipped();
        group.bench_function(name, |bencher| {
            bencher.iter(|| Space::fit(&definition, black_box(&statistics), None, &prior));
        });
    }
    group.finish();
}

fn map(criterion: &mut Criterion) {
    const ROWS: usize = 1000;
    let described = described();
    let Ok(descriptor) = Descriptor::from_sums(&described) else { return };
    let descriptors = vec![descriptor; ROWS];
    let mut group = criterion.benchmark_group("map 1000 descriptors");
    for name in Definition::BUILT_IN {
        let Some(definition) = Definition::built_in(name) else { continue };
        let statistics = Statistics::new(&definition.feature_set);
        let Ok(space) = Space::fit(&definition, &statistics, None, &Prior::shipped()) else { continue };
        assert_eq!(space.points(&descriptors).len(), ROWS * space.dims());
        group.bench_function(name, |bencher| bencher.iter(|| space.points(black_box(&descriptors))));
    }
    group.finish();
}

criterion_group!(benches, describe, count, fit, map);
criterion_main!(benches);
