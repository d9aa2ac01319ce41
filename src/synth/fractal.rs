//! Sums of noise octaves: the paper's sum, fBm, turbulence and ridged noise.
//!
//! The cells of octave i are `lacunarity^i` times as fine, and its weight is `gain^i`. Each octave has its own lattice, so
//! that the zeros of gradient noise do not coincide. With lacunarity 2 and gain 1/2 the plain sum is the paper's
//! `Per(P) = sum over i = 0..k of Noise(2^i P) / 2^i`. The ridged sum follows Musgrave in *Texturing and Modeling*.

use super::field::Field;
use super::noise::{Grid, Lattice, WIDE, hash};
use crate::volume::Shape;

/// What each octave with noise n adds to the sum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OctaveFold {
    /// n: the paper's sum, fBm.
    Plain,
    /// |n|: turbulence, with creases at 0.
    Absolute,
    /// (1 - |n|)^2 times twice the previous octave's term (at most 1): sharp ridges, rough only where they are high.
    Ridged,
}

/// A sum of octaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fractal {
    /// The seed of the lattices.
    pub(crate) seed: u32,
    /// The number of octaves; 0 counts as 1.
    pub(crate) octaves: u32,
    /// How many times finer each octave is than the previous one.
    pub(crate) lacunarity: f32,
    /// The weight of each octave relative to the previous one.
    pub(crate) gain: f32,
    /// What is summed.
    pub(crate) fold: OctaveFold,
}

impl Fractal {
    /// One octave of plain noise.
    pub(crate) fn simple(seed: u32) -> Self {
        Self { seed, octaves: 1, lacunarity: 2.0, gain: 0.5, fold: OctaveFold::Plain }
    }

    /// The paper's sum of `octaves` octaves, each twice as fine and half as strong as the previous one.
    pub(crate) fn paper(seed: u32, octaves: u32) -> Self {
        Self { octaves, ..Self::simple(seed) }
    }

    /// The same octaves with another term.
    pub(crate) fn folded(self, fold: OctaveFold) -> Self {
        Self { fold, ..self }
    }

    /// The sum at a point (x, y, z), in cells of the first octave: about -2 to 2 for [`OctaveFold::Plain`], at least 0 for
    /// the others.
    pub(crate) fn at(&self, p: [f32; 3]) -> f32 {
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

    /// The sum at every voxel of a volume; the first octave has cells of `scale` voxels along (Z, Y, X).
    ///
    /// Octaves with cells smaller than a voxel are left out, because they would only alias. With `tile`, every octave has a
    /// whole number of cells per side, so that the field tiles without a seam.
    pub(crate) fn field(&self, shape: Shape, scale: [f32; 3], tile: bool) -> Field {
        let mut sum = Field::constant(shape, 0.0);
        let mut last = if self.fold == OctaveFold::Ridged { Field::constant(shape, 1.0) } else { sum.clone() };
        let (mut weight, mut finer) = (1.0_f32, 1.0_f64);
        for octave in 0..self.octaves.max(1) {
            let step = scale.map(|scale| finer / f64::from(scale));
            if octave > 0 && step.iter().any(|&step| step > 1.0) {
                break;
            }
            let (lattice, grid) = self.grid(octave, shape, step.map(|step| step.min(1.0)), tile);
            let fold = |noise: f32, voxel: &mut f32| *voxel = self.fold(noise, *voxel);
            lattice.perlin_grid(&grid, &mut last, fold);
            sum = sum.zip(&last, |sum, noise| sum + weight * noise);
            weight *= self.gain;
            finer *= f64::from(self.lacunarity);
        }
        sum
    }

    /// The lattice of an octave and the positions of the voxels on it.
    fn grid(&self, octave: u32, shape: Shape, step: [f64; 3], tile: bool) -> (Lattice, Grid) {
        let seed = self.octave_seed(octave);
        // A shift by part of a cell, so that voxels do not coincide with lattice points.
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

    /// The term of an octave, from its noise and (for ridges) the previous octave's term, 1 for the first.
    fn fold(&self, noise: f32, last: f32) -> f32 {
        match self.fold {
            OctaveFold::Plain => noise,
            OctaveFold::Absolute => noise.abs(),
            OctaveFold::Ridged => {
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
        for fold in [OctaveFold::Plain, OctaveFold::Absolute, OctaveFold::Ridged] {
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
    fn octaves_finer_than_a_voxel_are_left_out() {
        let field = |octaves| Fractal::paper(1, octaves).field([8, 8, 8], [4.0; 3], false);
        assert_eq!(field(3), field(9));
        assert_ne!(field(2), field(3));
    }
}
