//! [`Extraction`]: the exact sums with options: spacing, a region, several threads.

use super::OctantSums;
use super::kernel::{self, Slab};
use super::sums::RegionSums;
use hlacdb_volume::{Shape, Volume};

/// How far apart the cells of a window are, in voxels: the window is a cube of 3, 5 or 9 voxels a side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Spacing {
    /// Neighbouring voxels: the paper's windows.
    #[default]
    One,
    /// Every second voxel.
    Two,
    /// Every fourth voxel.
    Four,
}

impl Spacing {
    /// All of them, ascending.
    pub const ALL: [Self; 3] = [Self::One, Self::Two, Self::Four];

    /// 1, 2 or 4.
    pub const fn voxels(self) -> usize {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Four => 4,
        }
    }

    /// How many windows a volume of this shape has; 0 where none fits.
    pub fn windows(self, shape: Shape) -> u64 {
        shape.iter().map(|&side| side.saturating_sub(2 * self.voxels()) as u64).product()
    }

    /// That a window fits.
    pub(super) fn check(self, shape: Shape) -> Result<(), ExtractError> {
        let needed = 2 * self.voxels() + 1;
        if shape.iter().any(|&side| side < needed) {
            return Err(ExtractError::TooSmall { shape, spacing: self.voxels(), needed });
        }
        Ok(())
    }
}

/// Who works on one volume.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Workers {
    /// The calling thread alone: right when there are more volumes than cores.
    #[default]
    One,
    /// The threads of the current rayon pool, slab by slab: right for few or large volumes.
    Pool,
}

/// The exact sums with options; [`super::extract`] is this with none.
///
/// ```
/// use hlac::{Extraction, Spacing};
/// use hlacdb_volume::Volume;
/// let volume = Volume::from_fn([8, 8, 8], |z, y, x| (z * y * x) as u8)?;
/// let sums = Extraction::new().spacing(Spacing::Two).sums(&volume)?.total();
/// assert_eq!(sums.windows, 4 * 4 * 4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub struct Extraction {
    spacing: Spacing,
    workers: Workers,
}

impl Extraction {
    /// Spacing 1, on the calling thread.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets how far apart the cells of a window are. There are then (Z-2s)(Y-2s)(X-2s) windows.
    pub fn spacing(self, spacing: Spacing) -> Self {
        Self { spacing, ..self }
    }

    /// Sets who works.
    pub fn workers(self, workers: Workers) -> Self {
        Self { workers, ..self }
    }

    /// The octant sums of a volume (of its luma, where it has colour).
    ///
    /// # Errors
    /// [`ExtractError::TooSmall`] where no window of this spacing fits.
    pub fn sums(&self, volume: &Volume) -> Result<OctantSums, ExtractError> {
        self.spacing.check(volume.shape())?;
        let grey = volume.luma();
        Ok(self.run(grey.shape(), grey.voxels()))
    }

    /// The octant sums of the part of a volume that lies in a region.
    ///
    /// `region` is a grey volume of the same shape; its voxels that are not 0 are the region. A window counts for a mask
    /// when all of the mask's cells lie in the region, so every mask has its own number of windows.
    ///
    /// # Errors
    /// [`ExtractError::TooSmall`], [`ExtractError::Region`].
    pub fn sums_in(&self, volume: &Volume, region: &Volume) -> Result<RegionSums, ExtractError> {
        self.spacing.check(volume.shape())?;
        if region.shape() != volume.shape() || region.channels() != 1 {
            return Err(ExtractError::Region {
                volume: volume.shape(),
                region: region.shape(),
                channels: region.channels(),
            });
        }
        let grey = volume.luma();
        let (masked, inside) = within(grey.voxels(), region.voxels());
        Ok(RegionSums::of(&self.run(grey.shape(), &masked), &self.run(grey.shape(), &inside)))
    }

    fn run(&self, shape: Shape, voxels: &[u8]) -> OctantSums {
        let slab = Slab::whole(shape, self.spacing.voxels(), voxels);
        match self.workers {
            Workers::One => kernel::sums(&slab),
            Workers::Pool => kernel::sums_in_pool(&slab),
        }
    }
}

/// The voxels of a region with everything outside set to 0, and the region itself as 0 and 255.
///
/// A product with a cell outside is 0, so the sums within the region are those of the first; and the windows that count
/// are the sums of the second, with 1 for 255.
pub(super) fn within(voxels: &[u8], region: &[u8]) -> (Vec<u8>, Vec<u8>) {
    let inside: Vec<u8> = region.iter().map(|&voxel| if voxel == 0 { 0 } else { 255 }).collect();
    (voxels.iter().zip(&inside).map(|(voxel, inside)| voxel & inside).collect(), inside)
}

/// Why there are no sums.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractError {
    /// No window of this spacing fits the volume.
    #[error(
        "the volume is {} x {} x {} (Z, Y, X), but windows of spacing {spacing} need {needed} voxels on every side: take a smaller spacing",
        shape[0], shape[1], shape[2]
    )]
    TooSmall {
        /// The volume's shape.
        shape: Shape,
        /// The spacing that was asked for.
        spacing: usize,
        /// The shortest side that would do.
        needed: usize,
    },
    /// The region is no mask of the volume.
    #[error(
        "the region is {} x {} x {} with {channels} channel(s), but the volume is {} x {} x {}: a region is a grey volume of the same shape",
        region[0], region[1], region[2], volume[0], volume[1], volume[2]
    )]
    Region {
        /// The volume's shape.
        volume: Shape,
        /// The region's shape.
        region: Shape,
        /// The region's channels.
        channels: usize,
    },
    /// More random windows were asked for than there are.
    #[error(
        "{found} random windows were asked for, but the volume has {there}: take fewer, or all of them, which is exact and cheaper"
    )]
    Windows {
        /// How many were asked for.
        found: u64,
        /// How many the volume has.
        there: u64,
    },
    /// Slabs were given that do not make up the volume.
    #[error("{found} voxels were given in slabs, but a volume of {} x {} x {} has {expected}: give every Z-plane once, in order, whole", shape[0], shape[1], shape[2])]
    Slabs {
        /// The volume's shape.
        shape: Shape,
        /// The voxels that the shape needs, or the next whole plane would end at.
        expected: u64,
        /// The voxels that came.
        found: u64,
    },
}
