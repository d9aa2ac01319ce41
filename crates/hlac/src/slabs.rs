//! [`SlabExtractor`] and [`RegionSlabExtractor`]: the sums of a volume that does not fit the memory.

use super::OctantSums;
use super::extraction::{ExtractError, Spacing, Workers, within};
use super::kernel::{self, Slab};
use super::sums::RegionSums;
use hlacdb_volume::Shape;

/// Takes a grey volume's Z-planes in order and gives its octant sums, the same bits as [`super::extract`] of the whole.
///
/// The last planes that later windows need (two, times the spacing) are kept between calls, beside the planes of the
/// call itself.
///
/// ```
/// use hlac::{self, SlabExtractor};
/// use hlacdb_volume::Volume;
/// let volume = Volume::from_fn([9, 5, 5], |z, y, x| (z * y * x) as u8)?;
/// let mut slabs = SlabExtractor::new(volume.shape())?;
/// for planes in volume.voxels().chunks(4 * 5 * 5) {
///     slabs.push(planes)?;
/// }
/// assert_eq!(slabs.finish()?, hlac::extract(&volume));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct SlabExtractor {
    shape: Shape,
    spacing: usize,
    workers: Workers,
    /// The planes that later windows still need (at most two, times the spacing), then the new ones.
    planes: Vec<u8>,
    /// The Z of the first plane in `planes`.
    first: usize,
    octants: OctantSums,
}

impl SlabExtractor {
    /// For a grey volume of `shape` (Z, Y, X) at spacing 1, on the calling thread.
    ///
    /// # Errors
    /// [`ExtractError::TooSmall`] where a side is under 3.
    pub fn new(shape: Shape) -> Result<Self, ExtractError> {
        Self::spaced(shape, Spacing::One)
    }

    /// As [`new`](Self::new), with windows whose cells are `spacing` apart.
    ///
    /// # Errors
    /// [`ExtractError::TooSmall`] where no such window fits.
    pub fn spaced(shape: Shape, spacing: Spacing) -> Result<Self, ExtractError> {
        spacing.check(shape)?;
        let (spacing, workers) = (spacing.voxels(), Workers::One);
        Ok(Self { shape, spacing, workers, planes: Vec::new(), first: 0, octants: OctantSums::zero() })
    }

    /// Sets who works on the planes of each [`push`](Self::push).
    #[must_use]
    pub fn workers(self, workers: Workers) -> Self {
        Self { workers, ..self }
    }

    /// Takes the next planes: one or more whole ones, X fastest.
    ///
    /// # Errors
    /// [`ExtractError::Slabs`] where the planes are not whole or go past the volume's end; nothing is taken then.
    pub fn push(&mut self, planes: &[u8]) -> Result<(), ExtractError> {
        let plane = self.shape[1] * self.shape[2];
        let before = self.first * plane + self.planes.len();
        let after = before + planes.len();
        let whole = self.shape[0] * plane;
        if !planes.len().is_multiple_of(plane) || after > whole {
            let expected = after.next_multiple_of(plane).min(whole);
            return Err(ExtractError::Slabs { shape: self.shape, expected: expected as u64, found: after as u64 });
        }
        self.planes.extend_from_slice(planes);
        let windows = (self.planes.len() / plane).saturating_sub(2 * self.spacing);
        if windows > 0 {
            let windows = self.first..self.first + windows;
            let slab =
                Slab { shape: self.shape, spacing: self.spacing, windows: windows.clone(), voxels: &self.planes };
            self.octants += &match self.workers {
                Workers::One => kernel::sums(&slab),
                Workers::Pool => kernel::sums_in_pool(&slab),
            };
            self.planes.drain(..windows.len() * plane);
            self.first = windows.end;
        }
        Ok(())
    }

    /// The octant sums of the whole volume.
    ///
    /// # Errors
    /// [`ExtractError::Slabs`] where planes are missing.
    pub fn finish(self) -> Result<OctantSums, ExtractError> {
        let plane = self.shape[1] * self.shape[2];
        let found = self.first * plane + self.planes.len();
        let expected = self.shape[0] * plane;
        if found != expected {
            return Err(ExtractError::Slabs { shape: self.shape, expected: expected as u64, found: found as u64 });
        }
        Ok(self.octants)
    }
}

/// As [`SlabExtractor`], of the part of a volume that lies in a region; the same bits as
/// [`Extraction::sums_in`](super::Extraction::sums_in) of the whole.
#[derive(Debug)]
pub struct RegionSlabExtractor {
    values: SlabExtractor,
    inside: SlabExtractor,
}

impl RegionSlabExtractor {
    /// For a grey volume of `shape` (Z, Y, X) and windows whose cells are `spacing` apart, on the calling thread.
    ///
    /// # Errors
    /// [`ExtractError::TooSmall`] where no such window fits.
    pub fn spaced(shape: Shape, spacing: Spacing) -> Result<Self, ExtractError> {
        Ok(Self { values: SlabExtractor::spaced(shape, spacing)?, inside: SlabExtractor::spaced(shape, spacing)? })
    }

    /// Sets who works on the planes of each [`push`](Self::push).
    #[must_use]
    pub fn workers(self, workers: Workers) -> Self {
        Self { values: self.values.workers(workers), inside: self.inside.workers(workers) }
    }

    /// Takes the next planes of the volume and of the region, whose voxels that are not 0 are inside.
    ///
    /// # Errors
    /// [`ExtractError::Slabs`] where the planes are not whole, go past the volume's end, or are not as many of both.
    pub fn push(&mut self, planes: &[u8], region: &[u8]) -> Result<(), ExtractError> {
        if planes.len() != region.len() {
            let (expected, found) = (planes.len() as u64, region.len() as u64);
            return Err(ExtractError::Slabs { shape: self.values.shape, expected, found });
        }
        let (masked, inside) = within(planes, region);
        self.values.push(&masked)?;
        self.inside.push(&inside)
    }

    /// The sums within the region.
    ///
    /// # Errors
    /// [`ExtractError::Slabs`] where planes are missing.
    pub fn finish(self) -> Result<RegionSums, ExtractError> {
        Ok(RegionSums::of(&self.values.finish()?, &self.inside.finish()?))
    }
}
