//! Nuisances: changes of a volume that should not affect what it looks like.
//!
//! A [`Nuisance`] says what may vary and how much. [`Nuisance::draw`] makes one [`Distortion`] of it, which is applied to
//! any volume, grey or colour. The order is fixed: rotation, gamma, contrast about mid-grey, brightness, noise; voxels are
//! rounded once, at the end. Amounts are fractions of the full scale of 255 levels.

use std::fmt;
use std::str::FromStr;

use super::ParameterRange;
use super::field::volume;
use super::random::Random;
use super::rotation::Rotation;
use crate::volume::Volume;

/// What may vary, and in which range. `None` leaves a quantity unchanged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Nuisance {
    /// The exponent of the intensities, within 0.1..=10; 1 changes nothing.
    pub gamma: Option<ParameterRange>,
    /// The factor about mid-grey, within 0..=4; 1 changes nothing.
    pub contrast: Option<ParameterRange>,
    /// The amount added to every voxel, within -1..=1 of full scale.
    pub brightness: Option<ParameterRange>,
    /// The standard deviation of Gaussian noise, within 0..=1 of full scale.
    pub noise: Option<ParameterRange>,
    /// Whether the volume is rotated by one of the 24 right-angle rotations.
    pub rotation: bool,
}

impl Nuisance {
    /// Nothing varies.
    pub const NONE: Self = Self { gamma: None, contrast: None, brightness: None, noise: None, rotation: false };

    /// Everything varies, as in the benchmark: gamma 0.6 to 1.7, contrast 0.5 to 1, brightness -0.15 to 0.15, noise of
    /// 0.02 to 0.08, all 24 rotations.
    pub const ALL: Self = Self {
        gamma: Some(ParameterRange { low: 0.6, high: 1.7 }),
        contrast: Some(ParameterRange { low: 0.5, high: 1.0 }),
        brightness: Some(ParameterRange { low: -0.15, high: 0.15 }),
        noise: Some(ParameterRange { low: 0.02, high: 0.08 }),
        rotation: true,
    };

    /// The words that [`Nuisance::from_str`] accepts.
    pub const WORDS: &str = "all, none, brightness, contrast, gamma, noise, rotation";

    /// Whether nothing varies.
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }

    /// Draws one distortion. The same nuisance and seed always give the same distortion.
    pub fn draw(&self, seed: u64) -> Distortion {
        self.draw_from(&mut Random::of(seed, "", 0, "nuisance"))
    }

    pub(crate) fn draw_from(&self, random: &mut Random) -> Distortion {
        // Every amount is drawn, wanted or not, so that switching one off leaves the others unchanged.
        let mut amount = |range: Option<ParameterRange>, neutral: f64| {
            let at = random.unit();
            range.map_or(neutral, |range| range.low + (range.high - range.low) * at)
        };
        let (gamma, contrast) = (amount(self.gamma, 1.0), amount(self.contrast, 1.0));
        let (brightness, noise) = (amount(self.brightness, 0.0), amount(self.noise, 0.0));
        let rotation = random.below(Rotation::ALL.len() as u32) as usize;
        Distortion {
            gamma,
            contrast,
            brightness,
            noise,
            rotation: if self.rotation { Rotation::ALL[rotation] } else { Rotation::IDENTITY },
            seed: (u64::from(random.seed()) << 32) | u64::from(random.seed()),
        }
    }
}

/// The word names no nuisance.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown nuisance {word:?}; known: {}", Nuisance::WORDS)]
pub struct ParseNuisanceError {
    /// The word that was found.
    pub word: String,
}

impl FromStr for Nuisance {
    type Err = ParseNuisanceError;

    /// Words separated by commas, each with the range of [`Nuisance::ALL`]: `brightness,contrast,noise,rotation`.
    fn from_str(words: &str) -> Result<Self, ParseNuisanceError> {
        let (mut nuisance, all) = (Self::NONE, Self::ALL);
        for word in words.split(',').map(str::trim) {
            match word {
                "all" => nuisance = all,
                "none" => {}
                "brightness" => nuisance.brightness = all.brightness,
                "contrast" => nuisance.contrast = all.contrast,
                "gamma" => nuisance.gamma = all.gamma,
                "noise" => nuisance.noise = all.noise,
                "rotation" => nuisance.rotation = true,
                _ => return Err(ParseNuisanceError { word: word.into() }),
            }
        }
        Ok(nuisance)
    }
}

impl fmt::Display for Nuisance {
    /// The words of [`Nuisance::from_str`], without ranges.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [
            (self.brightness.is_some(), "brightness"),
            (self.contrast.is_some(), "contrast"),
            (self.gamma.is_some(), "gamma"),
            (self.noise.is_some(), "noise"),
            (self.rotation, "rotation"),
        ];
        let words: Vec<&str> = parts.iter().filter(|(varies, _)| *varies).map(|(_, word)| *word).collect();
        f.write_str(if words.is_empty() { "none".into() } else { words.join(",") }.as_str())
    }
}

/// One change of a volume with all amounts drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distortion {
    /// The exponent of the intensities.
    pub gamma: f64,
    /// The factor about mid-grey.
    pub contrast: f64,
    /// The amount added to every voxel, as a fraction of full scale.
    pub brightness: f64,
    /// The standard deviation of the noise, as a fraction of full scale.
    pub noise: f64,
    /// The rotation.
    pub rotation: Rotation,
    /// The seed of the noise.
    pub seed: u64,
}

impl Distortion {
    /// The changed volume; the axes of its shape are permuted by the rotation. All channels change alike, with independent
    /// noise.
    pub fn apply(&self, original: &Volume) -> Volume {
        let rotated = self.rotation.apply(original);
        let (shape, channels) = (rotated.shape(), rotated.channels());
        let levels = self.levels();
        let mut voxels = rotated.into_voxels();
        if self.noise > 0.0 {
            let mut random = Random::of(self.seed, "", 0, "noise");
            for pair in voxels.chunks_mut(2) {
                for (voxel, deviate) in pair.iter_mut().zip(random.normal_pair()) {
                    *voxel = nearest(levels[usize::from(*voxel)] + 255.0 * self.noise * deviate);
                }
            }
        } else {
            for voxel in &mut voxels {
                *voxel = nearest(levels[usize::from(*voxel)]);
            }
        }
        volume(shape, channels, voxels)
    }

    /// The new value of each of the 256 levels, before rounding and clamping.
    fn levels(&self) -> [f64; 256] {
        let mut levels = [0.0; 256];
        for (level, value) in levels.iter_mut().enumerate() {
            let share = level as f64 / 255.0;
            let curved = if self.gamma == 1.0 { share } else { libm::pow(share, self.gamma) };
            *value = 255.0 * (self.contrast * (curved - 0.5) + 0.5 + self.brightness);
        }
        levels
    }
}

/// The nearest level, clamped to 0..=255.
fn nearest(value: f64) -> u8 {
    (value + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> Volume {
        Volume::from_fn([5, 6, 7], |z, y, x| (z * 42 + y * 7 + x) as u8).unwrap()
    }

    #[test]
    fn no_nuisance_changes_nothing() {
        assert_eq!(Nuisance::NONE.draw(3).apply(&ramp()), ramp());
    }

    #[test]
    fn each_amount_has_its_effect() {
        let plain = Nuisance::NONE.draw(0);
        let first = |distortion: Distortion, level: u8| {
            distortion.apply(&Volume::new([3, 3, 3], 1, vec![level; 27]).unwrap()).voxels()[0]
        };
        assert_eq!(first(Distortion { brightness: 0.1, ..plain }, 100), 126);
        assert_eq!(first(Distortion { brightness: -0.5, ..plain }, 100), 0);
        assert_eq!(first(Distortion { contrast: 0.5, ..plain }, 255), 191);
        assert_eq!(first(Distortion { gamma: 2.0, ..plain }, 128), 64);
    }

    #[test]
    fn noise_has_its_standard_deviation() {
        let flat = Volume::new([20, 20, 20], 3, vec![128; 24_000]).unwrap();
        let noisy = Distortion { noise: 0.05, seed: 5, ..Nuisance::NONE.draw(0) }.apply(&flat);
        let variance = noisy.voxels().iter().map(|&v| (f64::from(v) - 128.0).powi(2)).sum::<f64>() / 24_000.0;
        assert!((libm::sqrt(variance) - 12.75).abs() < 0.3, "{variance}");
    }

    #[test]
    fn amounts_stay_in_their_ranges_and_are_independent() {
        for seed in 0..200 {
            let drawn = Nuisance::ALL.draw(seed);
            assert!((0.6..1.7).contains(&drawn.gamma) && (0.5..1.0).contains(&drawn.contrast));
            assert!(drawn.brightness.abs() <= 0.15 && (0.02..0.08).contains(&drawn.noise));
            let only = Nuisance { contrast: Nuisance::ALL.contrast, ..Nuisance::NONE }.draw(seed);
            assert_eq!(only.contrast, drawn.contrast);
            assert_eq!((only.gamma, only.rotation), (1.0, Rotation::IDENTITY));
        }
    }

    #[test]
    fn words_are_parsed_and_displayed() {
        for words in ["none", "brightness,contrast,gamma,noise,rotation", "contrast,rotation"] {
            assert_eq!(words.parse::<Nuisance>().unwrap().to_string(), words);
        }
        assert_eq!("all".parse::<Nuisance>().unwrap(), Nuisance::ALL);
        assert!("blur".parse::<Nuisance>().unwrap_err().to_string().contains("unknown nuisance \"blur\""));
    }
}
