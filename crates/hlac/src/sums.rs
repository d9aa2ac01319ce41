//! Exact sums, and the moments made of them.

use std::iter::Sum;
use std::ops::AddAssign;

use crate::voxels::Shape;
use crate::{MASK_COUNT, MASKS};

/// 251 exact sums and the number of windows that they run over.
///
/// A product is at most 255^3 < 2^24, so a `u64` holds the sums of the 2^40 windows that a volume may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sums {
    /// The number of windows: (Z-2)(Y-2)(X-2) for a whole volume.
    pub windows: u64,
    /// For each mask, in the order of [`MASKS`], the sum over the windows of the product of the intensities at its cells.
    pub values: [u64; MASK_COUNT],
}

impl Sums {
    /// The sums over no window.
    pub const ZERO: Self = Self { windows: 0, values: [0; MASK_COUNT] };

    /// The moments, the 251-d descriptor: `sums / (windows * 255^cells)`, each in [0, 1]; all 0 if there is no window.
    pub fn moments(&self) -> [f64; MASK_COUNT] {
        let mut moments = [0.0; MASK_COUNT];
        if self.windows > 0 {
            for ((moment, &sum), mask) in moments.iter_mut().zip(&self.values).zip(&MASKS) {
                // Both are exact in f64 up to 2^53; beyond, the error is one rounding.
                *moment = sum as f64 / (self.windows as f64 * 255_f64.powi(mask.order() as i32));
            }
        }
        moments
    }

    /// The [moments](Self::moments), rounded to `f32`.
    pub fn descriptor(&self) -> [f32; MASK_COUNT] {
        self.moments().map(|moment| moment as f32)
    }
}

impl AddAssign<&Sums> for Sums {
    fn add_assign(&mut self, other: &Sums) {
        self.windows += other.windows;
        for (value, other) in self.values.iter_mut().zip(&other.values) {
            *value += other;
        }
    }
}

impl<'a> Sum<&'a Sums> for Sums {
    fn sum<I: Iterator<Item = &'a Sums>>(iter: I) -> Self {
        iter.fold(Self::ZERO, |mut total, sums| {
            total += sums;
            total
        })
    }
}

/// The sums of the eight octants: windows split by their position at half of each axis, rounded down.
///
/// Octant `4 a + 2 b + c` has the windows of the lower (0) or upper (1) half in Z (a), Y (b) and X (c). Sums are
/// additive: the eight add up to the whole, to the bit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OctantSums(pub(crate) Box<[Sums; 8]>);

impl OctantSums {
    /// Eight octants without windows.
    pub fn zero() -> Self {
        Self(Box::new([Sums::ZERO; 8]))
    }

    /// The sums of the eight octants.
    pub fn octants(&self) -> &[Sums; 8] {
        &self.0
    }

    /// The sums of the whole volume.
    pub fn total(&self) -> Sums {
        self.0.iter().sum()
    }

    /// The sums of the octant of the window at `position`, of a volume with `windows` windows along each axis (Z, Y, X).
    pub(crate) fn of_window_mut(&mut self, windows: Shape, position: Shape) -> &mut Sums {
        let upper = |axis: usize| usize::from(position[axis] >= windows[axis] / 2);
        &mut self.0[4 * upper(0) + 2 * upper(1) + upper(2)]
    }
}

impl From<[Sums; 8]> for OctantSums {
    fn from(octants: [Sums; 8]) -> Self {
        Self(Box::new(octants))
    }
}

impl AddAssign<&OctantSums> for OctantSums {
    fn add_assign(&mut self, other: &OctantSums) {
        for (sums, other) in self.0.iter_mut().zip(other.0.iter()) {
            *sums += other;
        }
    }
}

/// Sums within a region: every mask has its own number of windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RegionSums {
    /// For each mask, the number of windows in which all of its cells lie in the region.
    pub windows: [u64; MASK_COUNT],
    /// For each mask, in the order of [`MASKS`], the sum over those windows of the product of the intensities.
    pub values: [u64; MASK_COUNT],
}

impl RegionSums {
    /// The moments: `sums / (windows * 255^cells)`, each in [0, 1]; 0 for a mask without windows.
    pub fn moments(&self) -> [f64; MASK_COUNT] {
        let mut moments = [0.0; MASK_COUNT];
        for (index, moment) in moments.iter_mut().enumerate() {
            if self.windows[index] > 0 {
                let full = self.windows[index] as f64 * 255_f64.powi(MASKS[index].order() as i32);
                *moment = self.values[index] as f64 / full;
            }
        }
        moments
    }
}

/// The sums within a region, by octant in the order of [`OctantSums`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RegionOctantSums(Box<[RegionSums; 8]>);

impl RegionOctantSums {
    /// From the sums of the voxels with everything outside the region set to 0, and those of the region as 0 and 255.
    pub(crate) fn of(values: &OctantSums, inside: &OctantSums) -> Self {
        Self(Box::new(std::array::from_fn(|octant| {
            let mut windows = inside.0[octant].values;
            for (count, mask) in windows.iter_mut().zip(&MASKS) {
                *count /= 255_u64.pow(mask.order() as u32);
            }
            RegionSums { windows, values: values.0[octant].values }
        })))
    }

    /// The sums of the eight octants.
    pub fn octants(&self) -> &[RegionSums; 8] {
        &self.0
    }

    /// The sums of the whole region.
    pub fn total(&self) -> RegionSums {
        let mut total = RegionSums { windows: [0; MASK_COUNT], values: [0; MASK_COUNT] };
        for sums in self.0.iter() {
            for index in 0..MASK_COUNT {
                total.windows[index] += sums.windows[index];
                total.values[index] += sums.values[index];
            }
        }
        total
    }
}
