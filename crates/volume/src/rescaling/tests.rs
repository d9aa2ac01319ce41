//! Every type and rule against the definition, over a copy of every sample.

use proptest::prelude::*;

use super::*;
use crate::testing::{encode, value};

/// The definition, over a copy of every sample.
fn reference(samples: &[f64], intensity: Intensity) -> (Vec<u8>, f64, f64) {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = |thousandths: usize| sorted[(samples.len() * thousandths).div_ceil(1000) - 1];
    let (lo, hi) = match intensity {
        Intensity::Full => (sorted[0], sorted[sorted.len() - 1]),
        Intensity::Auto => (rank(1), rank(999)),
        Intensity::Window { lo, hi } => (lo, hi),
        Intensity::NonZero => {
            return (samples.iter().map(|&v| if v == 0.0 { 0 } else { 255 }).collect(), 0.0, 0.0);
        }
    };
    let level = |v: &f64| if hi == lo { 0 } else { (255.0 * (v - lo) / (hi - lo)).round().clamp(0.0, 255.0) as u8 };
    (samples.iter().map(level).collect(), lo, hi)
}

fn check(samples: &[f64], ty: SampleType, endian: Endian, intensity: Intensity) {
    let mut bytes = encode(samples, ty, endian);
    let stored: Vec<f64> = bytes.chunks(ty.size()).map(|bytes| value(bytes, ty, endian)).collect();
    let (levels, lo, hi) = reference(&stored, intensity);
    let mapping = rescale(&mut bytes, ty, endian, intensity, Calibration::IDENTITY).unwrap();
    if ty == SampleType::U8 {
        assert_eq!(mapping, None);
        assert_eq!(bytes, encode(samples, ty, endian));
    } else {
        assert_eq!(mapping, Some(Mapping { rule: intensity, lo, hi }), "{ty}");
        assert_eq!(bytes, levels, "{ty} {endian:?} {intensity}");
    }
}

fn rules() -> impl Strategy<Value = Intensity> {
    let window = (-300.0..300.0, 0.1..500.0).prop_map(|(lo, wide)| Intensity::Window { lo, hi: lo + wide });
    prop_oneof![Just(Intensity::Full), Just(Intensity::Auto), Just(Intensity::NonZero), window]
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(128))]
    #[test]
    fn every_type_and_rule_follows_the_definition(
        samples in prop::collection::vec(-400.0..400.0_f64, 1..3000),
        rule in rules(),
    ) {
        for ty in SampleType::ALL {
            for endian in [Endian::Little, Endian::Big] {
                check(&samples, ty, endian, rule);
            }
        }
    }
}

#[test]
fn a_table_gives_the_same_levels() {
    let samples: Vec<f64> = (0..70_000_u32).map(|i| f64::from(i.wrapping_mul(2_654_435_761) % 60_000) - 9.0).collect();
    for ty in [SampleType::I8, SampleType::U16, SampleType::I16, SampleType::F16] {
        check(&samples, ty, Endian::Big, Intensity::Auto);
    }
}

#[test]
fn ranks_at_the_borders_of_thousands() {
    for count in [1, 2, 999, 1000, 1001, 1999, 2000, 2001] {
        let samples: Vec<f64> = (0..count).map(|i| f64::from((i * 7919) % count)).collect();
        check(&samples, SampleType::I32, Endian::Little, Intensity::Auto);
        check(&samples, SampleType::F64, Endian::Little, Intensity::Auto);
    }
}

#[test]
fn extremes_and_constants() {
    let full = |samples: &[f64], ty| {
        let mut bytes = encode(samples, ty, Endian::Little);
        rescale(&mut bytes, ty, Endian::Little, Intensity::Full, Calibration::IDENTITY).unwrap();
        bytes
    };
    assert_eq!(full(&[f64::MIN, 0.0, f64::MAX], SampleType::F64), [0, 128, 255]);
    assert_eq!(full(&[i64::MIN as f64, -1e18, i64::MAX as f64], SampleType::I64), [0, 114, 255]);
    assert_eq!(full(&[0.0, u64::MAX as f64], SampleType::U64), [0, 255]);
    assert_eq!(full(&[5e-324, 1e-323], SampleType::F64), [0, 255]);
    assert_eq!(full(&[-0.0, 0.0, -0.0], SampleType::F32), [0, 0, 0]);
    assert_eq!(full(&[9.0; 4], SampleType::U16), [0; 4]);
}

#[test]
fn nonzero_keeps_every_label_and_is_in_units() {
    let nonzero = |samples: &[f64], ty, calibration| {
        let mut bytes = encode(samples, ty, Endian::Little);
        rescale(&mut bytes, ty, Endian::Little, Intensity::NonZero, calibration).unwrap();
        bytes
    };
    assert_eq!(nonzero(&[1.0, 0.0, 65_535.0, 2.0], SampleType::U16, Calibration::IDENTITY), [255, 0, 255, 255]);
    assert_eq!(nonzero(&[-0.0, 5e-324, -1e300, 0.0], SampleType::F64, Calibration::IDENTITY), [0, 255, 255, 0]);
    let calibration = Calibration::new(2.0, -4.0).unwrap();
    assert_eq!(nonzero(&[0.0, 2.0, 4.0], SampleType::I32, calibration), [255, 0, 255]);
}

#[test]
fn a_half_is_rounded_away_from_zero() {
    let mut bytes = encode(&[0.0, 1.0, 2.0, 509.0, 510.0], SampleType::U16, Endian::Little);
    let window = Intensity::Window { lo: 0.0, hi: 510.0 };
    rescale(&mut bytes, SampleType::U16, Endian::Little, window, Calibration::IDENTITY).unwrap();
    assert_eq!(bytes, [0, 1, 1, 255, 255]);
}

#[test]
fn every_level_is_rounded_as_round_does() {
    let levels = LevelMap::line(0.0, 255.0);
    for half in 0..=510 {
        let exact = f64::from(half) / 2.0;
        for sample in [exact.next_down(), exact, exact.next_up()] {
            assert_eq!(f64::from(levels.of(sample)), (255.0 * sample / 255.0).round().clamp(0.0, 255.0), "{sample:e}");
        }
    }
    assert_eq!([f64::MIN, -0.6, 255.6, f64::MAX].map(|sample| levels.of(sample)), [0, 0, 255, 255]);
}

#[test]
fn a_calibration_moves_windows_and_inverts_when_negative() {
    let samples = [0.0, 1.0, 2.0, 3.0, 4.0, 255.0];
    let scaled = |intensity, slope, intercept| {
        let mut bytes = encode(&samples, SampleType::I16, Endian::Little);
        let calibration = Calibration::new(slope, intercept).unwrap();
        let mapping = rescale(&mut bytes, SampleType::I16, Endian::Little, intensity, calibration).unwrap().unwrap();
        (bytes, mapping.lo, mapping.hi)
    };
    assert_eq!(scaled(Intensity::Full, 0.1, 7.0), (vec![0, 1, 2, 3, 4, 255], 7.0, 32.5));
    assert_eq!(scaled(Intensity::Full, -1.0, 255.0), (vec![255, 254, 253, 252, 251, 0], 0.0, 255.0));
    let window = Intensity::Window { lo: 102.0, hi: 106.0 };
    assert_eq!(scaled(window, 2.0, 100.0), (vec![0, 0, 128, 255, 255, 255], 102.0, 106.0));
    for (slope, intercept) in [(0.0, 1.0), (f64::NAN, 0.0), (f64::INFINITY, 0.0), (1.0, f64::NAN)] {
        assert_eq!(Calibration::new(slope, intercept), None);
    }
}

#[test]
fn the_first_sample_that_is_not_finite_is_found() {
    for ty in [SampleType::F16, SampleType::F32, SampleType::F64] {
        for bad in [f64::INFINITY, f64::NEG_INFINITY] {
            let mut bytes = encode(&[1.0, -2.0, bad, f64::NAN], ty, Endian::Big);
            let found = rescale(&mut bytes, ty, Endian::Big, Intensity::Full, Calibration::IDENTITY);
            assert_eq!(found, Err(NotFinite { index: 2, value: bad }));
        }
    }
}
