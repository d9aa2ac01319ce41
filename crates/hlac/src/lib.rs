//! Exact 3-D higher-order local autocorrelation (HLAC) features of voxel volumes.
//!
//! HLAC describes a texture by how often grey levels occur together: for each of 251 small cell patterns, the *masks*, it
//! sums the product of the intensities at the pattern's cells over every position in the volume (Suzuki, Yaginuma, Osawa:
//! *A HLAC Shape Descriptor Extraction Method for 3D Solid Textures*). The 251 normalised sums, the *moments*, form a
//! descriptor that does not depend on where in the volume a structure lies.
//!
//! ```
//! use hlac::{MASKS, View, Voxels};
//!
//! // Grey voxels, X fastest in memory, and their shape (Z, Y, X).
//! let slice: Vec<u8> = (0..32 * 32 * 32).map(|i: usize| (i / 8 % 2 * 200) as u8).collect();
//! let volume = Voxels::new(&slice, [32, 32, 32])?;
//!
//! let sums = hlac::extract(volume).total();
//! assert_eq!(sums.windows, 30 * 30 * 30);
//! let moments = sums.moments();
//! println!("mask {}: {}", MASKS[14].letters(), moments[14]);
//!
//! // The same masks over mapped copies, which ignore brightness and contrast or look at coarser structure.
//! for (view, octants) in hlac::describe(volume, &View::STANDARD) {
//!     println!("{view}: {:?}", octants.total().descriptor());
//! }
//! # Ok::<(), hlac::ExtractError>(())
//! ```
//!
//! # Terms
//!
//! | term | meaning |
//! |---|---|
//! | [mask](Mask) | one of the 251 patterns of one to three cells in a 3x3x3 cube |
//! | window | one placement of the cube wholly inside the volume |
//! | [sums](Sums) | for each mask, the exact sum over all windows of the product of the intensities at its cells |
//! | [moments](Sums::moments) | `sums / (windows * 255^cells)`, each in [0, 1] |
//! | [octants](OctantSums) | the eight halves by halves by halves of the windows; their sums add up to those of the whole |
//! | [view](View) | a mapped copy of the volume, described by the same masks |
//! | [orbit](orbits) | masks that are images of one another under the 48 symmetries of the cube |
//! | [mask spacing](MaskSpacing) | how far apart the cells of a window are: 1, 2 or 4 voxels |
//! | region | any set of voxels; a window counts for the masks whose cells all lie in it ([`Extraction::sums_in`]) |
//!
//! # Exactness
//!
//! Sums are integers. Every [kernel](kernels), any number of threads, and a volume given whole or [in slabs](SlabExtractor)
//! yield the same bits.
//!
//! # What this crate does not do
//!
//! It takes grey `u8` voxels: convert colour to luma and map deeper samples to 8 bits first. It reads no files and
//! measures no distance between descriptors.

#![deny(unsafe_code)]

mod error;
mod extraction;
mod hit_sum;
#[allow(unsafe_code, reason = "vector instructions; a SAFETY comment at each block says why it is sound")]
mod kernel;
pub mod kernels;
mod masks;
pub mod orbits;
mod sampled;
mod slabs;
mod spacing;
mod sums;
mod views;
mod voxels;

/// The examples of the README are compiled and run like any other.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub use error::ExtractError;
pub use extraction::Extraction;
pub use hit_sum::{HitSums, extract_hit_sum};
pub use masks::{MASK_COUNT, MASKS, MASKS_BY_ORDER, Mask};
pub use sampled::extract_sampled;
pub use slabs::{RegionSlabExtractor, SlabExtractor};
pub use spacing::MaskSpacing;
pub use sums::{OctantSums, RegionOctantSums, RegionSums, Sums};
pub use views::{MIN_SCALED_SIDE, UnknownView, View, ViewScale, describe};
pub use voxels::{VoxelBuf, Voxels};

use kernel::Input;

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
    kernel::sums(&Input::whole(volume.shape(), 1, volume.as_slice()))
}

/// [`extract`] by the threads of the current rayon pool: for few or large volumes.
pub fn extract_parallel(volume: Voxels<'_>) -> OctantSums {
    kernel::sums_in_pool(&Input::whole(volume.shape(), 1, volume.as_slice()))
}
