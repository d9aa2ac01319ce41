//! 3-D higher-order local autocorrelation: from a grey volume to its 251 exact sums.
//!
//! Vocabulary: a *mask* is one of the 251 cell patterns ([`masks`]); a *window* is one placement of the 3x3x3 cube
//! wholly inside the volume; *sums* are, for each mask, the exact sum over all windows of the product of the
//! intensities at its cells; *octants* are the eight halves-by-halves-by-halves of the windows. With a *spacing* the cells of
//! a window lie 2 or 4 voxels apart; in a *region* a window counts for the masks whose cells all lie in it
//! ([`Extraction`]). A volume that does not fit in memory is taken plane by plane ([`SlabExtractor`]).
//!
//! Sums are integers: every kernel and any number of threads give the same bits.

mod error;
mod extraction;
mod hit_sum;
#[allow(unsafe_code, reason = "vector instructions; every block says what makes it sound")]
pub mod kernel;
pub mod masks;
pub mod orbits;
mod sampled;
mod slabs;
mod sums;
mod views;
mod voxels;

pub use error::ExtractError;
pub use extraction::{Extraction, MaskSpacing};
pub use hit_sum::{HitSums, extract_hit_sum};
pub use masks::{MASK_COUNT, MASKS, Mask};
pub use sampled::extract_sampled;
pub use slabs::{RegionSlabExtractor, SlabExtractor};
pub use sums::{MaskedSums, OctantSums, RegionSums, Sums};
pub use views::{MIN_SCALED_SIDE, Scale, UnknownView, View, describe};
pub use voxels::{VoxelBuf, Voxels};

use kernel::Slab;

/// The exact sums of a volume's eight octants, on the calling thread.
///
/// ```
/// use hlac::Voxels;
///
/// let sums = hlac::extract(Voxels::new(&[1; 27], [3, 3, 3])?).total();
/// assert_eq!((sums.windows, sums.values[0], sums.values[250]), (1, 1, 1));
/// # Ok::<(), hlac::ExtractError>(())
/// ```
pub fn extract(volume: Voxels<'_>) -> OctantSums {
    kernel::sums(&Slab::whole(volume.shape(), 1, volume.as_slice()))
}

/// [`extract`] by the threads of the current rayon pool: for few or large volumes.
pub fn extract_parallel(volume: Voxels<'_>) -> OctantSums {
    kernel::sums_in_pool(&Slab::whole(volume.shape(), 1, volume.as_slice()))
}
