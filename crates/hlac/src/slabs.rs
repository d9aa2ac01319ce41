//! [`SlabExtractor`] and [`RegionSlabExtractor`]: the sums of a volume that does not fit in memory.

use crate::extraction::within;
use crate::kernel::Input;
use crate::voxels::Shape;
use crate::{ExtractError, Extraction, OctantSums, RegionOctantSums};

impl Extraction {
    /// Takes a volume of `shape` (Z, Y, X) plane by plane.
    ///
    /// # Errors
    /// - [`ExtractError::TooSmall`] if no window of this spacing fits.
    /// - [`ExtractError::TooLarge`] if the number of voxels or windows is too large.
    pub fn slabs(&self, shape: [usize; 3]) -> Result<SlabExtractor, ExtractError> {
        SlabExtractor::with_options(shape, *self)
    }

    /// Takes a volume of `shape` (Z, Y, X) and a region plane by plane.
    ///
    /// # Errors
    /// As for [`slabs`](Self::slabs).
    pub fn region_slabs(&self, shape: [usize; 3]) -> Result<RegionSlabExtractor, ExtractError> {
        RegionSlabExtractor::with_options(shape, *self)
    }
}

/// Takes a grey volume's Z-planes in order and gives its octant sums, the same bits as [`extract`](crate::extract) of the
/// whole.
///
/// Between calls it holds the last planes that later windows need: at most two, times the spacing. [`Extraction::slabs`]
/// makes one with options.
///
/// ```
/// use hlac::{SlabExtractor, Voxels};
///
/// let volume: Vec<u8> = (0..9 * 5 * 5).map(|i| i as u8).collect();
/// let mut slabs = SlabExtractor::new([9, 5, 5])?;
/// for planes in volume.chunks(4 * 5 * 5) {
///     slabs.push(planes)?;
/// }
/// assert_eq!(slabs.finish()?, hlac::extract(Voxels::new(&volume, [9, 5, 5])?));
/// # Ok::<(), hlac::ExtractError>(())
/// ```
#[derive(Debug)]
pub struct SlabExtractor {
    shape: Shape,
    options: Extraction,
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
    /// - [`ExtractError::TooSmall`] if a side is under 3.
    /// - [`ExtractError::TooLarge`] if the number of voxels or windows is too large.
    pub fn new(shape: [usize; 3]) -> Result<Self, ExtractError> {
        Self::with_options(shape, Extraction::new())
    }

    pub(crate) fn with_options(shape: Shape, options: Extraction) -> Result<Self, ExtractError> {
        options.check(shape)?;
        Ok(Self { shape, options, planes: Vec::new(), first: 0, octants: OctantSums::zero() })
    }

    /// Takes the next planes: one or more whole ones, X fastest.
    ///
    /// # Errors
    /// [`ExtractError::Planes`] if the planes are not whole or go past the volume's end; the extractor is unchanged then.
    pub fn push(&mut self, planes: &[u8]) -> Result<(), ExtractError> {
        let plane = self.shape[1] * self.shape[2];
        let before = self.first * plane + self.planes.len();
        let after = before + planes.len();
        let whole = self.shape[0] * plane;
        if !planes.len().is_multiple_of(plane) || after > whole {
            let expected = after.next_multiple_of(plane).min(whole);
            return Err(ExtractError::Planes { shape: self.shape, expected: expected as u64, found: after as u64 });
        }
        self.planes.extend_from_slice(planes);
        let spacing = self.options.spacing_voxels();
        let windows = (self.planes.len() / plane).saturating_sub(2 * spacing);
        if windows > 0 {
            let windows = self.first..self.first + windows;
            let input = Input { shape: self.shape, spacing, windows: windows.clone(), voxels: &self.planes };
            self.octants += &self.options.input_sums(&input);
            self.planes.drain(..windows.len() * plane);
            self.first = windows.end;
        }
        Ok(())
    }

    /// The octant sums of the whole volume.
    ///
    /// # Errors
    /// [`ExtractError::Planes`] if planes are missing.
    pub fn finish(self) -> Result<OctantSums, ExtractError> {
        let plane = self.shape[1] * self.shape[2];
        let found = self.first * plane + self.planes.len();
        let expected = self.shape[0] * plane;
        if found != expected {
            return Err(ExtractError::Planes { shape: self.shape, expected: expected as u64, found: found as u64 });
        }
        Ok(self.octants)
    }
}

/// As [`SlabExtractor`], for the part of a volume that lies in a region; the same bits as [`Extraction::sums_in`] of the
/// whole. [`Extraction::region_slabs`] makes one with options.
#[derive(Debug)]
pub struct RegionSlabExtractor {
    values: SlabExtractor,
    inside: SlabExtractor,
}

impl RegionSlabExtractor {
    /// For a grey volume of `shape` (Z, Y, X) at spacing 1, on the calling thread.
    ///
    /// # Errors
    /// As for [`SlabExtractor::new`].
    pub fn new(shape: [usize; 3]) -> Result<Self, ExtractError> {
        Self::with_options(shape, Extraction::new())
    }

    pub(crate) fn with_options(shape: Shape, options: Extraction) -> Result<Self, ExtractError> {
        let extractor = || SlabExtractor::with_options(shape, options);
        Ok(Self { values: extractor()?, inside: extractor()? })
    }

    /// Takes the next planes of the volume and of the region, whose voxels that are not 0 are inside.
    ///
    /// # Errors
    /// [`ExtractError::Planes`] if the planes are not whole, go past the volume's end, or differ in length.
    pub fn push(&mut self, planes: &[u8], region: &[u8]) -> Result<(), ExtractError> {
        if planes.len() != region.len() {
            let (expected, found) = (planes.len() as u64, region.len() as u64);
            return Err(ExtractError::Planes { shape: self.values.shape, expected, found });
        }
        let (masked, inside) = within(planes, region);
        self.values.push(&masked)?;
        self.inside.push(&inside)
    }

    /// The sums within the region.
    ///
    /// # Errors
    /// [`ExtractError::Planes`] if planes are missing.
    pub fn finish(self) -> Result<RegionOctantSums, ExtractError> {
        Ok(RegionOctantSums::of(&self.values.finish()?, &self.inside.finish()?))
    }
}
