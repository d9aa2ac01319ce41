//! From a [`Volume`] to the sums of its views: [`hlac`] takes grey voxels, so colour is described by its luma.

use hlac::{OctantSums, View, Voxels};
use hlacdb_volume::Volume;

/// The exact octant sums of several views of a volume (of its luma, if it has colour), in the given order.
///
/// Views that the volume is too small for are left out. See [`hlac::describe`].
///
/// ```
/// use hlacdb::{hlac::View, volume::Volume};
///
/// let volume = Volume::from_fn([9, 10, 11], |z, y, x| (20 * z + 5 * y + x) as u8)?;
/// let described = hlacdb::describe(&volume, &[View::Full, View::Detail]);
/// assert_eq!(described[0].1, hlacdb::octant_sums(&volume));
/// # Ok::<(), hlacdb::volume::VolumeError>(())
/// ```
pub fn describe(volume: &Volume, views: &[View]) -> Vec<(View, OctantSums)> {
    hlac::describe(voxels(&volume.luma()), views)
}

/// The exact octant sums of a volume (of its luma, if it has colour): those of the view `full@1`.
pub fn octant_sums(volume: &Volume) -> OctantSums {
    hlac::extract(voxels(&volume.luma()))
}

/// The voxels of a grey volume.
fn voxels(grey: &Volume) -> Voxels<'_> {
    match Voxels::new(grey.voxels(), grey.shape()) {
        Ok(voxels) => voxels,
        Err(error) => unreachable!("a grey volume has sides of at least 3 and one byte per voxel: {error}"),
    }
}
