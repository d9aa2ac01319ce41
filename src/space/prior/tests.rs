use super::*;
use crate::hlac::orbits::symmetries;
use crate::space::fixtures::{described, features, volume};
use crate::space::{Definition, Space, Statistics};

fn observations() -> Observations {
    let mut observations = Observations::default();
    for seed in 0..30 {
        observations.add(&volume(seed), &[volume(seed + 100)]).unwrap();
    }
    observations
}

fn close(a: &Matrix, b: &Matrix, tolerance: f64) -> bool {
    let size = b.values().iter().fold(0.0_f64, |size, value| size.max(value.abs()));
    a.values().iter().zip(b.values()).all(|(a, b)| (a - b).abs() <= tolerance * size)
}

#[test]
fn a_prior_restores_its_statistics() {
    let observations = observations();
    let prior = Prior::decode(&observations.encode()).unwrap();
    assert_eq!((prior.textures(), prior.weight()), (30, WEIGHT));
    let model = prior.model(&FeatureSet::stored()).unwrap();
    assert_eq!(model.mean, observations.pooled.mean());
    assert!(close(&model.between, &observations.pooled.between(), 1e-6));
    assert!(close(&model.within, &observations.pooled.within().unwrap(), 1e-6));
    assert!(close(&model.nuisance, &observations.nuisance.covariance(), 1e-6));
    let views = [FeatureSet::stored().views()[4], FeatureSet::stored().views()[1]];
    let part = prior.model(&FeatureSet::new(FeatureForm::Pooled, &views).unwrap()).unwrap();
    assert_eq!((part.mean.len(), part.mean[0], part.mean[35]), (70, model.mean[35], model.mean[4 * 35]));
    assert_eq!(part.between[(1, 36)], model.between[(36, 4 * 35 + 1)]);
}

#[test]
fn the_oriented_part_has_no_preferred_direction() {
    let observations = observations();
    let model = Prior::decode(&observations.encode()).unwrap().model(&FeatureSet::oriented()).unwrap();
    for symmetry in symmetries() {
        let turned = |mask: usize| usize::from(symmetry[mask]);
        for (i, j) in [(3, 3), (0, 200), (17, 90), (250, 101)] {
            assert_eq!(model.between[(i, j)], model.between[(turned(i), turned(j))]);
            assert_eq!(model.within[(i, j)], model.within[(turned(j), turned(i))]);
            assert_eq!(model.mean[i], model.mean[turned(i)]);
        }
    }
    let trace = |matrix: &Matrix| (0..MASK_COUNT).map(|at| matrix[(at, at)]).sum::<f64>();
    assert!((trace(&model.between) / trace(&observations.oriented.between()) - 1.0).abs() < 1e-12);
}

#[test]
fn other_feature_sets_are_not_covered() {
    let prior = Prior::decode(&observations().encode()).unwrap();
    let of = |form, views: &[hlac::View]| FeatureSet::new(form, views).unwrap();
    assert!(
        prior.covers(&of(FeatureForm::Pooled, &hlac::View::LIKENESS[3..5])) && prior.covers(&FeatureSet::oriented())
    );
    assert!(prior.covers(&of(FeatureForm::Pooled, &[hlac::View::Full])));
    for feature_set in [
        of(FeatureForm::Pooled, &[hlac::View::ALL[8]]),
        of(FeatureForm::Roots, &[hlac::View::Full]),
        FeatureSet::plain(),
    ] {
        assert!(!prior.covers(&feature_set) && prior.model(&feature_set).is_none());
    }
    assert!(Prior::none().model(&FeatureSet::pooled()).is_none());
}

#[test]
fn merged_parts_equal_the_whole() {
    let mut parts = [Observations::default(), Observations::default()];
    let mut whole = Observations::default();
    for seed in 0..6 {
        for observations in [&mut whole, &mut parts[seed % 2]] {
            observations.add(&volume(seed as u64), &[volume(50)]).unwrap();
        }
    }
    let [mut first, second] = parts;
    first.merge(&second).unwrap();
    assert!(first == whole && first.encode() == whole.encode());
}

#[test]
fn the_weight_decides_between_prior_and_store() {
    let prior = Prior::decode(&observations().encode()).unwrap();
    let definition = Definition::built_in("default").unwrap();
    let textures: Vec<_> = (200..212).map(described).collect();
    let own = crate::space::fixtures::statistics(&definition.feature_set, &textures);
    let none = Statistics::new(&definition.feature_set);
    let point = |statistics: &Statistics, prior: Prior| {
        let space = Space::fit(&definition, statistics, None, &prior).unwrap();
        space.point(&features(space.feature_set(), &textures[0])).unwrap()
    };
    let apart = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let known = point(&none, prior.clone());
    assert_eq!(point(&none, prior.clone().with_weight(5.0)), known);
    assert!(apart(&point(&own, prior.clone().with_weight(1e12)), &known) < 1e-4);
    assert_eq!(point(&own, prior.clone().with_weight(0.0)), point(&own, Prior::none()));
    assert_ne!(point(&own, prior), known);
}

#[test]
fn the_shipped_prior_is_frozen() {
    let bytes = include_bytes!("../prior.bin");
    assert!(bytes.len() < 400_000, "{} bytes", bytes.len());
    let prior = Prior::decode(bytes).unwrap();
    let definition = Definition::built_in("default").unwrap();
    let space = Space::fit(&definition, &Statistics::new(&definition.feature_set), None, &prior).unwrap();
    let point = space.point(&features(space.feature_set(), &described(1))).unwrap();
    let bits: Vec<u32> = point[..4].iter().map(|coordinate| coordinate.to_bits()).collect();
    let hash = xxhash_rust::xxh3::xxh3_64(bytemuck::cast_slice(&point));
    assert_eq!(
        (bits, hash),
        (vec![1_036_678_897, 1_049_393_595, 1_033_891_628, 3_171_927_937], 14_612_867_029_250_138_542)
    );
}

#[test]
fn the_bits_of_a_new_prior_are_frozen() {
    assert_eq!(xxhash_rust::xxh3::xxh3_64(&observations().encode()), 10_155_214_332_744_276_875);
}
