use super::*;
use crate::space::fixtures::{described, features, statistics};
use crate::space::{FeatureForm, FeaturePart};

fn textures(count: u64) -> Vec<Vec<(View, crate::hlac::OctantSums)>> {
    (0..count).map(described).collect()
}

fn fitted(name: &str, textures: &[Vec<(View, crate::hlac::OctantSums)>], prior: &Prior) -> Space {
    let definition = Definition::built_in(name).unwrap();
    Space::fit(&definition, &statistics(&definition.feature_set, textures), None, prior).unwrap()
}

fn squared_distance(a: &[f32], b: &[f32]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
}

#[test]
fn points_are_finite_and_of_unit_length_for_any_statistics() {
    let some = textures(6);
    let equal = vec![some[0].clone(); 3];
    for name in Definition::BUILT_IN {
        for store in [&some[..0], &some[..1], &some[..2], &equal, &some] {
            for prior in [Prior::none(), Prior::shipped()] {
                let space = fitted(name, store, &prior);
                for texture in &some {
                    let point = space.point(&features(space.feature_set(), texture)).unwrap();
                    assert_eq!(point.len(), space.dims());
                    assert!(point.iter().all(|coordinate| coordinate.is_finite()), "{name} of {}", store.len());
                    let length = squared_distance(&point, &vec![0.0; point.len()]);
                    if let (Map::Likeness(_), true) = (&space.map, prior.weight() > 0.0) {
                        assert!((length - 1.0).abs() < 1e-6, "{name} of {}: {length}", store.len());
                    }
                }
                assert_eq!(Space::decode(&space.encode()).unwrap(), space);
                assert!(space.axes().iter().all(|axis| axis.variance.is_finite()));
            }
        }
    }
}

#[test]
fn the_papers_points_are_sums_per_window() {
    let texture = &textures(1)[0];
    let space = fitted("paper", &[], &Prior::none());
    let point = space.point(&features(space.feature_set(), texture)).unwrap();
    let sums = texture[0].1.total();
    for (coordinate, &sum) in point.iter().zip(&sums.values) {
        let exact = sum as f64 / sums.windows as f64;
        assert!((f64::from(*coordinate) / exact - 1.0).abs() < 1e-6);
    }
    assert_eq!(space.metric(), Metric::L1);
}

#[test]
fn the_intersection_distance_is_one_minus_the_intersection() {
    let textures = textures(2);
    let definition =
        Definition { name: "shares".into(), feature_set: FeatureSet::plain(), kind: SpaceKind::Intersection };
    let space = Space::fit(&definition, &Statistics::new(&FeatureSet::plain()), None, &Prior::none()).unwrap();
    let points = [0, 1].map(|at| space.point(&features(space.feature_set(), &textures[at])).unwrap());
    let distance: f64 = points[0].iter().zip(&points[1]).map(|(a, b)| f64::from((a - b).abs())).sum();
    let histogram = |at: usize| {
        let sums = textures[at][0].1.total().values.map(|sum| sum as f64);
        let total: f64 = sums.iter().sum();
        sums.map(|sum| sum / total)
    };
    let (a, b) = (histogram(0), histogram(1));
    let intersection: f64 = a.iter().zip(&b).map(|(a, b)| a.min(*b)).sum();
    assert!((distance - (1.0 - intersection)).abs() < 1e-6);
}

#[test]
fn zscore_is_centred_and_scaled_by_the_store() {
    let textures = textures(5);
    let space = fitted("zscore", &textures, &Prior::shipped());
    let points: Vec<Vec<f32>> =
        textures.iter().map(|texture| space.point(&features(space.feature_set(), texture)).unwrap()).collect();
    for feature in [0, 20, 250] {
        let values = || points.iter().map(|point| f64::from(point[feature]));
        assert!(values().sum::<f64>().abs() < 1e-5);
        assert!((values().map(|value| value * value).sum::<f64>() / 5.0 - 1.0).abs() < 1e-5);
    }
}

#[test]
fn coordinates_are_ordered_by_variance_and_uncorrelated() {
    let textures = textures(40);
    let space = fitted("default", &textures, &Prior::none());
    let Map::Likeness(projection) = &space.map else { panic!("a likeness space") };
    assert!(projection.variances.is_sorted_by(|a, b| a >= b) && projection.variances[31] > 0.0);
    let covariance = statistics(space.feature_set(), &textures).between();
    let product = projection.weights.transposed().times(&covariance).times(&projection.weights);
    for i in 0..32 {
        for j in 0..32 {
            let expected = if i == j { projection.variances[i] } else { 0.0 };
            assert!((product[(i, j)] - expected).abs() < 1e-6 * projection.variances[0], "{i} {j}");
        }
    }
}

#[test]
fn axes_name_their_views_and_features() {
    let textures = textures(40);
    let space = fitted("default", &textures, &Prior::none());
    let axes = space.axes();
    assert_eq!(axes.len(), 32);
    assert!((axes.iter().map(|axis| axis.variance).sum::<f64>() - 1.0).abs() < 1e-12);
    for axis in &axes {
        assert!((axis.views.iter().map(|(_, share)| share).sum::<f64>() - 1.0).abs() < 1e-6);
        assert_eq!((axis.views.len(), axis.features.len()), (7, NAMED));
        assert!(axis.features.iter().all(|(_, correlation)| correlation.abs() <= 1.0 + 1e-9));
        assert!(matches!(axis.features[0].0.part, FeaturePart::Mean(_) | FeaturePart::Deviation(_)));
    }
    assert!(fitted("paper", &textures, &Prior::none()).axes().is_empty());
}

#[test]
fn a_missing_view_counts_as_average() {
    let textures = textures(20);
    let space = fitted("default", &textures, &Prior::none());
    let feature_set = space.feature_set();
    let without = View::LIKENESS[2];
    let part: Vec<_> = textures[3].iter().filter(|(view, _)| *view != without).cloned().collect();
    let features = features(feature_set, &part);
    assert_eq!(features.missing(), [without]);
    let Map::Likeness(projection) = &space.map else { panic!("a likeness space") };
    let per_view = FeatureForm::Pooled.per_view();
    let filled = features.values().iter().enumerate();
    let filled = filled.map(|(at, &x)| Some(if at / per_view == 2 { projection.mean[at] } else { x }));
    assert_eq!(space.raw_point(&features).unwrap(), projection.project(filled));
    let nothing = Descriptor::default().features(feature_set);
    assert_eq!(space.point(&nothing).unwrap(), vec![0.0; 32]);
}

#[test]
fn points_of_many_textures_equal_those_of_each() {
    let textures = textures(4);
    let space = fitted("default", &textures, &Prior::none());
    let descriptors: Vec<Descriptor> = textures.iter().map(|texture| Descriptor::from_sums(texture).unwrap()).collect();
    let many = space.points(&descriptors);
    let single: Vec<f32> =
        textures.iter().flat_map(|texture| space.point(&features(space.feature_set(), texture)).unwrap()).collect();
    assert_eq!(many, single);
}

#[test]
fn drift_is_zero_at_the_fit_and_grows() {
    let textures = textures(30);
    for name in ["zscore", "oriented", "default"] {
        let space = fitted(name, &textures[..15], &Prior::none());
        let feature_set = space.feature_set();
        let at_first = space.drift(&statistics(feature_set, &textures[..15])).unwrap().unwrap();
        assert_eq!((at_first.textures_at_fit, at_first.textures, at_first.shift), (15, 15, 0.0));
        assert!((at_first.spread - 1.0).abs() < 1e-9, "{name}");
        let later = space.drift(&statistics(feature_set, &textures)).unwrap().unwrap();
        assert!(later.shift > 0.01 && later.textures == 30, "{name}: {later:?}");
        assert!(space.drift(&Statistics::new(feature_set)).unwrap().is_none());
    }
    let paper = fitted("paper", &textures[..15], &Prior::none());
    assert_eq!(paper.drift(&statistics(paper.feature_set(), &textures)).unwrap(), None);
    assert!(matches!(paper.drift(&Statistics::new(&FeatureSet::pooled())), Err(SpaceError::FeatureSet { .. })));
}

#[test]
fn own_nuisance_statistics_change_the_space_only_with_a_weight() {
    let textures = textures(30);
    let mut nuisance = NuisanceStatistics::new(&FeatureSet::pooled());
    for (texture, copy) in [(1, 2), (5, 9)] {
        let [texture, copy] = [texture, copy].map(crate::space::fixtures::volume);
        assert!(nuisance.observe(&texture, &copy).unwrap());
    }
    let own = statistics(&FeatureSet::pooled(), &textures);
    let fit = |weight: f64, nuisance: Option<&NuisanceStatistics>| {
        let definition = Definition::likeness("mine", &View::LIKENESS, true, weight, 8).unwrap();
        let space = Space::fit(&definition, &own, nuisance, &Prior::none()).unwrap();
        space.point(&features(space.feature_set(), &textures[0])).unwrap()
    };
    assert_eq!(fit(0.0, Some(&nuisance)), fit(0.0, None));
    assert_ne!(fit(0.5, Some(&nuisance)), fit(0.5, None));
}

#[test]
fn statistics_of_another_feature_set_are_refused() {
    let definition = Definition::built_in("default").unwrap();
    let plain = Statistics::new(&FeatureSet::plain());
    assert!(matches!(Space::fit(&definition, &plain, None, &Prior::none()), Err(SpaceError::FeatureSet { .. })));
    let own = Statistics::new(&definition.feature_set);
    let other = NuisanceStatistics::new(&FeatureSet::oriented());
    assert!(matches!(Space::fit(&definition, &own, Some(&other), &Prior::none()), Err(SpaceError::FeatureSet { .. })));
    let space = Space::fit(&definition, &own, None, &Prior::none()).unwrap();
    let wrong = features(&FeatureSet::plain(), &described(1));
    assert!(matches!(space.point(&wrong), Err(SpaceError::FeatureSet { .. })));
    let unnamed = Definition { name: String::new(), ..definition };
    assert!(matches!(Space::fit(&unnamed, &own, None, &Prior::none()), Err(SpaceError::Name { .. })));
}

#[test]
fn stored_spaces_are_checked() {
    let space = fitted("oriented", &textures(3), &Prior::none()).with_epoch(7);
    let bytes = space.encode();
    assert_eq!(bytes[..18], *b"hSpa\x01\x00\x08\x00\x00\x00oriented");
    assert_eq!(Space::decode(&bytes).unwrap().epoch(), 7);
    for at in [0, 5, 20, 1000, bytes.len() - 1] {
        let mut flipped = bytes.clone();
        flipped[at] ^= 1;
        assert!(Space::decode(&flipped).is_err());
    }
    assert!(Space::decode(&bytes[..bytes.len() / 2]).is_err());
    assert!(Space::decode(&[]).is_err());
}

/// The bits of every built-in space, fitted on 40 textures: other arithmetic anywhere in the fit shows here.
#[test]
fn the_bits_of_fitted_spaces_are_frozen() {
    let textures = textures(40);
    let hash = |name: &str, prior: &Prior| xxhash_rust::xxh3::xxh3_64(&fitted(name, &textures, prior).encode());
    let hashes = Definition::BUILT_IN.map(|name| [hash(name, &Prior::none()), hash(name, &Prior::shipped())]);
    let expected = [
        [12_017_002_076_450_385_430, 12_017_002_076_450_385_430],
        [13_353_958_214_516_177_670, 13_353_958_214_516_177_670],
        [6_095_986_735_765_143_886, 9_551_329_361_399_360_608],
        [11_276_637_401_077_398_533, 1_363_673_360_010_238_594],
        [18_305_515_477_682_185_990, 7_615_813_740_540_806_812],
    ];
    assert_eq!(hashes, expected);
}
