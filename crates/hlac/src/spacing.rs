//! [`MaskSpacing`].

/// How far apart the cells of a window are, in voxels: the window is a cube of 3, 5 or 9 voxels a side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MaskSpacing {
    /// Neighbouring voxels: the paper's windows.
    #[default]
    One,
    /// Every second voxel.
    Two,
    /// Every fourth voxel.
    Four,
}

impl MaskSpacing {
    /// All spacings, ascending.
    pub const ALL: [Self; 3] = [Self::One, Self::Two, Self::Four];

    /// 1, 2 or 4.
    pub const fn voxels(self) -> usize {
        match self {
            Self::One => 1,
            Self::Two => 2,
            Self::Four => 4,
        }
    }

    /// The number of windows of a volume of `shape` (Z, Y, X): `(Z-2s)(Y-2s)(X-2s)` for a spacing of `s`, 0 where none
    /// fits. Saturates.
    pub fn windows(self, shape: [usize; 3]) -> u64 {
        let sides = shape.map(|side| side.saturating_sub(2 * self.voxels()) as u64);
        sides.iter().fold(1, |windows: u64, &side| windows.saturating_mul(side))
    }
}
