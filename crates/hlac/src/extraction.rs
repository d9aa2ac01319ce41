//! [`Extraction`]: the exact sums with options: spacing, a region, several threads.

use crate::kernel::{self, Input};
use crate::voxels::{Shape, check_shape};
use crate::{ExtractError, MaskSpacing, OctantSums, RegionOctantSums, Voxels};

/// Options for the exact sums; [`extract`](crate::extract) uses the defaults: spacing 1, on the calling thread.
///
/// ```
/// use hlac::{Extraction, MaskSpacing, Voxels};
///
/// let slice: Vec<u8> = (0..8 * 8 * 8).map(|i| i as u8).collect();
/// let voxels = Voxels::new(&slice, [8, 8, 8])?;
/// let sums = Extraction::new().spacing(MaskSpacing::Two).sums(voxels)?.total();
/// assert_eq!(sums.windows, 4 * 4 * 4);
/// # Ok::<(), hlac::ExtractError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct Extraction {
    spacing: MaskSpacing,
    parallel: bool,
}

impl Extraction {
    /// Spacing 1, on the calling thread.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets how far apart the cells of a window are.
    pub fn spacing(self, spacing: MaskSpacing) -> Self {
        Self { spacing, ..self }
    }

    /// Sets whether the threads of the current rayon pool share each volume (or each slab).
    ///
    /// This suits few or large volumes. With more volumes than cores, one thread per volume is faster.
    pub fn parallel(self, parallel: bool) -> Self {
        Self { parallel, ..self }
    }

    /// The octant sums of a volume.
    ///
    /// # Errors
    /// [`ExtractError::TooSmall`] if no window of this spacing fits.
    pub fn sums(&self, voxels: Voxels<'_>) -> Result<OctantSums, ExtractError> {
        check_shape(voxels.shape(), self.spacing)?;
        Ok(self.run(voxels.shape(), voxels.as_slice()))
    }

    /// The octant sums of the part of a volume that lies in a region.
    ///
    /// The voxels of `region` that are not 0 are the region. A window counts for a mask if all of the mask's cells lie in
    /// the region, so every mask has its own number of windows.
    ///
    /// # Errors
    /// - [`ExtractError::TooSmall`] if no window of this spacing fits.
    /// - [`ExtractError::RegionShape`] if the region has another shape than the volume.
    pub fn sums_in(&self, voxels: Voxels<'_>, region: Voxels<'_>) -> Result<RegionOctantSums, ExtractError> {
        let shape = voxels.shape();
        check_shape(shape, self.spacing)?;
        if region.shape() != shape {
            return Err(ExtractError::RegionShape { volume: shape, region: region.shape() });
        }
        let (masked, inside) = within(voxels.as_slice(), region.as_slice());
        Ok(RegionOctantSums::of(&self.run(shape, &masked), &self.run(shape, &inside)))
    }

    /// The spacing in voxels.
    pub(crate) fn spacing_voxels(&self) -> usize {
        self.spacing.voxels()
    }

    /// Checks that a volume has windows of this spacing.
    pub(crate) fn check(&self, shape: Shape) -> Result<usize, ExtractError> {
        check_shape(shape, self.spacing)
    }

    fn run(&self, shape: Shape, voxels: &[u8]) -> OctantSums {
        self.input_sums(&Input::whole(shape, self.spacing.voxels(), voxels))
    }

    /// What an input adds to the octant sums of its volume.
    pub(crate) fn input_sums(&self, input: &Input<'_>) -> OctantSums {
        if self.parallel { kernel::sums_in_pool(input) } else { kernel::sums(input) }
    }
}

/// The voxels of a region with everything outside set to 0, and the region itself as 0 and 255.
///
/// A product with a cell outside is 0, so the sums within the region are those of the first; and the windows that count
/// are the sums of the second, with 1 for 255.
pub(crate) fn within(voxels: &[u8], region: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let inside: Vec<u8> = region.iter().map(|&voxel| if voxel == 0 { 0 } else { 255 }).collect();
    (voxels.iter().zip(&inside).map(|(voxel, inside)| voxel & inside).collect(), inside)
}
