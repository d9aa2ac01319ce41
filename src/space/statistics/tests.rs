use proptest::prelude::*;

use super::*;
use crate::hlac::{OctantSums, Sums, View};
use crate::space::NuisanceStatistics;

/// Possible sums of views: 16 windows, two in each octant, of intensities drawn by the seed.
fn described(feature_set: &FeatureSet, seed: u64) -> Vec<(View, OctantSums)> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state >> 16
    };
    let mut octant = || {
        let order = |mask: usize| crate::hlac::MASKS[mask].order() as u32;
        Sums { windows: 2, values: std::array::from_fn(|mask| next() % (2 * 255_u64.pow(order(mask)) + 1)) }
    };
    feature_set.views().iter().map(|&view| (view, OctantSums::from(std::array::from_fn(|_| octant())))).collect()
}

fn contributions(feature_set: &FeatureSet, seeds: &[u64]) -> Vec<Contribution> {
    seeds
        .iter()
        .map(|&seed| Contribution::from_sums(feature_set, &described(feature_set, seed)).unwrap().unwrap())
        .collect()
}

fn statistics<'a>(feature_set: &FeatureSet, textures: impl IntoIterator<Item = &'a Contribution>) -> Statistics {
    let mut statistics = Statistics::new(feature_set);
    textures.into_iter().for_each(|texture| statistics.add(texture).unwrap());
    statistics
}

fn feature_sets() -> impl Strategy<Value = FeatureSet> {
    let small = FeatureSet::new(FeatureForm::Pooled, &[View::Full, View::Detail]).unwrap();
    prop_oneof![Just(small), Just(FeatureSet::plain()), Just(FeatureSet::oriented())]
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(12))]

    #[test]
    fn order_merging_and_removal_change_no_bit(
        feature_set in feature_sets(), seeds in proptest::collection::vec(any::<u64>(), 1..12), split in any::<prop::sample::Index>(),
    ) {
        let textures = contributions(&feature_set, &seeds);
        let all = statistics(&feature_set, &textures);
        prop_assert!(statistics(&feature_set, textures.iter().rev()) == all);
        let mut at_once = Statistics::new(&feature_set);
        at_once.add_all(textures.iter()).unwrap();
        prop_assert!(at_once == all);
        let (head, tail) = textures.split_at(split.index(textures.len()));
        let mut merged = statistics(&feature_set, tail);
        merged.merge(&statistics(&feature_set, head)).unwrap();
        prop_assert!(merged == all);
        tail.iter().for_each(|texture| merged.remove(texture).unwrap());
        if merged.extremes_are_stale() {
            let again = head.iter().cloned().map(Ok::<_, SpaceError>);
            merged.renew_extremes(again).unwrap();
        }
        prop_assert!(merged == statistics(&feature_set, head));
        prop_assert!(Statistics::decode(&all.encode()).unwrap() == all);
    }

    #[test]
    fn statistics_follow_the_textbook(feature_set in feature_sets(), seeds in proptest::collection::vec(any::<u64>(), 2..6)) {
        let textures = contributions(&feature_set, &seeds);
        let statistics = statistics(&feature_set, &textures);
        let n = textures.len() as f64;
        let value = |texture: usize, feature: usize| textures[texture].features[feature] as f64 * UNIT;
        let mean = |feature: usize| (0..textures.len()).map(|t| value(t, feature)).sum::<f64>() / n;
        let (covariance, within) = (statistics.between(), statistics.within());
        for (i, j) in [(0, 0), (1, 7), (20, 3), (69, 69)] {
            prop_assert!((statistics.mean()[i] - mean(i)).abs() < 1e-14);
            let products = (0..textures.len()).map(|t| (value(t, i) - mean(i)) * (value(t, j) - mean(j)));
            prop_assert!((covariance[(i, j)] - products.sum::<f64>() / n).abs() < 1e-14);
            let Some(within) = &within else { continue };
            let of_octants = textures.iter().map(|texture| {
                let octants = texture.octants.as_ref().unwrap();
                let mean = |f: usize| octants[f].iter().sum::<i64>() as f64 / 8.0;
                let product = |o: usize| (octants[i][o] as f64 - mean(i)) * (octants[j][o] as f64 - mean(j));
                (0..8).map(product).sum::<f64>() * UNIT * UNIT * (8.0 / 7.0) / 8.0
            });
            prop_assert!((within[(i, j)] - of_octants.sum::<f64>() / n).abs() < 1e-14);
        }
        prop_assert!((statistics.deviation()[5] - covariance[(5, 5)].sqrt()).abs() < 1e-15);
        prop_assert_eq!(statistics.covariance()[1], covariance[(1, 0)]);
        if let Some((lowest, highest)) = statistics.extremes() {
            let values = |f: usize| (0..textures.len()).map(move |t| value(t, f));
            prop_assert_eq!(lowest[3], values(3).fold(1.0, f64::min));
            prop_assert_eq!(highest[3], values(3).fold(0.0, f64::max));
        }
    }

    #[test]
    fn nuisance_is_half_the_mean_square_of_the_difference(seeds in proptest::collection::vec(any::<u64>(), 2..5)) {
        let feature_set = FeatureSet::new(FeatureForm::Pooled, &[View::Full]).unwrap();
        let textures = contributions(&feature_set, &seeds);
        let (mut nuisance, mut rest) = (NuisanceStatistics::new(&feature_set), NuisanceStatistics::new(&feature_set));
        nuisance.add(&textures[0], &textures[1]).unwrap();
        textures.windows(2).skip(1).for_each(|pair| rest.add(&pair[1], &pair[0]).unwrap());
        nuisance.merge(&rest).unwrap();
        let difference = |pair: &[Contribution], f: usize| (pair[0].features[f] - pair[1].features[f]) as f64 * UNIT;
        let squares = textures.windows(2).map(|pair| difference(pair, 4) * difference(pair, 9)).sum::<f64>();
        let expected = squares / (2.0 * (textures.len() - 1) as f64);
        prop_assert!((nuisance.covariance()[(4, 9)] - expected).abs() < 1e-15);
        prop_assert!(NuisanceStatistics::decode(&nuisance.encode()).unwrap() == nuisance);
    }
}

#[test]
fn the_bytes_are_frozen() {
    let hash = |bytes: &[u8]| xxhash_rust::xxh3::xxh3_64(bytes);
    let feature_set = FeatureSet::new(FeatureForm::Pooled, &[View::Full]).unwrap();
    let pooled = statistics(&feature_set, &contributions(&feature_set, &[1, 2, 3])).encode();
    let plain = statistics(&FeatureSet::plain(), &contributions(&FeatureSet::plain(), &[1, 2, 3])).encode();
    assert_eq!(pooled[..22], *b"hSta\x01\x00\x02\x01\x00\x00\x00\x00\x03\x00\x00\x00\x00\x00\x00\x00\x23\x00");
    assert_eq!((pooled.len(), hash(&pooled)), (14_121, 13_350_344_732_353_034_205));
    assert_eq!((plain.len(), hash(&plain)), (352_453, 2_054_713_804_004_997_984));
}

#[test]
fn wrong_feature_sets_and_overdrafts_are_refused() {
    let pooled = FeatureSet::new(FeatureForm::Pooled, &[View::Full]).unwrap();
    let (plain, other) = (contributions(&FeatureSet::plain(), &[1]), contributions(&pooled, &[1]));
    let mut statistics = Statistics::new(&pooled);
    assert!(matches!(statistics.add(&plain[0]), Err(SpaceError::FeatureSet { .. })));
    assert!(matches!(statistics.remove(&other[0]), Err(SpaceError::Overdrawn { .. })));
    assert!(matches!(statistics.merge(&Statistics::new(&FeatureSet::plain())), Err(SpaceError::FeatureSet { .. })));
    assert_eq!(statistics, Statistics::new(&pooled));
}

#[test]
fn one_texture_has_no_deviation_and_none_has_no_mean() {
    for feature_set in [FeatureSet::plain(), FeatureSet::new(FeatureForm::Pooled, &[View::Full]).unwrap()] {
        let none = Statistics::new(&feature_set);
        assert!(none.mean().iter().chain(&none.deviation()).chain(&none.covariance()).all(|&value| value == 0.0));
        assert_eq!(none.extremes(), None);
        let texture = &contributions(&feature_set, &[5])[0];
        let equal = statistics(&feature_set, [texture, texture, texture]);
        assert!(equal.deviation().iter().chain(&equal.covariance()).all(|&value| value == 0.0));
    }
}

#[test]
fn without_octants_only_features_are_added_and_removed() {
    let feature_set = FeatureSet::new(FeatureForm::Pooled, &[View::Full]).unwrap();
    let with = &contributions(&feature_set, &[8])[0];
    let moments = described(&feature_set, 8)[0].1.total().descriptor();
    let without = Contribution::from_moments(&feature_set, |_| Some(&moments)).unwrap().unwrap();
    let mut statistics = statistics(&feature_set, [with, &without]);
    assert_eq!((statistics.count(), statistics.octant_count()), (2, 1));
    statistics.remove(&without).unwrap();
    statistics.remove(with).unwrap();
    assert_eq!(statistics, Statistics::new(&feature_set));
    assert_eq!(Contribution::from_moments(&feature_set, |_| None).unwrap(), None);
}

#[test]
fn a_side_of_three_voxels_has_no_octants() {
    let volume = crate::volume::Volume::from_fn([3, 8, 8], |z, y, x| (z * y * x) as u8).unwrap();
    let feature_set = FeatureSet::oriented();
    let contribution =
        Contribution::from_sums(&feature_set, &crate::describe(&volume, feature_set.views())).unwrap().unwrap();
    assert!(contribution.octants.is_none());
}
