//! [`SlabReader`]: the voxels of a file that does not fit the memory, some Z-planes at a time.
//!
//! The planes are those of [`read`](super::read), to the bit: the same headers, limits, intensity rules and errors. What
//! cannot be known before all samples have been seen (the range under `full`, the percentiles under `auto`) is found by
//! passing over the file beforehand, in the memory of one slab: once under `full`; under `auto` once for every 16 bits of
//! a sample, up to four times. Samples of `u8`, and those under a window, are read once.
//!
//! A file has slabs where its samples lie in the order of Z: bare samples, `.npy` in C order, NRRD, MetaImage and NIfTI
//! (raw, gzip, zlib, bzip2), TIFF page by page, folders of slices. Archives of arrays, Fortran order, colours in planes,
//! samples as text and MagicaVoxel models have none, and are read whole. Where memory is no concern, `read` is simpler
//! and passes over the file once.

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

use super::levels::{self, Passes};
use super::planes::Planes;
use super::samples::{drop_alpha, not_finite};
use super::volume::luma;
use super::{MIN_SIDE, ReadError, ReadOptions, Shape, Source, VolumeError, npy, read};

/// Reads a file slab by slab, in the order of Z.
///
/// ```
/// use hlacdb_volume::{ReadOptions, SlabReader};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("a_9x5x5_u8.raw");
/// # std::fs::write(&path, [7; 9 * 5 * 5])?;
/// let mut options = ReadOptions::default();
/// # options.raw = None;
/// # let _ = &mut options;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct SlabReader {
    path: PathBuf,
    planes: Planes,
    source: Source,
    /// How samples become levels; `None` where they are taken as they are.
    passes: Option<Box<dyn Passes>>,
    /// The Z of the next plane.
    next: usize,
    /// The voxels of the last slab, and the memory of the next.
    buffer: Vec<u8>,
}

/// Some successive Z-planes of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slab<'a> {
    /// The Z of the first plane.
    pub first: usize,
    /// The number of planes, at least 1.
    pub planes: usize,
    /// 1 (grey) or 3 (RGB).
    pub channels: usize,
    /// `planes * Y * X * channels` voxels, X fastest, channels interleaved.
    pub voxels: &'a [u8],
}

impl<'a> Slab<'a> {
    /// The grey voxels that are described: themselves, or of colours the luma, as [`Volume::luma`](super::Volume::luma)
    /// defines it.
    pub fn grey(&self) -> Cow<'a, [u8]> {
        if self.channels == 1 { Cow::Borrowed(self.voxels) } else { luma(self.voxels).collect() }
    }
}

impl SlabReader {
    /// Opens a file or a folder of slices and reads its header; `Ok(None)` where it can only be read whole.
    ///
    /// # Errors
    /// [`ReadError`], as [`read`](super::read) for what is wrong with the header.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Option<Self>, ReadError> {
        let open = || {
            let Some(planes) = read::planes(path, options)? else { return Ok(None) };
            let shape = planes.shape();
            if shape.iter().any(|&side| side < MIN_SIDE) {
                return Err(VolumeError::TooSmall { shape });
            }
            let source = planes.source();
            let mut reader = Self { path: path.into(), planes, source, passes: None, next: 0, buffer: Vec::new() };
            let samples = reader.samples(reader.shape()[0]);
            reader.passes = levels::passes(source.samples, samples, options.intensity, reader.planes.scaling());
            Ok(Some(reader))
        };
        open().map_err(|error| ReadError { path: path.into(), error })
    }

    /// Axis lengths (Z, Y, X) of the whole volume.
    pub fn shape(&self) -> Shape {
        self.planes.shape()
    }

    /// 1 (grey) or 3 (RGB).
    pub fn channels(&self) -> usize {
        if self.planes.channels() == 1 { 1 } else { 3 }
    }

    /// Bytes of all samples once decoded: the memory that reading the file whole takes.
    pub fn bytes(&self) -> u64 {
        self.plane_bytes().saturating_mul(self.shape()[0] as u64)
    }

    /// Where the volume comes from. The mapping is known once a slab has been read.
    pub fn source(&self) -> Source {
        let known = self.passes.as_ref().filter(|passes| !passes.surveys());
        Source { mapping: known.map(|passes| passes.mapping()), ..self.source }
    }

    /// How many planes a slab may have for reading and describing it to take about `memory` bytes: at least 1, at most
    /// all of them.
    pub fn planes_within(&self, memory: u64) -> usize {
        // The samples, and again where they have to be brought into order; the grey voxels, and the extractor's copy.
        let plane = 2 * self.plane_bytes() + 2 * (self.shape()[1] * self.shape()[2]) as u64;
        usize::try_from(memory / plane).unwrap_or(usize::MAX).clamp(1, self.shape()[0])
    }

    /// The next `planes` planes, fewer at the end of the volume; `None` when there are no more, or `planes` is 0.
    ///
    /// The first call passes over the file as often as the intensity rule asks for; `planes` sets the memory for that too.
    ///
    /// # Errors
    /// [`ReadError`], as [`read`](super::read). Of several faults the one that comes first in the file is told. After an
    /// error there are no more slabs.
    pub fn read(&mut self, planes: usize) -> Result<Option<Slab<'_>>, ReadError> {
        let result = self.advance(planes);
        if result.is_err() {
            self.next = self.shape()[0];
        }
        let read = result.map_err(|error| ReadError { path: self.path.clone(), error })?;
        let slab = Slab { first: self.next - read, planes: read, channels: self.channels(), voxels: &self.buffer };
        Ok((read > 0).then_some(slab))
    }

    /// Fills the buffer with the voxels of the next planes and says how many.
    fn advance(&mut self, planes: usize) -> Result<usize, VolumeError> {
        let planes = planes.min(self.shape()[0] - self.next);
        if planes == 0 {
            return Ok(0);
        }
        if self.next == 0 {
            self.survey(planes)?;
        }
        let mut piece = self.piece(planes)?;
        let (before, channels) = (self.samples(self.next), self.channels());
        if let Some(passes) = &mut self.passes {
            passes.write(&mut piece, before).map_err(|bad| not_finite(bad, self.planes.shape(), channels))?;
        }
        if self.planes.truth() {
            npy::black_and_white(&mut piece);
        }
        self.buffer = piece;
        self.next += planes;
        Ok(planes)
    }

    /// Passes over the file until it is known how samples become levels, and goes back to its start.
    fn survey(&mut self, planes: usize) -> Result<(), VolumeError> {
        let (shape, channels) = (self.shape(), self.channels());
        while let Some(mut passes) = self.passes.take_if(|passes| passes.surveys()) {
            for first in (0..shape[0]).step_by(planes) {
                let piece = self.piece(planes.min(shape[0] - first))?;
                let surveyed = passes.survey(&piece, self.samples(first));
                surveyed.map_err(|bad| not_finite(bad, shape, channels))?;
                self.buffer = piece;
            }
            passes.end_survey();
            self.passes = Some(passes);
            self.planes.rewind();
        }
        Ok(())
    }

    /// The samples of the next planes: little-endian, without an alpha.
    fn piece(&mut self, planes: usize) -> Result<Vec<u8>, VolumeError> {
        let mut piece = self.planes.next(planes, std::mem::take(&mut self.buffer))?;
        if self.planes.channels() == 4 {
            drop_alpha(&mut piece, self.source.samples);
        }
        levels::make_little(&mut piece, self.source.samples, self.planes.endian());
        Ok(piece)
    }

    /// The number of samples in so many planes, without an alpha.
    fn samples(&self, planes: usize) -> u64 {
        let [_, height, width] = self.shape();
        (planes * height * width * self.channels()) as u64
    }

    /// Bytes of the samples of one plane in the file, decoded.
    fn plane_bytes(&self) -> u64 {
        let [_, height, width] = self.shape();
        (height * width * self.planes.channels() * self.source.samples.size()) as u64
    }
}

impl fmt::Debug for SlabReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut debug = f.debug_struct("SlabReader");
        debug.field("path", &self.path).field("shape", &self.shape()).field("next", &self.next).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Folder, encode, gzip};
    use crate::{Endian, FileKind, Intensity, RawLayout, SampleType, Volume, read as read_whole};

    fn gather(path: &Path, options: &ReadOptions, planes: usize) -> Result<(Volume, Source), VolumeError> {
        let inner = |error: ReadError| error.error;
        let mut reader = SlabReader::open(path, options).map_err(inner)?.unwrap();
        let mut voxels = Vec::new();
        let mut next = 0;
        while let Some(slab) = reader.read(planes).map_err(inner)? {
            assert!(slab.first == next && slab.planes <= planes);
            next += slab.planes;
            voxels.extend_from_slice(slab.voxels);
        }
        assert_eq!(next, reader.shape()[0]);
        Ok((Volume::new(reader.shape(), reader.channels(), voxels)?, reader.source()))
    }

    fn rules() -> impl Strategy<Value = Intensity> {
        let window = (-300.0..300.0, 0.1..500.0).prop_map(|(lo, wide)| Intensity::Window { lo, hi: lo + wide });
        prop_oneof![Just(Intensity::Full), Just(Intensity::Auto), Just(Intensity::NonZero), window]
    }

    fn header(ty: SampleType, endian: Endian, encoding: &str, shape: Shape, channels: usize) -> Vec<u8> {
        let name = match ty {
            SampleType::F32 => "float".into(),
            SampleType::F64 => "double".into(),
            _ if ty.name().starts_with('u') => format!("uint{}", 8 * ty.size()),
            _ => format!("int{}", 8 * ty.size()),
        };
        let endian = if endian == Endian::Big { "big" } else { "little" };
        let [z, y, x] = shape;
        format!(
            "NRRD0004\ntype: {name}\ndimension: 4\nsizes: {channels} {x} {y} {z}\nendian: {endian}\nencoding: {encoding}\n\n"
        )
        .into_bytes()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Every type, byte order, number of channels, rule and size of slabs: voxels and mapping are those of the whole.
        #[test]
        fn slabs_are_the_whole(
            shape in prop::array::uniform3(3_usize..12),
            channels in prop::sample::select(vec![1_usize, 3, 4]),
            ty in prop::sample::select(SampleType::ALL.to_vec()),
            big in any::<bool>(),
            packed in any::<bool>(),
            rule in rules(),
            planes in 1_usize..14,
            seed in any::<u32>(),
        ) {
            prop_assume!(ty != SampleType::F16);
            let count = shape.iter().product::<usize>() * channels;
            let value = |index: usize| f64::from((index as u32 ^ seed).wrapping_mul(2_654_435_761) >> 20) - 2000.0;
            let values: Vec<f64> = (0..count).map(value).collect();
            let endian = if big { Endian::Big } else { Endian::Little };
            let bytes = encode(&values, ty, endian);
            let bytes = if packed { gzip(&bytes) } else { bytes };
            let head = header(ty, endian, if packed { "gzip" } else { "raw" }, shape, channels);
            let folder = Folder::new();
            let path = folder.write("a.nrrd", [head, bytes].concat());
            let options = ReadOptions { intensity: rule, ..ReadOptions::default() };
            prop_assert!(gather(&path, &options, planes).unwrap() == read_whole(&path, &options).unwrap());
        }
    }

    /// Half floats, and tables of levels (which large volumes of small samples are mapped by).
    #[test]
    fn slabs_of_half_floats_are_the_whole() {
        let shape = [9, 90, 100];
        let values: Vec<f64> = (0..81_000_u32).map(|i| f64::from(i.wrapping_mul(2_654_435_761) >> 20) - 9.0).collect();
        let folder = Folder::new();
        let path = folder.write("a.raw", encode(&values, SampleType::F16, Endian::Big));
        let layout = RawLayout { shape, samples: SampleType::F16, endian: Endian::Big, offset: 0 };
        for intensity in [Intensity::Full, Intensity::Auto, Intensity::NonZero] {
            let options = ReadOptions { intensity, raw: Some(layout), ..ReadOptions::default() };
            assert!(gather(&path, &options, 4).unwrap() == read_whole(&path, &options).unwrap(), "{intensity}");
        }
    }

    #[test]
    fn a_bad_sample_in_a_later_slab_is_named_by_its_voxel() {
        let folder = Folder::new();
        let layout = RawLayout { shape: [6, 4, 5], samples: SampleType::F32, endian: Endian::Little, offset: 0 };
        let mut values = vec![1.0; 120];
        values[3 * 20 + 2 * 5 + 4] = f64::NAN;
        let path = folder.write("a.raw", encode(&values, SampleType::F32, Endian::Little));
        let rules = [Intensity::Full, Intensity::Auto, Intensity::NonZero, Intensity::Window { lo: 0.0, hi: 1.0 }];
        for intensity in rules {
            let options = ReadOptions { intensity, raw: Some(layout), ..ReadOptions::default() };
            let mut reader = SlabReader::open(&path, &options).unwrap().unwrap();
            let error = loop {
                match reader.read(2) {
                    Ok(slab) => assert!(slab.unwrap().first < 2, "{intensity}"),
                    Err(error) => break error,
                }
            };
            assert!(error.to_string().contains("the sample at z 3, y 2, x 4 is NaN"), "{intensity}: {error}");
            assert_eq!(error.to_string(), read_whole(&path, &options).unwrap_err().to_string());
            assert_eq!(reader.read(2).unwrap(), None, "nothing comes after an error");
        }
    }

    #[test]
    fn a_file_that_ends_in_the_middle_is_truncated() {
        let folder = Folder::new();
        let values: Vec<f64> = (0..3000).map(f64::from).collect();
        let bytes = encode(&values, SampleType::U16, Endian::Little);
        let shape = [30, 10, 10];
        let raw = [header(SampleType::U16, Endian::Little, "raw", shape, 1), bytes[..3000].to_vec()].concat();
        let packed = gzip(&bytes);
        let gzip = header(SampleType::U16, Endian::Little, "gzip", shape, 1);
        let cut = [&gzip[..], &packed[..packed.len() / 2]].concat();
        // The last bytes of gzip are its checksum, which is met after the last sample.
        let mut damaged = [&gzip[..], &packed[..]].concat();
        let checksum = damaged.len() - 6;
        damaged[checksum] ^= 1;
        for (name, bytes) in [("raw.nrrd", raw), ("cut.nrrd", cut), ("damaged.nrrd", damaged)] {
            let path = folder.write(name, bytes);
            let options = ReadOptions { intensity: Intensity::Window { lo: 0.0, hi: 9.0 }, ..ReadOptions::default() };
            let slabs = gather(&path, &options, 7).unwrap_err();
            assert_eq!(slabs.to_string(), read_whole(&path, &options).unwrap_err().error.to_string(), "{name}");
            assert!(matches!(slabs, VolumeError::Truncated { .. } | VolumeError::Decode { .. }), "{name}: {slabs}");
        }
    }

    #[test]
    fn what_a_slab_takes_is_bounded() {
        let folder = Folder::new();
        let path = folder.write("a.raw", vec![7; 40 * 10 * 10 * 2]);
        let layout = RawLayout { shape: [40, 10, 10], samples: SampleType::U16, endian: Endian::Little, offset: 0 };
        let options = ReadOptions { raw: Some(layout), ..ReadOptions::default() };
        let reader = SlabReader::open(&path, &options).unwrap().unwrap();
        assert_eq!((reader.bytes(), reader.source().kind), (8000, FileKind::Raw));
        let planes = [0, 599, 1200, 6000, u64::MAX].map(|memory| reader.planes_within(memory));
        assert_eq!(planes, [1, 1, 2, 10, 40]);
        let limited = SlabReader::open(&path, &ReadOptions { max_voxels: 3999, ..options }).unwrap_err();
        assert!(matches!(limited.error, VolumeError::TooLarge { .. }), "{limited}");
    }
}
