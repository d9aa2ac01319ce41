//! [`Shape`]: axis lengths.

/// Axis lengths (Z, Y, X), as numpy writes them: X is fastest in memory.
pub type Shape = [usize; 3];

/// The shortest side that a volume may have: a window of 3 x 3 x 3 voxels must fit.
pub const MIN_SIDE: usize = 3;
