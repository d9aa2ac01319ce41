//! [`Stack`]: the pages of a TIFF file that are slices, and where they are.

use std::io::{Read, Seek};

use super::directory::{DESCRIPTION, Directory, Walker, malformed};
use super::imagej::Description;
use super::ome::Pixels;
use super::page::{Page, STRIP_BYTES, STRIP_OFFSETS, X_RESOLUTION, Y_RESOLUTION};
use crate::formats::plane_format::PlaneFormat;
use crate::{Endian, ReadOptions, Shape, VolumeError, VoxelSpacing};

/// Equal pages, checked.
pub(super) struct Stack {
    /// The first page; the others have its format.
    pub(super) page: Page,
    /// For every directory, whether it is a slice.
    pub(super) slices: Vec<bool>,
    /// The number of slices.
    pub(super) planes: u64,
    /// Where the planes are, one after the other, if not in directories of their own.
    pub(super) contiguous: Option<(u64, Endian)>,
    pub(super) spacing: Option<VoxelSpacing>,
    /// Bytes of the file.
    pub(super) length: u64,
}

impl Stack {
    /// Reads the directories, nothing else.
    pub(super) fn scan(reader: &mut (impl Read + Seek)) -> Result<Self, VolumeError> {
        let mut walker = Walker::new(reader)?;
        let mut first: Option<(Page, Directory)> = None;
        let mut slices = Vec::new();
        while let Some(directory) = walker.next_directory()? {
            let page = Page::of(&mut walker, &directory)?;
            slices.push(page.is_some());
            match (page, &first) {
                (None, _) => {}
                (Some(page), None) => first = Some((page, directory)),
                (Some(page), Some((expected, _))) if page.format != expected.format => {
                    return Err(VolumeError::MixedSlices {
                        slice: format!("page {} of the TIFF file", slices.len()),
                        found: page.format.to_string(),
                        first: "the first".into(),
                        expected: expected.format.to_string(),
                    });
                }
                _ => {}
            }
        }
        let (page, directory) =
            first.ok_or_else(|| malformed("the TIFF file has no page", "a volume has at least 3"))?;
        let planes = slices.iter().filter(|&&slice| slice).count() as u64;
        let mut stack = Self { page, slices, planes, contiguous: None, spacing: None, length: walker.length };
        let text = description(&mut walker, &directory)?;
        if let Some(text) = Description::parse(&text) {
            stack.follow_imagej(&mut walker, &directory, text)?;
        } else if let Some(pixels) = Pixels::parse(&text) {
            stack.follow_ome(&pixels)?;
        }
        Ok(stack)
    }

    /// Applies the description of a microscope.
    fn follow_ome(&mut self, pixels: &Pixels) -> Result<(), VolumeError> {
        if self.planes > 1 && pixels.is_hyperstack(self.page.format.channels) {
            let Pixels { images, channels, slices, frames, .. } = pixels;
            let what =
                format!("an OME-TIFF of {images} images of {channels} channels, {slices} slices and {frames} frames");
            return Err(VolumeError::SeveralVolumes { what });
        }
        self.spacing = pixels.spacing;
        Ok(())
    }

    /// Applies the description of ImageJ.
    fn follow_imagej<R: Read + Seek>(
        &mut self,
        walker: &mut Walker<'_, R>,
        directory: &Directory,
        text: Description,
    ) -> Result<(), VolumeError> {
        if text.is_hyperstack() {
            let [channels, slices, frames] = [text.channels, text.slices, text.frames];
            let what = format!("an ImageJ hyperstack of {channels} channels, {slices} slices and {frames} frames");
            return Err(VolumeError::SeveralVolumes { what });
        }
        let resolution = [walker.fraction(directory, Y_RESOLUTION)?, walker.fraction(directory, X_RESOLUTION)?];
        if let ([Some(y), Some(x)], Some(z)) = (resolution, text.spacing) {
            self.spacing = VoxelSpacing::new([z, 1.0 / y, 1.0 / x]).map(|spacing| spacing.unit(text.unit));
        }
        if self.planes == 1 && text.images > 1 {
            let first = self.first_plane(walker, directory)?;
            let end = u128::from(text.images) * self.page.format.bytes() + u128::from(first);
            if end > u128::from(self.length) {
                let expected = u64::try_from(end).unwrap_or(u64::MAX);
                return Err(VolumeError::Truncated { expected, found: self.length });
            }
            self.contiguous = Some((first, walker.header.endian));
            self.planes = text.images;
        }
        Ok(())
    }

    /// Where the planes of a stack with a single directory begin.
    fn first_plane<R: Read + Seek>(
        &self,
        walker: &mut Walker<'_, R>,
        directory: &Directory,
    ) -> Result<u64, VolumeError> {
        let offsets = walker.numbers(directory, STRIP_OFFSETS)?.unwrap_or_default();
        let bytes = walker.numbers(directory, STRIP_BYTES)?.unwrap_or_default();
        let joined = offsets.iter().zip(&bytes).zip(offsets.iter().skip(1));
        let gapless = joined.into_iter().all(|((offset, bytes), next)| offset.checked_add(*bytes) == Some(*next));
        match offsets.first() {
            Some(&offset) if gapless && self.page.plain && !self.page.planar && !self.page.bilevel => Ok(offset),
            _ => Err(malformed(
                "the ImageJ description promises planes behind the first page, which is compressed or in pieces",
                "such planes are uncompressed and follow one another",
            )),
        }
    }

    /// Checks that the slices are a volume within the limit.
    pub(super) fn check(&self, options: &ReadOptions) -> Result<(), VolumeError> {
        let PlaneFormat { height, width, .. } = self.page.format;
        if self.planes == 1 {
            return Err(VolumeError::Dimensions { found: vec![height as u64, width as u64] });
        }
        self.page.format.within(self.planes, options.max_voxels)
    }

    pub(super) fn shape(&self) -> Shape {
        [self.planes as usize, self.page.format.height, self.page.format.width]
    }
}

/// The description of a page, empty if it has none.
fn description<R: Read + Seek>(walker: &mut Walker<'_, R>, directory: &Directory) -> Result<String, VolumeError> {
    Ok(walker.text(directory, DESCRIPTION)?.unwrap_or_default())
}
