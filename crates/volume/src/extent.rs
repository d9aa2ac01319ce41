//! [`Extent`]: where and how a volume's samples lie in a file. Every header comes down to one.
//!
//! Reading is in two steps. A format's header parser yields an extent and touches no samples; the extent then loads
//! them: all of them ([`Extent::read`]) or, where the file has them in the order of Z, plane by plane
//! ([`Extent::planes`]), for volumes larger than memory.

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::PathBuf;

use super::levels::Scaling;
use super::samples::within_limit;
use super::{Endian, FileKind, MIN_SIDE, ReadOptions, SampleType, Samples, Shape, Source, Volume, VolumeError, decode};

/// Where and how samples lie in a file.
#[derive(Debug, Clone)]
pub(super) struct Extent {
    /// The kind of file that the header is.
    pub(super) kind: FileKind,
    /// The file that holds the samples.
    pub(super) file: PathBuf,
    /// Where the (encoded) samples begin.
    pub(super) start: Start,
    /// How they are encoded.
    pub(super) encoding: Encoding,
    /// Bytes before the first sample that a compressed encoding yields; 0 with the others.
    pub(super) skip: u64,
    /// Lengths and strides.
    pub(super) axes: Axes,
    /// The type of the samples.
    pub(super) samples: SampleType,
    /// Their byte order.
    pub(super) endian: Endian,
    /// From stored samples to units.
    pub(super) scaling: Scaling,
    /// The distance between voxels along (Z, Y, X), if given.
    pub(super) spacing: Option<[f64; 3]>,
}

/// Where the samples begin in their file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Start {
    /// At this byte.
    At(u64),
    /// They are the last bytes of the file.
    FromEnd,
}

/// How samples are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// As they are in memory.
    Raw,
    /// One or more gzip members.
    Gzip,
    /// One zlib stream.
    Zlib,
    /// One or more bzip2 streams.
    Bzip2,
    /// Numbers as text.
    Text,
    /// Bytes as pairs of hexadecimal digits.
    Hex,
}

impl Encoding {
    /// The encoded samples as an error names them.
    fn data(self) -> &'static str {
        match self {
            Self::Gzip => "the gzip data",
            Self::Zlib => "the zlib data",
            Self::Bzip2 => "the bzip2 data",
            Self::Raw | Self::Text | Self::Hex => "the data",
        }
    }
}

/// An axis of an array in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Axis {
    /// How many samples lie along it.
    pub(super) length: u64,
    /// How many samples lie between one and the next along it.
    pub(super) stride: u128,
}

/// The axes of a dense array whose lengths are given, the fastest first.
pub(super) fn dense(fastest_first: impl IntoIterator<Item = u64>) -> Vec<Axis> {
    let mut stride = 1_u128;
    let axis = |length| {
        let axis = Axis { length, stride };
        stride = stride.saturating_mul(u128::from(length));
        axis
    };
    fastest_first.into_iter().map(axis).collect()
}

/// The axes of a volume in a file: lengths and strides (in samples) along Z, Y, X and the channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Axes {
    pub(super) shape: Shape,
    pub(super) channels: usize,
    pub(super) strides: [usize; 4],
}

impl Axes {
    /// More voxels than any machine holds: whatever the caller's limit, no product of lengths and sizes overflows.
    const MOST: u64 = 1 << 56;

    /// The axes of a volume out of those of an array whose format has no name for them: (Z, Y, X) or (Z, Y, X, colour).
    /// A last one of four (axes of length 1 set aside) is the colour axis if its length is 3 or 4.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub(super) fn of_array(found: &[Axis], limit: u64) -> Result<Self, VolumeError> {
        let colour = |axes: &[Axis]| axes.len() == 4 && matches!(axes[3].length, 3 | 4);
        let long: Vec<Axis> = found.iter().copied().filter(|axis| axis.length != 1).collect();
        let coloured = [found, &long].into_iter().find(|axes| colour(axes));
        match coloured.and_then(<[Axis]>::split_last) {
            Some((channel, space)) => Self::new(space, Some(*channel), limit),
            None => Self::new(found, None, limit),
        }
    }

    /// The axes of a volume out of those of space, in the order (Z, Y, X), and that of colour. Axes of length 1 are left
    /// out where there are more than three of space.
    ///
    /// # Errors
    /// [`VolumeError::Dimensions`], [`VolumeError::TooSmall`], [`VolumeError::TooLarge`], and
    /// [`VolumeError::Unsupported`] for a colour axis of another length than 1, 3 and 4.
    pub(super) fn new(space: &[Axis], channel: Option<Axis>, limit: u64) -> Result<Self, VolumeError> {
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
            return Err(VolumeError::Unsupported {
                what: format!("a volume of {} channels", channel.length),
                supported: "1 channel (grey), 3 (RGB) or 4 (RGB and alpha)".into(),
            });
        }
        let strides = [fits(z.stride)?, fits(y.stride)?, fits(x.stride)?, fits(channel.stride)?];
        Ok(Self { shape, channels: channel.length as usize, strides })
    }

    /// The same axes, each voxel being `channels` samples side by side.
    pub(super) fn interleaved(self, channels: usize) -> Self {
        let strides = self.strides.map(|stride| stride * channels);
        Self { shape: self.shape, channels, strides: [strides[0], strides[1], strides[2], 1] }
    }

    fn count(&self) -> u64 {
        self.shape.iter().chain([&self.channels]).map(|&length| length as u64).product()
    }

    /// Brings samples that lie along these axes into the order of [`Samples`].
    fn arrange(&self, bytes: Vec<u8>, size: usize) -> Vec<u8> {
        let [_, height, width] = self.shape;
        let row = width * self.channels;
        let ordered = [height * row, row, self.channels, 1];
        if self.strides == ordered || self.channels == 1 && self.strides[..3] == ordered[..3] {
            return bytes;
        }
        match size {
            1 => self.gather::<1>(&bytes),
            2 => self.gather::<2>(&bytes),
            4 => self.gather::<4>(&bytes),
            _ => self.gather::<8>(&bytes),
        }
    }

    /// In tiles, so that neither what is read nor what is written is far apart in memory.
    fn gather<const N: usize>(&self, bytes: &[u8]) -> Vec<u8> {
        const TILE: usize = 32;
        let [depth, height, width] = self.shape;
        let [along_z, along_y, along_x, along_channels] = self.strides;
        let from = bytes.as_chunks::<N>().0;
        let mut arranged = vec![0; bytes.len()];
        let to = arranged.as_chunks_mut::<N>().0;
        let tiles = (0..depth).step_by(TILE).flat_map(|z| (0..width).step_by(TILE).map(move |x| (z, x)));
        for (first_z, first_x) in tiles {
            for y in 0..height {
                for z in first_z..depth.min(first_z + TILE) {
                    for x in first_x..width.min(first_x + TILE) {
                        let voxel = z * along_z + y * along_y + x * along_x;
                        let place = ((z * height + y) * width + x) * self.channels;
                        for channel in 0..self.channels {
                            to[place + channel] = from[voxel + channel * along_channels];
                        }
                    }
                }
            }
        }
        arranged
    }
}

impl Extent {
    /// The volume, and where it came from.
    ///
    /// # Errors
    /// [`VolumeError::Inflated`] beforehand; [`VolumeError::Truncated`], [`VolumeError::Decode`],
    /// [`VolumeError::Malformed`] and [`VolumeError::Io`] while reading; those of [`Samples::into_volume`].
    pub(super) fn read(&self, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
        let file = decode::open(&self.file)?;
        if matches!(self.encoding, Encoding::Gzip | Encoding::Zlib | Encoding::Bzip2) {
            self.may_inflate(options)?;
        }
        let bytes = self.load(file)?;
        self.finish(bytes, options)
    }

    /// Checks that the samples, which are compressed, may take the memory that they need.
    ///
    /// # Errors
    /// [`VolumeError::Inflated`], and [`VolumeError::Io`] where the file's length is not to be had.
    pub(super) fn may_inflate(&self, options: &ReadOptions) -> Result<(), VolumeError> {
        let io = |source| VolumeError::Io { doing: "finding the samples", source };
        let length = std::fs::metadata(&self.file).map_err(io)?.len();
        decode::may_inflate(self.bytes().into(), length, options.max_inflated)
    }

    /// As [`read`](Self::read), of a stream that stands at the first sample.
    pub(super) fn read_from(&self, stream: impl Read, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
        let bytes = decode::exactly(stream, self.bytes(), "the data")?;
        self.finish(bytes, options)
    }

    /// Bytes of all samples, decoded.
    pub(super) fn bytes(&self) -> u64 {
        self.axes.count() * self.samples.size() as u64
    }

    fn finish(&self, bytes: Vec<u8>, options: &ReadOptions) -> Result<(Volume, Source), VolumeError> {
        let Axes { shape, channels, .. } = self.axes;
        let bytes = self.axes.arrange(bytes, self.samples.size());
        // Numbers from text have no byte order of the file's own.
        let endian = if self.encoding == Encoding::Text { Endian::Little } else { self.endian };
        let samples = Samples { shape, channels, ty: self.samples, endian, bytes };
        let (volume, mapping) = samples.into_volume_scaled(options.intensity, self.scaling)?;
        Ok((volume, Source { kind: self.kind, samples: self.samples, mapping, spacing: self.spacing }))
    }

    /// Whether every Z-plane is one piece of the file's samples, the planes in order, and the encoding can be followed
    /// from plane to plane: then [`planes`](Self::planes) gives them.
    pub(super) fn has_planes(&self) -> bool {
        let [_, height, width] = self.axes.shape;
        self.axes.strides[0] == height * width * self.axes.channels
            && !matches!(self.encoding, Encoding::Text | Encoding::Hex)
    }

    /// The samples from the first plane on, to be read plane by plane.
    ///
    /// # Errors
    /// [`VolumeError::Truncated`], [`VolumeError::Decode`] and [`VolumeError::Io`] while coming to the first sample.
    pub(super) fn planes(&self) -> Result<PlaneStream, VolumeError> {
        let stream = self.stream(decode::open(&self.file)?)?;
        let stream: Box<dyn Read + Send> = match self.encoding {
            Encoding::Gzip => Box::new(decode::Members::gzip(stream)),
            Encoding::Zlib => Box::new(flate2::bufread::ZlibDecoder::new(stream)),
            Encoding::Bzip2 => Box::new(decode::Members::bzip2(stream)),
            Encoding::Raw | Encoding::Text | Encoding::Hex => Box::new(stream),
        };
        let mut stream = stream;
        decode::skip(&mut stream, self.skip, self.encoding.data())?;
        let stream = decode::Promised::new(stream, self.bytes(), self.encoding.data());
        Ok(PlaneStream { stream, axes: self.axes, size: self.samples.size() })
    }

    /// The decoded bytes, in the file's order.
    fn load(&self, file: File) -> Result<Vec<u8>, VolumeError> {
        let stream = self.stream(file)?;
        match self.encoding {
            Encoding::Raw => decode::exactly(stream, self.bytes(), self.encoding.data()),
            Encoding::Gzip => self.decoded(decode::Members::gzip(stream)),
            Encoding::Zlib => self.decoded(flate2::bufread::ZlibDecoder::new(stream)),
            Encoding::Bzip2 => self.decoded(decode::Members::bzip2(stream)),
            Encoding::Text => decode::text(stream, self.axes.count(), self.samples),
            Encoding::Hex => decode::hex(stream, self.bytes()),
        }
    }

    /// The file, standing at the encoded samples.
    fn stream(&self, mut file: File) -> Result<BufReader<File>, VolumeError> {
        let io = |source| VolumeError::Io { doing: "finding the samples", source };
        let expected = self.bytes();
        let length = file.metadata().map_err(io)?.len();
        let start = match self.start {
            Start::At(start) => start,
            Start::FromEnd => length.checked_sub(expected).ok_or(VolumeError::Truncated { expected, found: length })?,
        };
        let found = length.saturating_sub(start);
        if self.encoding == Encoding::Raw && found < expected {
            return Err(VolumeError::Truncated { expected, found });
        }
        file.seek(SeekFrom::Start(start.min(length))).map_err(io)?;
        Ok(BufReader::new(file))
    }

    fn decoded(&self, mut stream: impl Read) -> Result<Vec<u8>, VolumeError> {
        decode::skip(&mut stream, self.skip, self.encoding.data())?;
        decode::exactly(stream, self.bytes(), self.encoding.data())
    }
}

/// Samples that are read plane by plane.
pub(super) struct PlaneStream {
    stream: decode::Promised<Box<dyn Read + Send>>,
    axes: Axes,
    size: usize,
}

impl PlaneStream {
    /// The samples of the next `count` planes, in the order of [`Samples`]; `buffer` is their memory.
    ///
    /// # Errors
    /// [`VolumeError::Truncated`], [`VolumeError::Decode`] and [`VolumeError::Io`].
    pub(super) fn next(&mut self, count: usize, mut buffer: Vec<u8>) -> Result<Vec<u8>, VolumeError> {
        let [_, height, width] = self.axes.shape;
        let axes = Axes { shape: [count, height, width], ..self.axes };
        buffer.clear();
        self.stream.read(axes.count() * self.size as u64, &mut buffer)?;
        Ok(axes.arrange(buffer, self.size))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Folder, SHAPE, encode, samples, volume};

    const LIMIT: u64 = 1 << 32;

    fn c_order(lengths: &[u64]) -> Vec<Axis> {
        let mut axes = dense(lengths.iter().rev().copied());
        axes.reverse();
        axes
    }

    #[test]
    fn three_axes_or_four_with_colour_are_a_volume() {
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
    fn other_axes_are_none() {
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
            // No limit of the caller's lets through what would overflow.
            let unlimited = Axes::of_array(&c_order(&lengths), u64::MAX);
            assert!(unlimited.is_err() || unlimited.unwrap().interleaved(4).shape[0] == 1 << 12);
        }
    }

    proptest! {
        /// Stored in any order of the axes, samples end up where their voxel is.
        #[test]
        fn any_order_of_axes_is_brought_into_ours(
            order in Just(vec![0_usize, 1, 2, 3]).prop_shuffle(),
            shape in prop::array::uniform3(3_usize..40),
            colour in any::<bool>(),
            size in prop::sample::select(vec![1_usize, 2, 4, 8]),
        ) {
            let channels = if colour { 3 } else { 1 };
            let lengths = [shape[0], shape[1], shape[2], channels];
            let stored = dense(order.iter().map(|&axis| lengths[axis] as u64));
            let mut found = vec![Axis { length: 0, stride: 0 }; 4];
            order.iter().zip(&stored).for_each(|(&axis, &is)| found[axis] = is);
            let axes = Axes::of_array(if colour { &found } else { &found[..3] }, LIMIT).unwrap();
            // Each sample holds its own place in the file.
            let count = lengths.iter().product::<usize>();
            let bytes: Vec<u8> = (0..count as u64).flat_map(|place| place.to_le_bytes()[..size].to_vec()).collect();
            let arranged = axes.arrange(bytes, size);
            for (index, sample) in arranged.chunks(size).enumerate() {
                let [_, height, width, channels] = lengths;
                let position = [index / channels / width / height, index / channels / width % height,
                    index / channels % width, index % channels];
                let place: u128 = position.iter().zip(&found).map(|(&at, axis)| at as u128 * axis.stride).sum();
                prop_assert_eq!(sample, &(place as u64).to_le_bytes()[..size]);
            }
        }
    }

    /// What a reader of slabs will lean on: the place of a sample in a raw file.
    #[test]
    fn a_raw_sample_lies_where_start_and_strides_say() {
        let folder = Folder::new();
        let bytes = [&b"before"[..], &encode(&samples(), SampleType::U16, Endian::Big)].concat();
        let extent = Extent {
            kind: FileKind::Raw,
            file: folder.write("bare", &bytes),
            start: Start::At(6),
            encoding: Encoding::Raw,
            skip: 0,
            axes: Axes::of_array(&c_order(&SHAPE.map(|side| side as u64)), LIMIT).unwrap(),
            samples: SampleType::U16,
            endian: Endian::Big,
            scaling: Scaling::IDENTITY,
            spacing: None,
        };
        assert_eq!(extent.read(&ReadOptions::default()).unwrap().0, volume());
        let [z, y, x, _] = extent.axes.strides;
        let at = 6 + 2 * (z + 2 * y + 3 * x);
        assert_eq!(u16::from_be_bytes([bytes[at], bytes[at + 1]]), 67 + 62 + 21);
    }
}
