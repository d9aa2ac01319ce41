//! [`Axes`]: the shape of a volume, and where in a file its samples lie.

use crate::samples::within_limit;
use crate::{MIN_SIDE, Shape, VolumeError};

/// An axis of an array in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Axis {
    /// The number of samples along the axis.
    pub(crate) length: u64,
    /// The distance from one sample to the next along the axis, in samples.
    pub(crate) stride: u128,
}

/// The axes of a dense array by their lengths, the fastest axis first.
pub(crate) fn dense(fastest_first: impl IntoIterator<Item = u64>) -> Vec<Axis> {
    let mut stride = 1_u128;
    let axis = |length| {
        let axis = Axis { length, stride };
        stride = stride.saturating_mul(u128::from(length));
        axis
    };
    fastest_first.into_iter().map(axis).collect()
}

/// The axes of a volume in a file: the lengths and strides (in samples) of Z, Y, X and the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Axes {
    pub(crate) shape: Shape,
    pub(crate) channels: usize,
    pub(crate) strides: [usize; 4],
}

impl Axes {
    /// More voxels than any machine holds. Below this, no product of lengths, channels and sample size overflows.
    const MOST: u64 = 1 << 56;

    /// The axes of a volume in an array without names of axes: (Z, Y, X) or (Z, Y, X, colour). The last of four axes is the
    /// colour axis if its length is 3 or 4; axes of length 1 are left out if that makes the difference.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(crate) fn of_array(found: &[Axis], limit: u64) -> Result<Self, VolumeError> {
        let colour = |axes: &[Axis]| axes.len() == 4 && matches!(axes[3].length, 3 | 4);
        let long: Vec<Axis> = found.iter().copied().filter(|axis| axis.length != 1).collect();
        let coloured = [found, &long].into_iter().find(|axes| colour(axes));
        match coloured.and_then(<[Axis]>::split_last) {
            Some((channel, space)) => Self::new(space, Some(*channel), limit),
            None => Self::new(found, None, limit),
        }
    }

    /// The axes of a volume by its axes of space, in the order (Z, Y, X), and its colour axis. Of more than three axes of
    /// space, those of length 1 are left out.
    ///
    /// # Errors
    /// [`VolumeError::Dimensions`], [`VolumeError::TooSmall`], [`VolumeError::TooLarge`], and [`VolumeError::Channels`]
    /// for a colour axis of another length than 1, 3 and 4.
    pub(crate) fn new(space: &[Axis], channel: Option<Axis>, limit: u64) -> Result<Self, VolumeError> {
        let found = || space.iter().chain(&channel).map(|axis| axis.length).collect();
        let dimensions = || VolumeError::Dimensions { found: found() };
        let mut axes = space.to_vec();
        if axes.len() > 3 {
            axes.retain(|axis| axis.length != 1);
        }
        let [z, y, x] = <[Axis; 3]>::try_from(axes).map_err(|_| dimensions())?;
        within_limit([z, y, x].map(|axis| axis.length.into()), limit.min(Self::MOST))?;
        let fits = |number: u128| usize::try_from(number).map_err(|_| dimensions());
        let shape = [fits(z.length.into())?, fits(y.length.into())?, fits(x.length.into())?];
        if shape.iter().any(|&side| side < MIN_SIDE) {
            return Err(VolumeError::TooSmall { shape });
        }
        let channel = channel.unwrap_or(Axis { length: 1, stride: 1 });
        if !matches!(channel.length, 1 | 3 | 4) {
            return Err(VolumeError::Channels { found: channel.length });
        }
        let strides = [fits(z.stride)?, fits(y.stride)?, fits(x.stride)?, fits(channel.stride)?];
        Ok(Self { shape, channels: channel.length as usize, strides })
    }

    /// The same axes of space in a file whose voxels are `channels` samples side by side.
    pub(crate) fn interleaved(self, channels: usize) -> Self {
        let strides = self.strides.map(|stride| stride * channels);
        Self { shape: self.shape, channels, strides: [strides[0], strides[1], strides[2], 1] }
    }

    /// The number of samples.
    pub(crate) fn count(&self) -> u64 {
        self.shape.iter().chain([&self.channels]).map(|&length| length as u64).product()
    }

    /// Whether every Z-plane is one run of the file's samples, and the planes follow one another.
    pub(crate) fn planes_in_order(&self) -> bool {
        let [_, height, width] = self.shape;
        self.strides[0] == height * width * self.channels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: u64 = 1 << 32;

    fn c_order(lengths: &[u64]) -> Vec<Axis> {
        let mut axes = dense(lengths.iter().rev().copied());
        axes.reverse();
        axes
    }

    #[test]
    fn a_volume_has_three_axes_or_four_with_colour() {
        for (lengths, shape, channels) in [
            (&[5, 7, 9][..], [5, 7, 9], 1),
            (&[5, 7, 3], [5, 7, 3], 1),
            (&[5, 7, 9, 3], [5, 7, 9], 3),
            (&[5, 7, 9, 4], [5, 7, 9], 4),
            (&[1, 5, 7, 9], [5, 7, 9], 1),
            (&[5, 7, 9, 1], [5, 7, 9], 1),
            (&[1, 5, 7, 9, 1, 3], [5, 7, 9], 3),
            (&[5, 7, 9, 3, 1], [5, 7, 9], 3),
        ] {
            let axes = Axes::of_array(&c_order(lengths), LIMIT).unwrap();
            assert_eq!((axes.shape, axes.channels), (shape, channels), "{lengths:?}");
        }
    }

    #[test]
    fn other_axes_are_refused() {
        for lengths in [&[][..], &[5], &[7, 9], &[5, 7, 9, 2], &[5, 7, 9, 5], &[1, 1, 7, 9], &[3, 5, 7, 9], &[4; 5]] {
            let error = Axes::of_array(&c_order(lengths), LIMIT).unwrap_err();
            assert!(matches!(&error, VolumeError::Dimensions { found } if found == lengths), "{lengths:?} {error}");
        }
        for lengths in [&[0, 7, 9][..], &[5, 2, 9], &[1, 20, 30, 3], &[0, u64::MAX, u64::MAX]] {
            assert!(
                matches!(Axes::of_array(&c_order(lengths), LIMIT), Err(VolumeError::TooSmall { .. })),
                "{lengths:?}"
            );
        }
        for lengths in [[1 << 12, 1 << 12, (1 << 8) + 1], [u64::MAX; 3], [3, 3, 1 << 62]] {
            assert!(matches!(Axes::of_array(&c_order(&lengths), LIMIT), Err(VolumeError::TooLarge { .. })));
            // What would overflow is refused whatever the limit.
            let unlimited = Axes::of_array(&c_order(&lengths), u64::MAX);
            assert!(unlimited.is_err() || unlimited.unwrap().interleaved(4).shape[0] == 1 << 12);
        }
    }
}
