//! Sums of noise octaves: the paper's sum, fBm, turbulence and ridged noise.
//!
//! Octave i has its cells `lacunarity^i` times as fine and weighs `gain^i`; each octave has a lattice of its own, so
//! that the zeros of gradient noise do not coincide. With lacunarity 2 and gain 1/2 the plain sum is the paper's
//! `Per(P) = sum over i = 0..k of Noise(2^i P) / 2^i`. Source of the ridged rule: Musgrave in "Texturing and modeling".

use super::Field;
use super::noise::{Grid, Lattice, WIDE, hash};
use crate::volume::Shape;

/// What is summed of each octave's noise n.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fold {
    /// n itself: the paper's sum, fBm.
    Plain,
    /// |n|: turbulence, creases at 0.
    Absolute,
    /// (1 - |n|)^2, each octave weighted by twice the one before (at most 1): sharp ridges, rough only where high.
    Ridged,
}

/// A sum of octaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fractal {
    /// Seed of the lattices.
    pub seed: u32,
    /// The number of octaves; at least 1 is summed.
    pub octaves: u32,
    /// How many times finer each octave is.
    pub lacunarity: f32,
    /// Weight of each octave as a share of the one before.
    pub gain: f32,
    /// What is summed.
    pub fold: Fold,
}

impl Fractal {
    /// One octave of plain noise.
    pub fn simple(seed: u32) -> Self {
        Self { seed, octaves: 1, lacunarity: 2.0, gain: 0.5, fold: Fold::Plain }
    }

    /// The paper's sum of `octaves` octaves, each twice as fine and half as strong as the one before.
    pub fn paper(seed: u32, octaves: u32) -> Self {
        Self { octaves, ..Self::simple(seed) }
    }

    /// The same octaves, folded otherwise.
    pub fn folded(self, fold: Fold) -> Self {
        Self { fold, ..self }
    }

    /// The sum at a point (x, y, z), in cells of the first octave; about -2 to 2 for [`Fold::Plain`], never negative
    /// for the others.
    pub fn at(&self, p: [f32; 3]) -> f32 {
        let (mut sum, mut weight, mut scale, mut last) = (0.0, 1.0, 1.0, 1.0);
        for octave in 0..self.octaves.max(1) {
            let noise = Lattice::wide(self.octave_seed(octave)).perlin(p.map(|v| v * scale));
            last = self.fold(noise, last);
            sum += weight * last;
            weight *= self.gain;
            scale *= self.lacunarity;
        }
        sum
    }

    /// The sum over a whole volume whose first octave has cells of `scale` voxels, along (Z, Y, X).
    ///
    /// Octaves with cells under one voxel are left out: they would only alias. Where `tile` is set, every octave's
    /// cells are rounded to a whole number per side and the field tiles without a seam.
    pub fn field(&self, shape: Shape, scale: [f32; 3], tile: bool) -> Field {
        let mut sum = Field::constant(shape, 0.0);
        let mut last = if self.fold == Fold::Ridged { Field::constant(shape, 1.0) } else { sum.clone() };
        let (mut weight, mut finer) = (1.0_f32, 1.0_f64);
        for octave in 0..self.octaves.max(1) {
            let step = scale.map(|scale| finer / f64::from(scale));
            if octave > 0 && step.iter().any(|&step| step > 1.0) {
                break;
            }
            let (lattice, grid) = self.laid(octave, shape, step.map(|step| step.min(1.0)), tile);
            let fold = |noise: f32, voxel: &mut f32| *voxel = self.fold(noise, *voxel);
            lattice.perlin_grid(&grid, &mut last, fold);
            sum = sum.zip(&last, |sum, noise| sum + weight * noise);
            weight *= self.gain;
            finer *= f64::from(self.lacunarity);
        }
        sum
    }

    /// The lattice of an octave and where the voxels lie on it.
    fn laid(&self, octave: u32, shape: Shape, step: [f64; 3], tile: bool) -> (Lattice, Grid) {
        let seed = self.octave_seed(octave);
        // A shift of a part of a cell, so that voxels do not sit on the lattice.
        let origin = [3, 2, 1].map(|salt| f64::from(hash(seed, salt, 0, 0) >> 8) / 16_777_216.0);
        if !tile {
            return (Lattice::wide(seed), Grid { shape, step, origin });
        }
        let cells = [0, 1, 2].map(|axis| (shape[axis] as f64 * step[axis] + 0.5).floor().max(1.0));
        let [z, y, x] = cells.map(|cells| (cells as u32).min(WIDE));
        let step = [0, 1, 2].map(|axis| cells[axis] / shape[axis] as f64);
        (Lattice { seed, period: [x, y, z] }, Grid { shape, step, origin })
    }

    fn octave_seed(&self, octave: u32) -> u32 {
        hash(self.seed, octave, 0, 0)
    }

    /// One octave's share, from its noise and (for ridges) the share of the octave before, or 1.
    fn fold(&self, noise: f32, last: f32) -> f32 {
        match self.fold {
            Fold::Plain => noise,
            Fold::Absolute => noise.abs(),
            Fold::Ridged => {
                let ridge = 1.0 - noise.abs();
                ridge * ridge * (2.0 * last).clamp(0.0, 1.0)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_sum_is_the_sum_of_its_octaves() {
        let fractal = Fractal::paper(11, 3);
        let p = [1.3, -0.4, 2.2];
        let octave = |i: u32| Lattice::wide(fractal.octave_seed(i)).perlin(p.map(|v: f32| v * (1 << i) as f32));
        let expected = octave(0) + octave(1) / 2.0 + octave(2) / 4.0;
        assert!((fractal.at(p) - expected).abs() < 1e-6);
    }

    #[test]
    fn tiled_fields_meet_at_their_borders() {
        for fold in [Fold::Plain, Fold::Absolute, Fold::Ridged] {
            let fractal = Fractal { lacunarity: 2.1, gain: 0.6, ..Fractal::paper(3, 3) }.folded(fold);
            let field = fractal.field([24, 24, 24], [10.0; 3], true);
            let at = |z: usize, y: usize, x: usize| field.values()[(z * 24 + y) * 24 + x];
            let step =
                |pairs: &mut dyn Iterator<Item = (f32, f32)>| pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let inside = step(&mut (0..576).map(|i| (at(11, i / 24, i % 24), at(12, i / 24, i % 24))));
            let across = step(&mut (0..576).map(|i| (at(23, i / 24, i % 24), at(0, i / 24, i % 24))));
            assert!(across < 2.5 * inside, "{fold:?}: {across} {inside}");
        }
    }

    #[test]
    fn octaves_under_a_voxel_are_left_out() {
        let field = |octaves| Fractal::paper(1, octaves).field([8, 8, 8], [4.0; 3], false);
        assert_eq!(field(3), field(9));
        assert_ne!(field(2), field(3));
    }
}
