//! Spaces of synthetic families, of their copies under nuisances, and of real moments.

use hlacdb::hlac::{MASK_COUNT, View};
use hlacdb::internals::space::{Contribution, Prior};
use hlacdb::space::{Definition, Descriptor, FeatureSet, Features, Space, Statistics};
use hlacdb::synth::{self, Nuisance};
use hlacdb::volume::Volume;
use hlacdb::volume::npy::NpyReader;

use hlacdb_testing::data;

fn features(feature_set: &FeatureSet, volume: &Volume) -> Features {
    Descriptor::from_sums(&hlacdb::describe(volume, feature_set.views())).unwrap().features(feature_set)
}

/// The default space of a store without textures: that of the prior.
fn default_space() -> Space {
    let definition = Definition::built_in("default").unwrap();
    Space::fit(&definition, &Statistics::new(&definition.feature_set), None, &Prior::shipped()).unwrap()
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
}

#[test]
fn a_turned_brighter_noisier_copy_finds_its_family_first() {
    let groups = ["marble", "wood", "granite", "perlin", "ridged", "agate"]
        .map(|family| format!("[[group]]\nfamily = \"{family}\"\ncount = 3\n"));
    let recipe = format!("name = \"few\"\nseed = 5\nsize = 32\n{}", groups.concat());
    let specimens = synth::Recipe::parse(&recipe).unwrap().specimens();
    let space = default_space();
    let volumes: Vec<Volume> = specimens.iter().map(synth::Specimen::volume).collect();
    let point = |volume: &Volume| space.point(&features(space.feature_set(), volume)).unwrap();
    let store: Vec<Vec<f32>> = volumes.iter().map(point).collect();
    let mut found = 0;
    for (at, volume) in volumes.iter().enumerate() {
        let query = point(&Nuisance::ALL.draw(at as u64).apply(volume));
        let distance = |other: &usize| squared_distance(&query, &store[*other]);
        let nearest = (0..store.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
        found += usize::from(specimens[nearest].tags["family"] == specimens[at].tags["family"]);
    }
    assert!(found >= 17, "{found} of {}", volumes.len());
}

#[test]
fn turns_hardly_move_the_default_point() {
    let recipe = "name = \"one\"\nseed = 5\nsize = 32\n[[group]]\nfamily = \"wood\"\ncount = 2\n";
    let specimens = synth::Recipe::parse(recipe).unwrap().specimens();
    let [texture, unlike] = [0, 1].map(|at: usize| specimens[at].volume());
    let turned = "rotation".parse::<Nuisance>().unwrap().draw(2).apply(&texture);
    assert_ne!(turned, texture);
    let space = default_space();
    let [a, b, c] =
        [&texture, &turned, &unlike].map(|volume| space.point(&features(space.feature_set(), volume)).unwrap());
    // After a turn the windows at the border leave out other voxels, so the points differ a little.
    let (turned, other) = (squared_distance(&a, &b), squared_distance(&a, &c));
    assert!(turned < 0.03 * other, "{turned} {other}");
    let [texture, unlike] = [&texture, &unlike].map(|volume| features(space.feature_set(), volume));
    let explained = space.explain(&texture, &unlike).unwrap();
    assert!((explained.total / other - 1.0).abs() < 1e-4);
}

#[test]
fn small_textures_have_points() {
    let space = default_space();
    for side in [3, 4, 7, 8, 15] {
        let volume = Volume::from_fn([side; 3], |z, y, x| (z * 50 + y * 20 + x * 7) as u8).unwrap();
        let features = features(space.feature_set(), &volume);
        assert_eq!(features.is_complete(), side >= 16);
        let point = space.point(&features).unwrap();
        assert!((squared_distance(&point, &[0.0; 32]) - 1.0).abs() < 1e-6, "{side}");
    }
}

#[test]
fn statistics_of_real_moments_follow_the_textbook() {
    let Some(path) = data("moments_20k.npy") else { return };
    let rows: Vec<f32> = NpyReader::open(&path).unwrap().read(1500 * MASK_COUNT as u64).unwrap();
    let (rows, _) = rows.as_chunks::<MASK_COUNT>();
    let descriptors: Vec<Descriptor> =
        rows.iter().map(|row| Descriptor::from_moments([(View::Full, *row)]).unwrap()).collect();
    let feature_set = FeatureSet::plain();
    let mut statistics = Statistics::new(&feature_set);
    for descriptor in &descriptors {
        statistics.add(&Contribution::from_descriptor(&feature_set, descriptor).unwrap()).unwrap();
    }
    let n = rows.len() as f64;
    for feature in [0, 1, 13, 14, 250] {
        let values = || rows.iter().map(|row| f64::from(row[feature]));
        let mean = values().sum::<f64>() / n;
        let deviation = (values().map(|value| (value - mean).powi(2)).sum::<f64>() / n).sqrt();
        assert!((statistics.mean()[feature] - mean).abs() < 1e-12);
        assert!((statistics.deviation()[feature] - deviation).abs() < 1e-9);
    }
    let definition = Definition::built_in("zscore").unwrap();
    let space = Space::fit(&definition, &statistics, None, &Prior::none()).unwrap();
    let points = space.points(&descriptors);
    assert!(points.iter().all(|coordinate| coordinate.is_finite()));
}
