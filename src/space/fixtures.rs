//! Small textures for tests.

use super::{Contribution, Descriptor, FeatureSet, Features, Statistics};
use crate::hlac::{OctantSums, View};
use crate::volume::Volume;

/// A texture of 16^3 voxels: a plane wave and noise, both drawn by the seed.
pub(super) fn volume(seed: u64) -> Volume {
    let mut state = (seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f64 / (1 << 24) as f64
    };
    let wave = [next() * 1.2, next() * 1.2, next() * 1.2];
    let (strength, noise, level) = (next() * 80.0, next() * 60.0, 60.0 + next() * 120.0);
    let voxel = |z: usize, y: usize, x: usize| {
        let phase = wave[0] * z as f64 + wave[1] * y as f64 + wave[2] * x as f64;
        (level + strength * libm::sin(phase) + noise * (next() - 0.5)) as u8
    };
    Volume::from_fn([16, 16, 16], voxel).unwrap()
}

pub(super) fn described(seed: u64) -> Vec<(View, OctantSums)> {
    crate::describe(&volume(seed), &View::STANDARD)
}

pub(super) fn features(feature_set: &FeatureSet, described: &[(View, OctantSums)]) -> Features {
    Descriptor::from_sums(described).unwrap().features(feature_set)
}

pub(super) fn contribution(feature_set: &FeatureSet, described: &[(View, OctantSums)]) -> Contribution {
    Contribution::from_sums(feature_set, described).unwrap().unwrap()
}

pub(super) fn statistics(feature_set: &FeatureSet, textures: &[Vec<(View, OctantSums)>]) -> Statistics {
    let mut statistics = Statistics::new(feature_set);
    textures.iter().for_each(|texture| statistics.add(&contribution(feature_set, texture)).unwrap());
    statistics
}
