//! Volumes: voxels in memory, and how they come from files.
//!
//! A *volume* is a block of `u8` voxels of shape (Z, Y, X) with X fastest, one channel (grey) or three (RGB,
//! interleaved). Every reader yields this layout, whatever the file's own axis order is, so that a volume has the same
//! sums in every format. This room stands on the ground: it knows nothing of masks, stores or distances.

mod decode;
mod discover;
mod error;
mod extent;
mod gather;
#[cfg(test)]
mod hostile;
mod intensity;
mod levels;
mod metaimage;
mod natural;
mod nifti;
mod npy;
mod nrrd;
mod picture;
mod planes;
mod raw;
mod read;
mod samples;
mod shrink;
mod slabs;
mod slices;
mod source;
#[cfg(test)]
mod testing;
mod tiff;
#[allow(clippy::module_inception)]
mod volume;
mod vox;

pub use discover::{Discovery, discover};
pub use error::{ReadError, VolumeError, display_path};
pub use gather::gather;
pub use intensity::{Intensity, IntensityError, Mapping};
pub use natural::natural_cmp;
pub use read::read;
pub use samples::{Endian, SampleType, Samples};
pub use slabs::{Slab, SlabReader};
pub use source::{FileKind, RawLayout, RawTypeError, ReadOptions, Source};
pub use volume::{MIN_SIDE, Shape, Volume};
