//! [`SlabReader`]: the voxels of a file larger than memory, some Z-planes at a time.
//!
//! The voxels are those of [`read`](crate::read), to the bit, with the same headers, limits, intensity rules and errors.
//! What depends on all samples (the range under `full`, the percentiles under `auto`) is found by scanning the file before
//! the first slab, in the memory of one slab: once under `full`; under `auto` once for every 16 bits of a sample, up to
//! four times. Samples of `u8`, and those under a window, are read once.
//!
//! Files whose samples are in the order of Z have slabs. Fortran order, colours in planes and MagicaVoxel models do not,
//! and are read whole.

use std::borrow::Cow;
use std::fmt;
use std::path::Path;

use super::{VolumeFile, VolumeSource};
use crate::formats::Access;
use crate::samples::not_finite;
use crate::voxels::luma;
use crate::{ReadError, ReadOptions, Shape, VolumeError};

/// Reads a file slab by slab, in the order of Z.
///
/// ```
/// use hlacdb_volume::{ReadOptions, SlabReader};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("scan.npy");
/// # hlacdb_volume::npy::NpyWriter::create(&path, &[9, 5, 4])?.finish_with(&[7_u8; 180])?;
/// let mut reader = SlabReader::open(&path, &ReadOptions::new())?.ok_or("this file is only read whole")?;
/// assert_eq!(reader.shape(), [9, 5, 4]);
/// let (mut planes, mut sum) = (Vec::new(), 0);
/// while let Some(slab) = reader.read(4)? {
///     planes.push(slab.planes);
///     sum += slab.voxels.iter().map(|&voxel| u64::from(voxel)).sum::<u64>();
/// }
/// assert_eq!((planes, sum), (vec![4, 4, 1], 7 * 180));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct SlabReader {
    file: VolumeFile,
    /// The Z of the next plane.
    next: usize,
    /// The voxels of the last slab, and the memory of the next.
    buffer: Vec<u8>,
}

/// Successive Z-planes of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct VolumeSlab<'a> {
    /// The Z of the first plane.
    pub first: usize,
    /// The number of planes, at least 1.
    pub planes: usize,
    /// 1 (grey) or 3 (RGB).
    pub channels: usize,
    /// `planes * Y * X * channels` voxels, X fastest, channels interleaved.
    pub voxels: &'a [u8],
}

impl<'a> VolumeSlab<'a> {
    /// The grey levels: the voxels of a grey slab, of colours the luma as [`Volume::luma`](crate::Volume::luma) defines it.
    pub fn grey(&self) -> Cow<'a, [u8]> {
        if self.channels == 1 { Cow::Borrowed(self.voxels) } else { luma(self.voxels).collect() }
    }
}

impl SlabReader {
    /// Opens a file or a folder of slices and reads its header; `Ok(None)` if it can only be read whole.
    ///
    /// # Errors
    /// [`ReadError`] as by [`read`](crate::read), for what is wrong with the header.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Option<Self>, ReadError> {
        VolumeFile::open(path, options).map(Self::new)
    }

    /// Reads the slabs of an open file; `None` if it can only be read whole.
    pub fn new(file: VolumeFile) -> Option<Self> {
        (file.access() != Access::Whole).then_some(Self { file, next: 0, buffer: Vec::new() })
    }

    /// Axis lengths (Z, Y, X) of the whole volume.
    pub fn shape(&self) -> Shape {
        self.file.header().shape
    }

    /// 1 (grey) or 3 (RGB).
    pub fn channels(&self) -> usize {
        self.file.channels
    }

    /// Bytes of all samples once decoded: the memory that reading the file whole takes.
    pub fn bytes(&self) -> u64 {
        self.file.header().bytes()
    }

    /// What is known of the origin of the volume. The mapping is known once a slab has been read.
    pub fn source(&self) -> VolumeSource {
        self.file.source()
    }

    /// The number of planes of a slab for which reading and describing it takes about `memory` bytes: at least 1, at most
    /// all of them.
    pub fn planes_within(&self, memory: u64) -> usize {
        // The samples, and again if they are brought into order; the grey voxels, and the copy of a feature extractor.
        let [depth, height, width] = self.shape();
        let plane = 2 * self.file.header().plane_bytes() + 2 * (height * width) as u64;
        usize::try_from(memory / plane).unwrap_or(usize::MAX).clamp(1, depth)
    }

    /// The next `planes` planes, fewer at the end of the volume; `None` at the end, or if `planes` is 0.
    ///
    /// The first call makes the scans that the intensity rule needs; `planes` bounds their memory too.
    ///
    /// # Errors
    /// [`ReadError`] as by [`read`](crate::read). Of several faults the first one in the file is reported. After an error
    /// there are no more slabs.
    pub fn read(&mut self, planes: usize) -> Result<Option<VolumeSlab<'_>>, ReadError> {
        let result = self.advance(planes);
        if result.is_err() {
            self.next = self.shape()[0];
        }
        let read = result.map_err(|error| self.file.failed(error))?;
        let slab =
            VolumeSlab { first: self.next - read, planes: read, channels: self.channels(), voxels: &self.buffer };
        Ok((read > 0).then_some(slab))
    }

    /// Fills the buffer with the voxels of the next planes and returns their number.
    fn advance(&mut self, planes: usize) -> Result<usize, VolumeError> {
        let [depth, height, width] = self.shape();
        let planes = planes.min(depth - self.next);
        if planes == 0 {
            return Ok(0);
        }
        self.file.scan(planes, &mut self.buffer)?;
        self.file.read_samples(self.next, planes, &mut self.buffer)?;
        let channels = self.channels();
        if let Some(rescaler) = &mut self.file.rescaler {
            let before = (self.next * height * width * channels) as u64;
            let applied = rescaler.apply(&mut self.buffer, before);
            applied.map_err(|bad| not_finite(bad, [depth, height, width], channels))?;
        }
        self.next += planes;
        Ok(planes)
    }
}

impl fmt::Debug for SlabReader {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SlabReader").field("file", &self.file).field("next", &self.next).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{Folder, encode, gzip};
    use crate::{Endian, Intensity, RawLayout, SampleType, Volume, read as read_whole};

    fn joined(path: &Path, options: &ReadOptions, planes: usize) -> Result<(Volume, VolumeSource), VolumeError> {
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
        #![proptest_config(hlacdb_testing::cases(48))]

        /// Every type, byte order, number of channels, rule and size of slabs: voxels and mapping are those of the whole.
        #[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
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
            let options = ReadOptions::new().intensity(rule);
            prop_assert!(joined(&path, &options, planes).unwrap() == read_whole(&path, &options).unwrap());
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
            let options = ReadOptions::new().intensity(intensity).raw(layout);
            assert!(joined(&path, &options, 4).unwrap() == read_whole(&path, &options).unwrap(), "{intensity}");
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
            let options = ReadOptions::new().intensity(intensity).raw(layout);
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

    #[cfg_attr(not(feature = "gzip"), ignore = "needs gzip")]
    #[test]
    fn a_truncated_or_damaged_file_fails_as_it_does_whole() {
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
            let options = ReadOptions::new().intensity(Intensity::Window { lo: 0.0, hi: 9.0 });
            let slabs = joined(&path, &options, 7).unwrap_err();
            assert_eq!(slabs.to_string(), read_whole(&path, &options).unwrap_err().error.to_string(), "{name}");
            assert!(matches!(slabs, VolumeError::Truncated { .. } | VolumeError::Decode { .. }), "{name}: {slabs}");
        }
    }

    #[test]
    fn the_memory_of_a_slab_is_bounded() {
        let folder = Folder::new();
        let path = folder.write("a.raw", vec![7; 40 * 10 * 10 * 2]);
        let layout = RawLayout { shape: [40, 10, 10], samples: SampleType::U16, endian: Endian::Little, offset: 0 };
        let options = ReadOptions::new().raw(layout);
        let reader = SlabReader::open(&path, &options).unwrap().unwrap();
        assert_eq!((reader.bytes(), reader.source().format), (8000, "raw"));
        let planes = [0, 599, 1200, 6000, u64::MAX].map(|memory| reader.planes_within(memory));
        assert_eq!(planes, [1, 1, 2, 10, 40]);
        let limited = SlabReader::open(&path, &options.max_voxels(3999)).unwrap_err();
        assert!(matches!(limited.error, VolumeError::TooLarge { .. }), "{limited}");
    }
}
