//! Seeded random numbers that are the same on every machine and with every version of the crates used.
//!
//! The bits come from ChaCha8. Its 256-bit key is the BLAKE3 hash of recipe seed, group, index and purpose, so that every
//! specimen can be computed alone, in any order, on any thread. The conversion of bits to numbers is written here, because
//! that of the `rand` crate may change between versions.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The version of the random numbers. A change that alters any of them must change this string and every golden hash.
const DOMAIN: &[u8] = b"hlacdb synth 1";

/// A stream of random numbers.
pub(crate) struct Random(ChaCha8Rng);

impl Random {
    /// The stream for `purpose` of the specimen `index` of `group` under the recipe's `seed`.
    pub(crate) fn of(seed: u64, group: &str, index: u64, purpose: &str) -> Self {
        let mut hasher = blake3::Hasher::new();
        for part in [DOMAIN, &seed.to_le_bytes(), group.as_bytes(), &index.to_le_bytes(), purpose.as_bytes()] {
            hasher.update(&(part.len() as u64).to_le_bytes());
            hasher.update(part);
        }
        Self(ChaCha8Rng::from_seed(*hasher.finalize().as_bytes()))
    }

    /// A seed for another generator.
    pub(crate) fn seed(&mut self) -> u32 {
        self.0.next_u32()
    }

    /// Uniform in [0, 1), from 53 bits.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// [`Random::between`] in `f32`.
    pub(crate) fn between32(&mut self, low: f32, high: f32) -> f32 {
        self.between(f64::from(low), f64::from(high)) as f32
    }

    /// Uniform among 0, 1, ..., `count - 1`; 0 where `count` is 0. The bias of the multiplication is under 2^-32.
    pub(crate) fn below(&mut self, count: u32) -> u32 {
        ((u128::from(self.0.next_u64()) * u128::from(count)) >> 64) as u32
    }

    /// Two independent normal deviates of mean 0 and standard deviation 1 (Box and Muller).
    pub(crate) fn normal_pair(&mut self) -> [f64; 2] {
        // 1 - u is in (0, 1], so its logarithm is finite.
        let radius = libm::sqrt(-2.0 * libm::log(1.0 - self.unit()));
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * self.unit());
        [radius * cos, radius * sin]
    }

    /// A direction, uniform on the unit sphere.
    pub(crate) fn direction(&mut self) -> [f32; 3] {
        let z = self.between(-1.0, 1.0);
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * self.unit());
        let radius = libm::sqrt(1.0 - z * z);
        [(radius * cos) as f32, (radius * sin) as f32, z as f32]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_the_key_matters_and_streams_repeat() {
        let first = |seed, group: &str, index, purpose: &str| Random::of(seed, group, index, purpose).unit().to_bits();
        let base = first(1, "a", 0, "p");
        assert_eq!(base, first(1, "a", 0, "p"));
        for other in [first(2, "a", 0, "p"), first(1, "b", 0, "p"), first(1, "a", 1, "p"), first(1, "a", 0, "q")] {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn normal_deviates_have_mean_0_and_variance_1() {
        let mut random = Random::of(4, "", 0, "");
        let draws: Vec<f64> = (0..20_000).flat_map(|_| random.normal_pair()).collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance = draws.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>() / draws.len() as f64;
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
        assert!((0..1000).all(|_| random.below(3) < 3));
    }
}
