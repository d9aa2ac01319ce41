//! 3-D higher-order local autocorrelation: from a volume to its 251 exact sums.
//!
//! Vocabulary: a *mask* is one of the 251 cell patterns ([`masks`]); a *window* is one placement of the 3x3x3 cube
//! wholly inside the volume; *sums* are, for each mask, the exact sum over all windows of the product of the
//! intensities at its cells; *octants* are the eight halves-by-halves-by-halves of the windows. With a *spacing* the cells of
//! a window lie 2 or 4 voxels apart; in a *region* a window counts for the masks whose cells all lie in it
//! ([`Extraction`]). A volume that does not fit the memory is taken plane by plane ([`SlabExtractor`]).
//!
//! Imports only [`hlacdb_volume`]. Exact means exact: every kernel gives the same bits.

mod extraction;
mod hit_sum;
#[allow(unsafe_code, reason = "vector instructions; every block says what makes it sound")]
pub mod kernel;
pub mod masks;
pub mod orbits;
mod sampled;
mod slabs;
mod sums;
pub mod views;

pub use extraction::{ExtractError, Extraction, Spacing, Workers};
pub use hit_sum::{HitSums, extract_hit_sum};
pub use masks::{MASK_COUNT, MASKS, Mask};
pub use sampled::extract_sampled;
pub use slabs::{RegionSlabExtractor, SlabExtractor};
pub use sums::{MaskedSums, OctantSums, RegionSums, Sums};
pub use views::{View, describe};

use hlacdb_volume::Volume;
use kernel::Slab;

/// The exact sums of a volume's eight octants (of its luma, where it has colour), on the calling thread.
///
/// ```
/// use hlacdb_volume::Volume;
/// let volume = Volume::new([3, 3, 3], 1, vec![1; 27])?;
/// let sums = hlac::extract(&volume).total();
/// assert_eq!((sums.windows, sums.values[0], sums.values[250]), (1, 1, 1));
/// # Ok::<(), hlacdb_volume::VolumeError>(())
/// ```
pub fn extract(volume: &Volume) -> OctantSums {
    let grey = volume.luma();
    kernel::sums(&Slab::whole(grey.shape(), 1, grey.voxels()))
}

/// [`extract`] by the threads of the current rayon pool: for volumes that are few, or large.
pub fn extract_parallel(volume: &Volume) -> OctantSums {
    let grey = volume.luma();
    kernel::sums_in_pool(&Slab::whole(grey.shape(), 1, grey.voxels()))
}
