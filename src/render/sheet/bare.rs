//! Bare pictures: the slices of one volume and nothing else, for whoever draws the rest around them.
//!
//! A grey volume gives grey pixels, a colour volume colours. Between slices lies a transparent line, where one is asked
//! for, so that the picture stands on any ground. Voxels are enlarged by whole factors or averaged by whole blocks.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::{Axis, MOST_PIXELS, SheetError};
use crate::volume::Volume;

/// How the slices of one volume become a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bare {
    /// The axis that slices are taken across.
    pub axis: Axis,
    /// Slices in a row; 0 counts as 1.
    pub columns: usize,
    /// The most slices; of a longer axis every n-th is drawn. 0 counts as 1.
    pub slices: usize,
    /// The longest side of a slice in pixels; 0 counts as 1.
    pub slice_pixels: u32,
    /// Whether a transparent line of one pixel lies between slices.
    pub gap: bool,
}

impl Default for Bare {
    /// All slices across Z, eight in a row, a voxel a pixel as far as a picture may be large.
    fn default() -> Self {
        Self { axis: Axis::Z, columns: 8, slices: usize::MAX, slice_pixels: 1024, gap: true }
    }
}

/// Pixels of one picture, row by row from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    width: u32,
    height: u32,
    colour: ExtendedColorType,
    pixels: Vec<u8>,
}

impl Picture {
    /// Width and height in pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// The PNG file of the picture, compressed for speed.
    ///
    /// # Errors
    /// [`SheetError::Encode`], which a picture of this module does not cause.
    pub fn png(&self) -> Result<Vec<u8>, SheetError> {
        let mut bytes = Vec::new();
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Up)
            .write_image(&self.pixels, self.width, self.height, self.colour)
            .map_err(|source| SheetError::Encode { source })?;
        Ok(bytes)
    }
}

/// The slices of a volume in reading order.
///
/// They become smaller, and then fewer, where the picture would have more than [`MOST_PIXELS`] pixels.
///
/// ```
/// use hlacdb::{render::sheet, volume::Volume};
/// let volume = Volume::from_fn([4, 5, 6], |z, _, _| z as u8)?;
/// let picture = sheet::bare(&volume, &sheet::Bare { columns: 2, slice_pixels: 12, ..sheet::Bare::default() });
/// assert_eq!(picture.size(), (2 * 12 + 1, 2 * 10 + 1));
/// # Ok::<(), hlacdb::volume::VolumeError>(())
/// ```
pub fn bare(volume: &Volume, layout: &Bare) -> Picture {
    let length = length(volume, layout.axis);
    let mut count = length.clamp(1, layout.slices.max(1));
    let mut pixels = layout.slice_pixels.max(1);
    let (width, height) = loop {
        let (width, height) = grid(volume, layout, count, pixels);
        if width as u64 * height as u64 <= MOST_PIXELS {
            break (width, height);
        }
        if pixels > 16 { pixels /= 2 } else { count = count.div_ceil(2) }
    };
    let columns = layout.columns.clamp(1, count);
    let gap = usize::from(layout.gap);
    let channels = volume.channels();
    let stride = channels + gap;
    let mut canvas = vec![0; width * height * stride];
    for number in 0..count {
        let slice = Slice::of(volume, layout.axis, number * length / count).scaled(pixels as usize);
        let (left, top) = (number % columns * (slice.width + gap), number / columns * (slice.height + gap));
        for (row, line) in slice.pixels.chunks_exact(slice.width * channels).enumerate() {
            let start = ((top + row) * width + left) * stride;
            let Some(place) = canvas.get_mut(start..start + slice.width * stride) else { continue };
            if gap == 0 {
                place.copy_from_slice(line);
                continue;
            }
            for (pixel, colour) in place.chunks_exact_mut(stride).zip(line.chunks_exact(channels)) {
                let (opaque, alpha) = pixel.split_at_mut(channels);
                opaque.copy_from_slice(colour);
                alpha.fill(u8::MAX);
            }
        }
    }
    picture(width, height, channels, layout.gap, canvas)
}

/// One slice, its longest side at most `pixels` long; `None` where the axis has no such slice.
pub fn slice(volume: &Volume, axis: Axis, index: usize, pixels: u32) -> Option<Picture> {
    if index >= length(volume, axis) {
        return None;
    }
    let slice = Slice::of(volume, axis, index).scaled(pixels.clamp(1, 4096) as usize);
    Some(picture(slice.width, slice.height, volume.channels(), false, slice.pixels))
}

/// The middle slice across Z in a square of `side` pixels, cut to its middle where it is not square itself.
pub fn thumbnail(volume: &Volume, side: u32) -> Picture {
    let side = side.clamp(1, 1024) as usize;
    let middle = Slice::of(volume, Axis::Z, length(volume, Axis::Z) / 2);
    let (edge, channels) = (middle.width.min(middle.height), middle.channels);
    let (left, top) = ((middle.width - edge) / 2, (middle.height - edge) / 2);
    let mut pixels = Vec::with_capacity(side * side * channels);
    // The voxels whose range covers a pixel are averaged; where pixels are smaller than voxels, that is one.
    let range = |at: usize| {
        let start = at * edge / side;
        start..((at + 1) * edge / side).max(start + 1)
    };
    for y in 0..side {
        for x in 0..side {
            let (rows, columns) = (range(y), range(x));
            let count = (rows.len() * columns.len()) as u32;
            for channel in 0..channels {
                let mut sum = 0;
                for row in rows.clone() {
                    for column in columns.clone() {
                        sum += u32::from(middle.at(top + row, left + column, channel));
                    }
                }
                pixels.push(((sum + count / 2) / count) as u8);
            }
        }
    }
    picture(side, side, channels, false, pixels)
}

fn picture(width: usize, height: usize, channels: usize, alpha: bool, pixels: Vec<u8>) -> Picture {
    let colour = match (channels, alpha) {
        (1, false) => ExtendedColorType::L8,
        (1, true) => ExtendedColorType::La8,
        (_, false) => ExtendedColorType::Rgb8,
        (_, true) => ExtendedColorType::Rgba8,
    };
    Picture { width: width as u32, height: height as u32, colour, pixels }
}

/// Slices across an axis.
fn length(volume: &Volume, axis: Axis) -> usize {
    let [z, y, x] = volume.shape();
    match axis {
        Axis::Z => z,
        Axis::Y => y,
        Axis::X => x,
    }
}

/// Width and height of a picture of so many slices of that size.
fn grid(volume: &Volume, layout: &Bare, count: usize, pixels: u32) -> (usize, usize) {
    let [z, y, x] = volume.shape();
    let (rows, columns) = match layout.axis {
        Axis::Z => (y, x),
        Axis::Y => (z, x),
        Axis::X => (z, y),
    };
    let (shrink, enlarge) = factors(rows.max(columns), pixels as usize);
    let gap = usize::from(layout.gap);
    let across = layout.columns.clamp(1, count);
    let side = |count: usize, voxels: usize| {
        count.saturating_mul(voxels.div_ceil(shrink).saturating_mul(enlarge).saturating_add(gap)) - gap
    };
    (side(across, columns), side(count.div_ceil(across), rows))
}

/// The side of the block of voxels that a pixel averages, and of the block of pixels that a voxel becomes. One is 1.
fn factors(longest: usize, pixels: usize) -> (usize, usize) {
    (longest.div_ceil(pixels), (pixels / longest).max(1))
}

/// One slice, channels interleaved.
struct Slice {
    width: usize,
    height: usize,
    channels: usize,
    pixels: Vec<u8>,
}

impl Slice {
    /// The slice as it is, a voxel a pixel.
    fn of(volume: &Volume, axis: Axis, place: usize) -> Self {
        let ([depth, height, width], channels) = (volume.shape(), volume.channels());
        let row = width * channels;
        let plane = height * row;
        let voxels = volume.voxels();
        match axis {
            Axis::Z => {
                let pixels = voxels[place * plane..(place + 1) * plane].to_vec();
                Self { width, height, channels, pixels }
            }
            Axis::Y => {
                let rows = voxels.chunks_exact(plane).map(|plane| &plane[place * row..(place + 1) * row]);
                Self { width, height: depth, channels, pixels: rows.flatten().copied().collect() }
            }
            Axis::X => {
                let at = place * channels..(place + 1) * channels;
                let columns = voxels.chunks_exact(row).map(|row| &row[at.clone()]);
                Self { width: height, height: depth, channels, pixels: columns.flatten().copied().collect() }
            }
        }
    }

    fn at(&self, row: usize, column: usize, channel: usize) -> u8 {
        self.pixels[(row * self.width + column) * self.channels + channel]
    }

    /// The slice with a longest side of at most so many pixels, enlarged where twice or more fits.
    fn scaled(self, pixels: usize) -> Self {
        match factors(self.width.max(self.height), pixels) {
            (1, 1) => self,
            (1, enlarge) => self.enlarged(enlarge),
            (shrink, _) => self.shrunk(shrink),
        }
    }

    fn enlarged(self, by: usize) -> Self {
        let mut pixels = Vec::with_capacity(self.pixels.len() * by * by);
        for line in self.pixels.chunks_exact(self.width * self.channels) {
            let start = pixels.len();
            for colour in line.chunks_exact(self.channels) {
                (0..by).for_each(|_| pixels.extend_from_slice(colour));
            }
            let end = pixels.len();
            (1..by).for_each(|_| pixels.extend_from_within(start..end));
        }
        Self { width: self.width * by, height: self.height * by, channels: self.channels, pixels }
    }

    /// Means of blocks, rounded; blocks at the far borders may be smaller.
    fn shrunk(self, by: usize) -> Self {
        let (width, height) = (self.width.div_ceil(by), self.height.div_ceil(by));
        let mut pixels = Vec::with_capacity(width * height * self.channels);
        for y in 0..height {
            for x in 0..width {
                let rows = y * by..((y + 1) * by).min(self.height);
                let columns = x * by..((x + 1) * by).min(self.width);
                let count = (rows.len() * columns.len()) as u64;
                for channel in 0..self.channels {
                    let mut sum = 0;
                    for row in rows.clone() {
                        sum += columns.clone().map(|column| u64::from(self.at(row, column, channel))).sum::<u64>();
                    }
                    pixels.push(((2 * sum + count) / (2 * count)) as u8);
                }
            }
        }
        Self { width, height, channels: self.channels, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbered() -> Volume {
        Volume::from_fn([3, 4, 5], |z, y, x| (z * 36 + y * 6 + x) as u8).unwrap()
    }

    #[test]
    fn a_slice_is_the_plane_at_that_place() {
        let volume = numbered();
        for (axis, size, at) in
            [(Axis::Z, (5, 4), [2, 1, 3]), (Axis::Y, (5, 3), [1, 2, 3]), (Axis::X, (4, 3), [1, 3, 2])]
        {
            let picture = slice(&volume, axis, 2, 5).unwrap();
            assert_eq!(picture.size(), size, "{axis}");
            let [z, y, x] = at;
            let (row, column) = match axis {
                Axis::Z => (y, x),
                Axis::Y => (z, x),
                Axis::X => (z, y),
            };
            assert_eq!(picture.pixels[row * size.0 as usize + column], (z * 36 + y * 6 + x) as u8, "{axis}");
        }
        assert!(slice(&volume, Axis::Z, 3, 5).is_none());
    }

    #[test]
    fn slices_are_enlarged_by_whole_factors_and_averaged_by_whole_blocks() {
        let volume = numbered();
        let enlarged = slice(&volume, Axis::Z, 0, 10).unwrap();
        assert_eq!((enlarged.size(), &enlarged.pixels[..4]), ((10, 8), &[0, 0, 1, 1][..]));
        assert_eq!(enlarged.pixels[..10], enlarged.pixels[10..20]);
        let shrunk = slice(&volume, Axis::Z, 0, 3).unwrap();
        // 0, 1, 6, 7 have the mean 3.5, which is rounded up; the last column is a block of one voxel's width.
        assert_eq!((shrunk.size(), &shrunk.pixels[..3]), ((3, 2), &[4, 6, 7][..]));
    }

    #[test]
    fn between_slices_the_ground_shows() {
        let layout = Bare { columns: 2, slice_pixels: 5, ..Bare::default() };
        let picture = bare(&numbered(), &layout);
        assert_eq!((picture.size(), picture.colour), ((11, 9), ExtendedColorType::La8));
        let alpha: Vec<u8> = picture.pixels.chunks_exact(2).take(11).map(|pixel| pixel[1]).collect();
        assert_eq!(alpha, [255, 255, 255, 255, 255, 0, 255, 255, 255, 255, 255]);
        assert_eq!(picture.pixels[2 * 6], 36, "the second slice begins behind the gap");
        let tight = bare(&numbered(), &Bare { gap: false, ..layout });
        assert_eq!((tight.size(), tight.colour), ((10, 8), ExtendedColorType::L8));
        let decoded = image::load_from_memory(&tight.png().unwrap()).unwrap().into_luma8();
        assert_eq!(decoded.into_raw(), tight.pixels);
    }

    #[test]
    fn colours_stay_and_a_thumbnail_is_square() {
        let voxels = (0..3 * 4 * 6 * 3).map(|at| (at % 251) as u8).collect();
        let volume = Volume::new([3, 4, 6], 3, voxels).unwrap();
        let picture = thumbnail(&volume, 4);
        assert_eq!((picture.size(), picture.colour), ((4, 4), ExtendedColorType::Rgb8));
        let first = 4 * 6 * 3 + 3;
        assert_eq!(picture.pixels[..3], volume.voxels()[first..first + 3], "the square is cut from the middle");
        assert_eq!(thumbnail(&volume, 2).pixels.len(), 12);
    }

    #[test]
    fn a_picture_never_grows_too_large() {
        let long = Volume::new([70_000, 3, 3], 1, vec![9; 70_000 * 9]).unwrap();
        let picture = bare(&long, &Bare { slice_pixels: 64, ..Bare::default() });
        let (width, height) = picture.size();
        assert!(u64::from(width) * u64::from(height) <= MOST_PIXELS);
    }
}
