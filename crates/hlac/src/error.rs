//! [`ExtractError`].

/// Why there are no sums. [`ExtractError::hint`] says what to do about it, where there is something.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractError {
    /// No window of this spacing fits the volume.
    #[error(
        "the volume is {} x {} x {} (Z, Y, X), but windows of spacing {spacing} need at least {needed} voxels on every side",
        shape[0], shape[1], shape[2]
    )]
    TooSmall {
        /// The volume's shape (Z, Y, X).
        shape: [usize; 3],
        /// How far apart the cells of a window are, in voxels.
        spacing: usize,
        /// The shortest side that holds a window.
        needed: usize,
    },
    /// The number of voxels does not fit a `usize`, or that of windows exceeds 2^40, beyond which sums may overflow.
    #[error("a volume of {} x {} x {} voxels (Z, Y, X) is too large", shape[0], shape[1], shape[2])]
    TooLarge {
        /// The volume's shape (Z, Y, X).
        shape: [usize; 3],
    },
    /// The slice does not hold the voxels of the shape.
    #[error(
        "the slice holds {found} voxels, but a volume of {} x {} x {} (Z, Y, X) has {expected}",
        shape[0], shape[1], shape[2]
    )]
    Length {
        /// The shape given (Z, Y, X).
        shape: [usize; 3],
        /// The number of voxels of that shape.
        expected: usize,
        /// The length of the slice.
        found: usize,
    },
    /// The region and the volume differ in shape.
    #[error(
        "the region is {} x {} x {} (Z, Y, X), but the volume is {} x {} x {}",
        region[0], region[1], region[2], volume[0], volume[1], volume[2]
    )]
    RegionShape {
        /// The volume's shape (Z, Y, X).
        volume: [usize; 3],
        /// The region's shape (Z, Y, X).
        region: [usize; 3],
    },
    /// More random windows were requested than the volume has.
    #[error("{requested} random windows were requested, but the volume has only {available}")]
    TooManyWindows {
        /// The number of windows requested.
        requested: u64,
        /// The number of windows of the volume.
        available: u64,
    },
    /// The planes pushed are not whole, or too many or too few for the volume.
    #[error(
        "{found} voxels were given in slabs, but whole planes of a volume of {} x {} x {} (Z, Y, X) end at {expected}",
        shape[0], shape[1], shape[2]
    )]
    Planes {
        /// The volume's shape (Z, Y, X).
        shape: [usize; 3],
        /// Where the next whole plane, or the volume, ends, in voxels.
        expected: u64,
        /// The number of voxels pushed so far, with those of the failed call.
        found: u64,
    },
}

impl ExtractError {
    /// What the caller can do, to follow the error's sentence after a colon; `None` if there is no general advice.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::TooSmall { spacing: 2.., .. } => Some("take a smaller spacing"),
            Self::RegionShape { .. } => Some("a region has the shape of its volume"),
            Self::TooManyWindows { .. } => Some("take fewer, or all of them, which is exact and cheaper"),
            Self::Planes { .. } => Some("push every Z-plane once, in order and whole"),
            _ => None,
        }
    }
}
