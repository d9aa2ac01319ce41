//! Slices of one volume and nothing else, for callers that draw the rest around them.
//!
//! A grey volume gives grey pixels, a colour volume coloured ones.

use super::slice_grid::{GridRequest, SliceGrid, SliceScale, slice_means};
use super::{Image, MAX_PIXELS, PixelFormat, SliceAxis};
use crate::volume::Volume;

/// How the slices of one volume become a picture. The default shows all slices across Z, eight in a row, one pixel per
/// voxel up to 1024 pixels, with a gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct SliceImageOptions {
    /// The axis that slices are taken across.
    pub axis: SliceAxis,
    /// Slices in a row; 0 counts as 1.
    pub columns: usize,
    /// The most slices; of a longer axis every n-th is drawn. 0 counts as 1.
    pub slices: usize,
    /// The longest side of a slice in pixels; 0 counts as 1.
    pub slice_pixels: u32,
    /// Whether a transparent line of one pixel separates slices.
    pub gap: bool,
}

impl Default for SliceImageOptions {
    fn default() -> Self {
        Self { axis: SliceAxis::Z, columns: 8, slices: usize::MAX, slice_pixels: 1024, gap: true }
    }
}

impl SliceImageOptions {
    /// The default options.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes slices across this axis.
    #[must_use]
    pub fn axis(self, axis: SliceAxis) -> Self {
        Self { axis, ..self }
    }

    /// Draws at most so many slices in a row.
    #[must_use]
    pub fn columns(self, columns: usize) -> Self {
        Self { columns, ..self }
    }

    /// Draws at most so many slices.
    #[must_use]
    pub fn slices(self, slices: usize) -> Self {
        Self { slices, ..self }
    }

    /// Draws slices with no side longer than this.
    #[must_use]
    pub fn slice_pixels(self, slice_pixels: u32) -> Self {
        Self { slice_pixels, ..self }
    }

    /// Separates slices by a transparent line, or not.
    #[must_use]
    pub fn gap(self, gap: bool) -> Self {
        Self { gap, ..self }
    }
}

/// The slices of a volume in reading order.
///
/// Slices become smaller, and then fewer, where the picture would have more than [`MAX_PIXELS`] pixels.
///
/// ```
/// use hlacdb::{render::{SliceImageOptions, slice_image}, volume::Volume};
/// let volume = Volume::from_fn([4, 5, 6], |z, _, _| z as u8)?;
/// let image = slice_image(&volume, &SliceImageOptions::new().columns(2).slice_pixels(12));
/// assert_eq!(image.size(), (2 * 12 + 1, 2 * 10 + 1));
/// # Ok::<(), hlacdb::volume::VolumeError>(())
/// ```
pub fn slice_image(volume: &Volume, options: &SliceImageOptions) -> Image {
    let grid = fitting_grid(volume, options);
    let (width, height) = grid.size();
    let format = PixelFormat::new(volume.channels(), options.gap);
    let (channels, bytes) = (volume.channels(), format.bytes());
    let mut canvas = vec![0; width * height * bytes];
    let (slice_width, _) = grid.slice_size();
    for number in 0..grid.count() {
        let (left, top) = grid.position(number);
        for (row, line) in grid.pixels(volume, number).chunks_exact(slice_width * channels).enumerate() {
            let start = ((top + row) * width + left) * bytes;
            let Some(target) = canvas.get_mut(start..start + slice_width * bytes) else { continue };
            for (pixel, voxel) in target.chunks_exact_mut(bytes).zip(line.chunks_exact(channels)) {
                let (color, alpha) = pixel.split_at_mut(channels);
                color.copy_from_slice(voxel);
                alpha.fill(u8::MAX);
            }
        }
    }
    Image::new(width as u32, height as u32, format, canvas)
}

/// The grid of slices, made smaller and then shorter until the picture is small enough.
fn fitting_grid(volume: &Volume, options: &SliceImageOptions) -> SliceGrid {
    let &SliceImageOptions { axis, columns, slices, slice_pixels, gap } = options;
    let mut request = GridRequest {
        axis,
        columns,
        slices: slices.clamp(1, axis.slices(volume.shape())),
        pixels: slice_pixels.max(1),
        gap: usize::from(gap),
        border: 0,
    };
    loop {
        let grid = SliceGrid::new(volume.shape(), &request);
        let (width, height) = grid.size();
        if width as u64 * height as u64 <= MAX_PIXELS {
            return grid;
        }
        if request.pixels > 16 {
            request.pixels /= 2;
        } else {
            request.slices = request.slices.div_ceil(2);
        }
    }
}

/// One slice, its longest side at most `pixels` (taken as 1 to 4096) long; `None` where the volume has no such slice.
pub fn slice(volume: &Volume, axis: SliceAxis, index: usize, pixels: u32) -> Option<Image> {
    if index >= axis.slices(volume.shape()) {
        return None;
    }
    let [rows, columns] = axis.slice_shape(volume.shape());
    let scale = SliceScale::new([rows, columns], pixels.clamp(1, 4096));
    let (width, height) = (scale.pixels(columns) as u32, scale.pixels(rows) as u32);
    let format = PixelFormat::new(volume.channels(), false);
    Some(Image::new(width, height, format, scale.slice(volume, axis, index)))
}

/// The middle slice across Z as a square of `side` pixels (taken as 1 to 1024): the middle of the slice where it is not
/// square itself.
pub fn thumbnail(volume: &Volume, side: u32) -> Image {
    let side = side.clamp(1, 1024);
    let (axis, [height, width]) = (SliceAxis::Z, SliceAxis::Z.slice_shape(volume.shape()));
    let edge = height.min(width);
    // A pixel shows the voxels that it covers; where pixels are smaller than voxels, that is one voxel.
    let ranges = |first: usize| -> Vec<std::ops::Range<usize>> {
        let at = |pixel: usize| pixel * edge / side as usize;
        (0..side as usize).map(|pixel| first + at(pixel)..first + at(pixel + 1).max(at(pixel) + 1)).collect()
    };
    let (rows, columns) = (ranges((height - edge) / 2), ranges((width - edge) / 2));
    let pixels = slice_means(volume, axis, axis.slices(volume.shape()) / 2, &rows, &columns);
    Image::new(side, side, PixelFormat::new(volume.channels(), false), pixels)
}

#[cfg(test)]
mod tests {
    use super::super::PngEffort;
    use super::*;

    fn numbered() -> Volume {
        Volume::from_fn([3, 4, 5], |z, y, x| (z * 36 + y * 6 + x) as u8).unwrap()
    }

    #[test]
    fn a_slice_shows_the_plane_at_its_index() {
        let volume = numbered();
        for (axis, size, at) in
            [(SliceAxis::Z, (5, 4), [2, 1, 3]), (SliceAxis::Y, (5, 3), [1, 2, 3]), (SliceAxis::X, (4, 3), [1, 3, 2])]
        {
            let picture = slice(&volume, axis, 2, 5).unwrap();
            assert_eq!(picture.size(), size, "{axis}");
            let [z, y, x] = at;
            let (row, column) = match axis {
                SliceAxis::Z => (y, x),
                SliceAxis::Y => (z, x),
                SliceAxis::X => (z, y),
            };
            assert_eq!(picture.pixels()[row * size.0 as usize + column], (z * 36 + y * 6 + x) as u8, "{axis}");
        }
        assert!(slice(&volume, SliceAxis::Z, 3, 5).is_none());
    }

    #[test]
    fn slices_are_enlarged_by_whole_factors_and_averaged_by_whole_blocks() {
        let volume = numbered();
        let enlarged = slice(&volume, SliceAxis::Z, 0, 10).unwrap();
        assert_eq!((enlarged.size(), &enlarged.pixels()[..4]), ((10, 8), &[0, 0, 1, 1][..]));
        assert_eq!(enlarged.pixels()[..10], enlarged.pixels()[10..20]);
        let shrunk = slice(&volume, SliceAxis::Z, 0, 3).unwrap();
        // 0, 1, 6, 7 have the mean 3.5, which is rounded up; the last column is a block of one voxel's width.
        assert_eq!((shrunk.size(), &shrunk.pixels()[..3]), ((3, 2), &[4, 6, 7][..]));
    }

    #[test]
    fn the_gap_between_slices_is_transparent() {
        let options = SliceImageOptions::new().columns(2).slice_pixels(5);
        let picture = slice_image(&numbered(), &options);
        assert_eq!((picture.size(), picture.format()), ((11, 9), PixelFormat::GrayAlpha));
        let alpha: Vec<u8> = picture.pixels().chunks_exact(2).take(11).map(|pixel| pixel[1]).collect();
        assert_eq!(alpha, [255, 255, 255, 255, 255, 0, 255, 255, 255, 255, 255]);
        assert_eq!(picture.pixels()[2 * 6], 36, "the second slice begins behind the gap");
        let tight = slice_image(&numbered(), &options.gap(false));
        assert_eq!((tight.size(), tight.format()), ((10, 8), PixelFormat::Gray));
        let decoded = ::image::load_from_memory(&tight.encode_png(PngEffort::Fast).unwrap()).unwrap().into_luma8();
        assert_eq!(decoded.into_raw(), tight.pixels());
    }

    #[test]
    fn a_thumbnail_is_square_and_keeps_colours() {
        let voxels = (0..3 * 4 * 6 * 3).map(|at| (at % 251) as u8).collect();
        let volume = Volume::new([3, 4, 6], 3, voxels).unwrap();
        let picture = thumbnail(&volume, 4);
        assert_eq!((picture.size(), picture.format()), ((4, 4), PixelFormat::Rgb));
        let first = 4 * 6 * 3 + 3;
        assert_eq!(picture.pixels()[..3], volume.voxels()[first..first + 3], "the square is cut from the middle");
        assert_eq!(thumbnail(&volume, 2).pixels().len(), 12);
    }

    #[test]
    fn a_picture_has_at_most_max_pixels() {
        let long = Volume::new([70_000, 3, 3], 1, vec![9; 70_000 * 9]).unwrap();
        let picture = slice_image(&long, &SliceImageOptions::new().slice_pixels(64));
        let (width, height) = picture.size();
        assert!(u64::from(width) * u64::from(height) <= MAX_PIXELS);
    }
}
