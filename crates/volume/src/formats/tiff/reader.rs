//! [`PagesReader`]: the pages of a TIFF file, decoded one by one.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

use ::tiff::TiffError;
use ::tiff::decoder::{Decoder, Limits};

use super::directory::malformed;
use super::stack::Stack;
use crate::formats::plane_format::PlaneFormat;
use crate::formats::{Access, VolumeHeader, VolumeReader};
use crate::layout::{Axes, DataLayout, Meaning, dense, open_file};
use crate::samples::make_little;
use crate::{Endian, ReadOptions, VolumeError};

/// Opens a TIFF file of several pages.
pub(super) fn open(path: &Path, options: &ReadOptions) -> Result<Box<dyn VolumeReader>, VolumeError> {
    let file = open_file(path)?;
    let stack = Stack::scan(&mut BufReader::new(&file))?;
    stack.check(options)?;
    match stack.contiguous {
        Some((first, endian)) => contiguous(path, &stack, first, endian, options)?.open(),
        None => Ok(Box::new(PagesReader::new(BufReader::new(file), stack)?)),
    }
}

/// The layout of planes that follow one another.
fn contiguous(
    path: &Path,
    stack: &Stack,
    first: u64,
    endian: Endian,
    options: &ReadOptions,
) -> Result<DataLayout, VolumeError> {
    let PlaneFormat { channels, ty, .. } = stack.page.format;
    let mut axes = dense(stack.shape().iter().rev().map(|&side| side as u64));
    axes.reverse();
    let axes = Axes::new(&axes, None, options.max_voxels)?.interleaved(channels);
    let meaning = if stack.page.inverted { Meaning::Inverted } else { Meaning::Numbers };
    Ok(DataLayout { meaning, spacing: stack.spacing, ..DataLayout::raw(path.into(), first, axes, ty, endian) })
}

/// Reads the pages of a TIFF file.
pub(super) struct PagesReader<R: Read + Seek> {
    header: VolumeHeader,
    stack: Stack,
    /// The directories that are slices.
    directories: Vec<usize>,
    decoder: Decoder<R>,
    /// The directory that the decoder is positioned at.
    at: usize,
}

impl<R: Read + Seek> PagesReader<R> {
    /// The reader of pages that [`Stack::scan`] found in a file.
    pub(super) fn new(mut reader: R, stack: Stack) -> Result<Self, VolumeError> {
        let rewound = reader.seek(SeekFrom::Start(0));
        rewound.map_err(|source| VolumeError::Io { doing: "reading the pages", source })?;
        // The decoder's own buffers hold lists of strips; pages go to buffers of ours. A strip may be the whole file.
        let mut limits = Limits::default();
        limits.intermediate_buffer_size = usize::try_from(stack.length).unwrap_or(usize::MAX);
        let decoder = Decoder::new(reader).map_err(|error| undecodable(0, &error))?.with_limits(limits);
        let PlaneFormat { channels, ty, .. } = stack.page.format;
        let mut header = VolumeHeader::new(stack.shape(), channels, ty);
        header.spacing = stack.spacing;
        let directories = (0..).zip(&stack.slices).filter_map(|(index, &slice)| slice.then_some(index)).collect();
        Ok(Self { header, stack, directories, decoder, at: 0 })
    }

    /// Turns the decoder to a directory that is a slice.
    fn turn_to(&mut self, directory: usize) -> Result<(), VolumeError> {
        if directory < self.at {
            self.decoder.seek_to_image(0).map_err(|error| undecodable(0, &error))?;
            self.at = 0;
        }
        while self.at < directory {
            let turned = self.decoder.next_image();
            self.at += 1;
            // Thumbnails on the way need not be decodable.
            if self.at == directory {
                turned.map_err(|error| undecodable(directory, &error))?;
            }
        }
        Ok(())
    }

    /// Appends the samples of the current directory, in the byte order of this machine.
    fn decode_page(&mut self, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        let (page, index) = (self.stack.page, self.at);
        let PlaneFormat { height, width, channels, ty } = page.format;
        let layout = self.decoder.image_buffer_layout().map_err(|error| undecodable(index, &error))?;
        let (promised, row) = (layout.complete_len, width.div_ceil(8));
        let packed = if page.bilevel { row * height } else { height * width * channels * ty.size() };
        if promised != packed {
            let found = format!("page {} of the TIFF file decodes to {promised} bytes", index + 1);
            return Err(malformed(&found, &format!("{packed} follow from its size and type")));
        }
        let decoder = &mut self.decoder;
        let mut decode =
            |buffer: &mut [u8]| decoder.read_image_bytes(buffer).map_err(|error| undecodable(index, &error));
        let start = bytes.len();
        if !page.bilevel && !page.planar {
            bytes.resize(start + packed, 0);
            return decode(bytes.get_mut(start..).unwrap_or_default());
        }
        let mut pixels = vec![0; packed];
        decode(&mut pixels)?;
        if page.bilevel {
            for row in pixels.chunks_exact(row) {
                let bits = row.iter().flat_map(|&byte| (0..8).map(move |bit| byte << bit & 0x80 != 0));
                bytes.extend(bits.take(width).map(|bit| if bit { 255 } else { 0 }));
            }
        } else {
            interleave(&pixels, channels, ty.size(), bytes);
        }
        Ok(())
    }
}

impl<R: Read + Seek + Send> VolumeReader for PagesReader<R> {
    fn header(&self) -> &VolumeHeader {
        &self.header
    }

    fn access(&self) -> Access {
        Access::Direct
    }

    fn compressed_bytes(&self) -> Option<u64> {
        (!self.stack.page.plain).then_some(self.stack.length)
    }

    fn read_planes(&mut self, planes: Range<usize>, out: &mut Vec<u8>) -> Result<(), VolumeError> {
        let total = planes.len() as u128 * self.stack.page.format.bytes();
        let reserved = out.try_reserve_exact(usize::try_from(total).unwrap_or(usize::MAX));
        reserved.map_err(|error| VolumeError::Io {
            doing: "taking memory for the pages",
            source: io::Error::new(io::ErrorKind::OutOfMemory, error),
        })?;
        let start = out.len();
        let directories = self.directories.get(planes).unwrap_or_default().to_vec();
        for directory in directories {
            self.turn_to(directory)?;
            self.decode_page(out)?;
        }
        make_little(out.get_mut(start..).unwrap_or_default(), self.header.samples, Endian::NATIVE);
        Ok(())
    }
}

/// A TIFF file of one page: a slice.
pub(crate) struct SinglePage(PagesReader<BufReader<File>>);

impl SinglePage {
    /// Opens a file and reads its header.
    pub(crate) fn open(path: &Path) -> Result<Self, VolumeError> {
        let mut reader = BufReader::new(open_file(path)?);
        let stack = Stack::scan(&mut reader)?;
        if stack.planes != 1 {
            return Err(malformed(&format!("the slice has {} pages", stack.planes), "the slices of a folder have one"));
        }
        PagesReader::new(reader, stack).map(Self)
    }

    pub(crate) fn format(&self) -> PlaneFormat {
        self.0.stack.page.format
    }

    /// Appends the samples, little-endian.
    pub(crate) fn decode(mut self, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
        self.0.read_planes(0..1, bytes)
    }
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

fn undecodable(index: usize, error: &TiffError) -> VolumeError {
    VolumeError::decode(format!("page {} of the TIFF", index + 1), error)
}
