//! Multi-page TIFF files: every page is a slice, in the order of the file.
//!
//! Strips and tiles are unpacked by the `tiff` crate. What it is given to unpack has been checked here before
//! (`page.rs`), because it believes what a directory says: sizes, types and the number of strips are sound, the number of
//! voxels is within the limit, and the file has bytes enough for what it promises.
//!
//! Read are grey, RGB and RGBA pages (the alpha is dropped), channels interleaved or in planes, 8 to 64-bit integers and
//! 16 to 64-bit floating point, single bits as 0 and 255, either byte order, BigTIFF, uncompressed or packed by deflate,
//! LZW or PackBits. Decisions where the format leaves room:
//! - pages that say "0 is white" are turned over (`max - v`), so that bright is large; only unsigned samples have a white;
//! - thumbnails and masks among the pages are passed over;
//! - a palette, CMYK, YCbCr and JPEG are refused: their numbers are no intensities, or not the ones that were measured;
//! - the orientation tag is ignored, as by every program that takes a page for an array.
//!
//! The first page's description is heeded where it is ImageJ's (`imagej.rs`), which may promise further planes behind a
//! single page, or a microscope's (`ome.rs`): both tell the distances of voxels, and whether the pages are channels or
//! moments instead of slices, which no volume can hold.

mod directory;
mod imagej;
mod ome;
mod page;

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use ::tiff::decoder::{Decoder, Limits};

use self::directory::{Directory, Header, Walker, malformed};
use self::imagej::Description;
use self::ome::Pixels;
use self::page::{DESCRIPTION, Page, STRIP_BYTES, STRIP_OFFSETS, X_RESOLUTION, Y_RESOLUTION};
use super::picture::Format;
use super::samples::{Endian, Samples};
use super::{FileKind, ReadOptions, Shape, Source, Volume, VolumeError, decode};

/// Whether a file that begins so is a TIFF file.
pub(super) fn sniff(head: &[u8]) -> bool {
    Header::sniff(head)
}

/// The volume in a TIFF file of several pages.
pub(super) fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    read_from(&mut open(path)?, options)
}

/// Whether a file is a TIFF of one page and no more, and so may be a slice: its first directory is read, no other.
pub(super) fn is_single_page(path: &Path) -> bool {
    let single = || -> Result<bool, VolumeError> {
        let mut reader = open(path)?;
        let mut walker = Walker::new(&mut reader)?;
        let Some(directory) = walker.next_directory()? else { return Ok(false) };
        Ok(!walker.more()
            && Description::parse(&description(&mut walker, &directory)?).is_none_or(|text| text.images == 1))
    };
    single().unwrap_or(false)
}

/// A TIFF file of one page, opened: its format is known, its samples are not read yet.
pub(super) struct SinglePage {
    reader: BufReader<File>,
    stack: Stack,
}

impl SinglePage {
    pub(super) fn open(path: &Path) -> Result<Self, VolumeError> {
        let mut reader = open(path)?;
        let stack = Stack::scan(&mut reader)?;
        if stack.planes != 1 {
            return Err(malformed(&format!("the slice has {} pages", stack.planes), "the slices of a folder have one"));
        }
        Ok(Self { reader, stack })
    }

    pub(super) fn format(&self) -> Format {
        self.stack.page.format
    }

    /// Appends the samples in the byte order of this machine.
    pub(super) fn decode(mut self, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        self.stack.decode(&mut self.reader, bytes)
    }
}

/// A TIFF file of several pages, read page by page.
pub(super) struct Pages {
    file: File,
    stack: Stack,
    /// Where the pages are directories of their own: what unpacks them, and which directory comes next.
    unpacking: Option<(Decoder<BufReader<File>>, usize)>,
    /// How many slices have been read.
    read: u64,
}

impl Pages {
    /// Reads the directories and checks them, nothing else.
    pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Self, VolumeError> {
        let file = decode::open(path)?;
        let stack = Stack::scan(&mut BufReader::new(&file))?;
        stack.check(options)?;
        Ok(Self { file, stack, unpacking: None, read: 0 })
    }

    pub(super) fn shape(&self) -> Shape {
        self.stack.shape()
    }

    pub(super) fn format(&self) -> Format {
        self.stack.page.format
    }

    pub(super) fn spacing(&self) -> Option<[f64; 3]> {
        self.stack.spacing
    }

    /// Goes back to the first page.
    pub(super) fn rewind(&mut self) {
        self.unpacking = None;
        self.read = 0;
    }

    /// Appends the samples of the next `count` slices in the byte order of this machine.
    pub(super) fn next(&mut self, count: usize, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        let end = self.stack.planes.min(self.read.saturating_add(count as u64));
        if self.stack.contiguous.is_some() {
            self.stack.decode_contiguous(&mut BufReader::new(&self.file), self.read..end, bytes)?;
            self.read = end;
            return Ok(());
        }
        let (mut decoder, mut index) = match self.unpacking.take() {
            Some(unpacking) => unpacking,
            None => {
                let again = |source| VolumeError::Io { doing: "opening the file", source };
                (self.stack.decoder(BufReader::new(self.file.try_clone().map_err(again)?))?, 0)
            }
        };
        while self.read < end && index < self.stack.slices.len() {
            self.read += u64::from(self.stack.decode_directory(&mut decoder, index, bytes)?);
            index += 1;
        }
        self.unpacking = Some((decoder, index));
        Ok(())
    }
}

fn open(path: &Path) -> Result<BufReader<File>, VolumeError> {
    Ok(BufReader::new(decode::open(path)?))
}

fn read_from(reader: &mut (impl Read + Seek), options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
    let stack = Stack::scan(reader)?;
    stack.check(options)?;
    let Format { channels, ty, .. } = stack.page.format;
    let mut bytes = Vec::new();
    let total = u128::from(stack.planes) * stack.page.format.bytes();
    if !stack.page.plain {
        decode::may_inflate(total, stack.length, options.max_inflated)?;
    }
    let total = usize::try_from(total).unwrap_or(usize::MAX);
    bytes.try_reserve_exact(total).map_err(|error| VolumeError::Io {
        doing: "taking memory for the pages",
        source: std::io::Error::new(std::io::ErrorKind::OutOfMemory, error),
    })?;
    stack.decode(reader, &mut bytes)?;
    let samples = Samples { shape: stack.shape(), channels, ty, endian: Endian::NATIVE, bytes };
    let (volume, mapping) = samples.into_volume(options.intensity)?;
    Ok((volume, Source { kind: FileKind::Tiff, samples: ty, mapping, spacing: stack.spacing }))
}

/// What a file holds, all of it checked: equal pages, and where they are.
struct Stack {
    /// The first page; the others have its format.
    page: Page,
    /// Of every directory whether it is a slice.
    slices: Vec<bool>,
    /// The number of slices.
    planes: u64,
    /// Where the planes are, one after the other, if not in directories of their own.
    contiguous: Option<(u64, Endian)>,
    spacing: Option<[f64; 3]>,
    /// Bytes of the file.
    length: u64,
}

impl Stack {
    /// Reads the directories, nothing else.
    fn scan(reader: &mut (impl Read + Seek)) -> Result<Self, VolumeError> {
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
                    let found = format!("page {} of the TIFF file has {}", slices.len(), page.format);
                    let wanted = format!("the first has {}: all slices of a volume are alike", expected.format);
                    return Err(malformed(&found, &wanted));
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

    /// Takes in what a microscope says of the stack.
    fn follow_ome(&mut self, pixels: &Pixels) -> Result<(), VolumeError> {
        if self.planes > 1 && pixels.is_hyperstack(self.page.format.channels) {
            let Pixels { images, channels, slices, frames, .. } = pixels;
            let what =
                format!("an OME-TIFF of {images} images of {channels} channels, {slices} slices and {frames} frames");
            return Err(only_slices(what));
        }
        self.spacing = pixels.spacing;
        Ok(())
    }

    /// Takes in what ImageJ says of the stack.
    fn follow_imagej<R: Read + Seek>(
        &mut self,
        walker: &mut Walker<'_, R>,
        directory: &Directory,
        text: Description,
    ) -> Result<(), VolumeError> {
        if text.is_hyperstack() {
            let [channels, slices, frames] = [text.channels, text.slices, text.frames];
            let what = format!("an ImageJ hyperstack of {channels} channels, {slices} slices and {frames} frames");
            return Err(only_slices(what));
        }
        let resolution = [walker.fraction(directory, Y_RESOLUTION)?, walker.fraction(directory, X_RESOLUTION)?];
        if let ([Some(y), Some(x)], Some(z)) = (resolution, text.spacing) {
            let spacing = [z, 1.0 / y, 1.0 / x];
            self.spacing = spacing.iter().all(|&step| step.is_finite() && step > 0.0).then_some(spacing);
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

    /// Where the planes of a stack begin that has one directory for all.
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
                "the ImageJ description promises planes behind the first page, which is packed or in pieces",
                "such planes are uncompressed and follow one another: save the stack again",
            )),
        }
    }

    /// Checks that the slices are a volume within the limit.
    fn check(&self, options: &ReadOptions) -> Result<(), VolumeError> {
        let Format { height, width, .. } = self.page.format;
        if self.planes == 1 {
            return Err(VolumeError::Dimensions { found: vec![height as u64, width as u64] });
        }
        self.page.format.within(self.planes, options.max_voxels)
    }

    fn shape(&self) -> Shape {
        [self.planes as usize, self.page.format.height, self.page.format.width]
    }

    /// Appends the samples of all slices in the byte order of this machine.
    fn decode(&self, reader: &mut (impl Read + Seek), bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        if self.contiguous.is_some() {
            return self.decode_contiguous(reader, 0..self.planes, bytes);
        }
        let mut decoder = self.decoder(reader)?;
        for index in 0..self.slices.len() {
            self.decode_directory(&mut decoder, index, bytes)?;
        }
        Ok(())
    }

    /// A decoder that stands at the first directory.
    fn decoder<R: Read + Seek>(&self, mut reader: R) -> Result<Decoder<R>, VolumeError> {
        rewind(&mut reader, 0)?;
        // The decoder's own buffers hold lists of strips; pages go to buffers of ours. A strip may be the whole file.
        let mut limits = Limits::default();
        limits.intermediate_buffer_size = usize::try_from(self.length).unwrap_or(usize::MAX);
        Ok(Decoder::new(reader).map_err(|error| undecodable(0, error))?.with_limits(limits))
    }

    /// Appends the samples of the next directory, which is the one at `index`; says whether it is a slice.
    fn decode_directory<R: Read + Seek>(
        &self,
        decoder: &mut Decoder<R>,
        index: usize,
        bytes: &mut Vec<u8>,
    ) -> Result<bool, VolumeError> {
        let slice = self.slices.get(index).copied().unwrap_or(false);
        if index > 0 {
            let turned = decoder.next_image();
            // Of a thumbnail it does not matter whether it could be decoded.
            if slice {
                turned.map_err(|error| undecodable(index, error))?;
            }
        }
        if slice {
            self.decode_page(decoder, index, bytes)?;
        }
        Ok(slice)
    }

    fn decode_page<R: Read + Seek>(
        &self,
        decoder: &mut Decoder<R>,
        index: usize,
        bytes: &mut Vec<u8>,
    ) -> Result<(), VolumeError> {
        let Format { height, width, channels, ty } = self.page.format;
        let promised = decoder.image_buffer_layout().map_err(|error| undecodable(index, error))?.complete_len;
        let packed = if self.page.bilevel { width.div_ceil(8) * height } else { height * width * channels * ty.size() };
        if promised != packed {
            let found = format!("page {} of the TIFF file unpacks to {promised} bytes", index + 1);
            return Err(malformed(&found, &format!("{packed} follow from its size and type")));
        }
        let mut unpack =
            |buffer: &mut [u8]| decoder.read_image_bytes(buffer).map_err(|error| undecodable(index, error));
        let start = bytes.len();
        if !self.page.bilevel && !self.page.planar {
            bytes.resize(start + packed, 0);
            return unpack(bytes.get_mut(start..).unwrap_or_default());
        }
        let mut page = vec![0; packed];
        unpack(&mut page)?;
        if self.page.bilevel {
            for row in page.chunks_exact(width.div_ceil(8)) {
                let bits = row.iter().flat_map(|&byte| (0..8).map(move |bit| byte << bit & 0x80 != 0));
                bytes.extend(bits.take(width).map(|bit| if bit { 255 } else { 0 }));
            }
        } else {
            interleave(&page, channels, ty.size(), bytes);
        }
        Ok(())
    }

    /// Appends the samples of some of the planes that follow one another.
    fn decode_contiguous(
        &self,
        reader: &mut (impl Read + Seek),
        planes: Range<u64>,
        bytes: &mut Vec<u8>,
    ) -> Result<(), VolumeError> {
        let Some((offset, endian)) = self.contiguous else { return Ok(()) };
        let plane = self.page.format.bytes() as u64;
        let before = planes.start * plane;
        rewind(reader, offset.saturating_add(before))?;
        let start = bytes.len();
        let wanted = (planes.end - planes.start) * plane;
        let read = reader.take(wanted).read_to_end(bytes);
        let found = read.map_err(|source| VolumeError::Io { doing: "reading the planes", source })? as u64;
        if found != wanted {
            return Err(VolumeError::Truncated { expected: self.planes * plane, found: before + found });
        }
        let planes = bytes.get_mut(start..).unwrap_or_default();
        if endian != Endian::NATIVE {
            planes.chunks_exact_mut(self.page.format.ty.size()).for_each(<[u8]>::reverse);
        }
        if self.page.inverted {
            // The largest unsigned number less v is v with all bits turned.
            planes.iter_mut().for_each(|byte| *byte = !*byte);
        }
        Ok(())
    }
}

/// The description of a page, empty where it has none.
fn description<R: Read + Seek>(walker: &mut Walker<'_, R>, directory: &Directory) -> Result<String, VolumeError> {
    Ok(walker.text(directory, DESCRIPTION)?.unwrap_or_default())
}

fn only_slices(what: String) -> VolumeError {
    VolumeError::Unsupported { what, supported: "stacks of slices alone: split channels and frames".into() }
}

/// Appends the samples of a page whose channels come one after the other, pixel by pixel.
fn interleave(page: &[u8], channels: usize, size: usize, bytes: &mut Vec<u8>) {
    let plane = page.len() / channels;
    for pixel in 0..plane / size {
        for channel in 0..channels {
            let start = channel * plane + pixel * size;
            bytes.extend_from_slice(page.get(start..start + size).unwrap_or_default());
        }
    }
}

fn rewind(reader: &mut impl Seek, offset: u64) -> Result<(), VolumeError> {
    let sought = reader.seek(SeekFrom::Start(offset));
    sought.map(drop).map_err(|source| VolumeError::Io { doing: "reading the pages", source })
}

fn undecodable(index: usize, error: ::tiff::TiffError) -> VolumeError {
    VolumeError::Decode { what: format!("page {} of the TIFF", index + 1), source: Box::new(error) }
}

#[cfg(test)]
mod tests;
