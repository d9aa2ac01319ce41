//! [`Field`]: the grey levels of a texture while it is painted, in `f32`.
//!
//! Only + - * / and comparisons are used, which IEEE 754 defines to the bit; sums run in memory order.

use crate::volume::{Shape, Volume};

/// One `f32` per voxel, of shape (Z, Y, X) with X fastest.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Field {
    shape: Shape,
    values: Vec<f32>,
}

impl Field {
    /// A field with one value everywhere.
    pub(crate) fn constant(shape: Shape, value: f32) -> Self {
        Self { shape, values: vec![value; shape.iter().product()] }
    }

    /// The field of `f` at the position (x, y, z) of each voxel, in voxels from the centre of the field.
    pub(crate) fn from_positions(shape: Shape, mut f: impl FnMut([f32; 3]) -> f32) -> Self {
        let centre = shape.map(|side| (side as f32 - 1.0) * 0.5);
        let mut values = Vec::with_capacity(shape.iter().product());
        for z in 0..shape[0] {
            for y in 0..shape[1] {
                let (z, y) = (z as f32 - centre[0], y as f32 - centre[1]);
                values.extend((0..shape[2]).map(|x| f([x as f32 - centre[2], y, z])));
            }
        }
        Self { shape, values }
    }

    /// Axis lengths (Z, Y, X).
    pub(crate) fn shape(&self) -> Shape {
        self.shape
    }

    /// The values, X fastest.
    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    /// The values, X fastest, to change.
    pub(crate) fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// Replaces each value by `f` of it.
    pub(crate) fn map(mut self, f: impl Fn(f32) -> f32) -> Self {
        for value in &mut self.values {
            *value = f(*value);
        }
        self
    }

    /// Replaces each value by `f` of it and of `other`'s value at the same voxel. The shapes must be equal.
    pub(crate) fn zip(mut self, other: &Field, f: impl Fn(f32, f32) -> f32) -> Self {
        debug_assert_eq!(self.shape, other.shape);
        for (value, other) in self.values.iter_mut().zip(&other.values) {
            *value = f(*value, *other);
        }
        self
    }

    /// The lowest and the highest value.
    pub(crate) fn range(&self) -> (f32, f32) {
        self.values
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)))
    }

    /// Maps the lowest value to 0 and the highest to 1; a constant field becomes 0.5.
    pub(crate) fn stretched(self) -> Self {
        let (low, high) = self.range();
        if high > low { self.map(|value| (value - low) / (high - low)) } else { self.map(|_| 0.5) }
    }

    /// The quantile `fraction` (0 to 1) of the values, to 1/4096 of their range.
    pub(crate) fn quantile(&self, fraction: f32) -> f32 {
        const BINS: usize = 4096;
        let (low, high) = self.range();
        let width = (high - low) / BINS as f32;
        if width <= 0.0 {
            return low;
        }
        let mut counts = [0_usize; BINS];
        for value in &self.values {
            counts[(((value - low) / width) as usize).min(BINS - 1)] += 1;
        }
        let wanted = (f64::from(fraction.clamp(0.0, 1.0)) * self.values.len() as f64) as usize;
        let mut below = 0;
        for (bin, count) in counts.iter().enumerate() {
            below += count;
            if below >= wanted {
                return low + width * (bin + 1) as f32;
            }
        }
        high
    }

    /// Averages over a box of `2 radius + 1` voxels along each axis (Z, Y, X), `passes` times. The field is treated as one
    /// period of a periodic field. Three passes are close to a Gaussian.
    pub(crate) fn blurred(mut self, radius: [usize; 3], passes: usize) -> Self {
        for _ in 0..passes {
            for (axis, &radius) in radius.iter().enumerate() {
                if radius > 0 {
                    self.blur_axis(axis, radius);
                }
            }
        }
        self
    }

    /// One pass along one axis. Whole rows of the faster axes are added, so that the loops vectorise.
    fn blur_axis(&mut self, axis: usize, radius: usize) {
        let length = self.shape[axis];
        let stride: usize = self.shape[axis + 1..].iter().product();
        let weight = 1.0 / (2 * radius + 1) as f32;
        let wrap = |position: usize, shift: usize| (position + length + shift - radius % length) % length;
        let mut mixed = vec![0.0_f32; length * stride];
        for block in self.values.chunks_exact_mut(length * stride) {
            for (position, row) in mixed.chunks_exact_mut(stride).enumerate() {
                row.fill(0.0);
                for shift in 0..=2 * radius {
                    let from = wrap(position, shift) * stride;
                    for (sum, value) in row.iter_mut().zip(&block[from..from + stride]) {
                        *sum += value;
                    }
                }
                row.iter_mut().for_each(|sum| *sum *= weight);
            }
            block.copy_from_slice(&mixed);
        }
    }

    /// The grey volume: values are cut to 0..=1, scaled to 255 and rounded.
    pub(crate) fn into_volume(self) -> Volume {
        let voxels = self.values.iter().map(|value| (value * 255.0 + 0.5) as u8).collect();
        volume(self.shape, 1, voxels)
    }
}

/// The volume of a shape and voxels that are known to be valid.
pub(crate) fn volume(shape: Shape, channels: usize, voxels: Vec<u8>) -> Volume {
    match Volume::new(shape, channels, voxels) {
        Ok(volume) => volume,
        // Recipes with short sides are refused when they are parsed, and fields are full by construction.
        Err(error) => unreachable!("a field is always a valid volume: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blur_is_a_moving_average_that_keeps_the_mean() {
        let shape = [3, 4, 5];
        let mut field = Field::constant(shape, 0.0);
        for (i, value) in field.values_mut().iter_mut().enumerate() {
            *value = (i * i % 17) as f32;
        }
        let blurred = field.clone().blurred([0, 0, 1], 1);
        let row = &field.values()[..5];
        let expected = [row[4] + row[0] + row[1], row[0] + row[1] + row[2]].map(|sum| sum / 3.0);
        for (found, expected) in blurred.values().iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5);
        }
        // A box wider than the field wraps around more than once.
        let mean = |field: &Field| field.values().iter().sum::<f32>() / field.values().len() as f32;
        assert!((mean(&field) - mean(&field.clone().blurred([7, 2, 1], 3))).abs() < 1e-3);
    }

    #[test]
    fn quantiles_divide_the_values() {
        let mut field = Field::constant([10, 10, 10], 0.0);
        field.values_mut().iter_mut().enumerate().for_each(|(i, value)| *value = i as f32);
        assert!((field.quantile(0.25) - 250.0).abs() < 2.0);
        assert_eq!(Field::constant([3, 3, 3], 2.0).quantile(0.5), 2.0);
    }

    #[test]
    fn levels_are_rounded_and_clamped() {
        let mut field = Field::constant([3, 3, 3], 0.5);
        field.values_mut()[..4].copy_from_slice(&[-1.0, 2.0, 1.0, f32::NAN]);
        assert_eq!(field.into_volume().voxels()[..5], [0, 255, 255, 0, 128]);
    }
}
