//! Reading volumes whole, in boxes and in slabs: written once for all formats.

mod slabs;

use std::fmt;
use std::path::{Path, PathBuf};

use crate::formats::{self, Access, FormatInfo, VolumeHeader, VolumeReader};
use crate::layout::check_inflated;
use crate::rescaling::{self, Rescaler};
use crate::samples::{self, drop_alpha, kept_channels, not_finite};
use crate::{MIN_SIDE, Mapping, ReadError, ReadOptions, SampleType, Shape, Volume, VolumeError, VoxelSpacing};

pub use slabs::{SlabReader, VolumeSlab};

/// What is known of the origin of a volume.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct VolumeSource {
    /// The [name](FormatInfo::name) of the file format; `synthetic` for volumes that a program made.
    pub format: &'static str,
    /// The type of the samples in the file. Truth values are `u8`.
    pub samples: SampleType,
    /// How the samples became 256 levels; `None` if they were taken as they are.
    pub mapping: Option<Mapping>,
    /// The distance between voxels; `None` if the file does not give one.
    pub spacing: Option<VoxelSpacing>,
}

impl VolumeSource {
    /// The origin of a volume that a program made.
    pub const SYNTHETIC: Self = Self { format: "synthetic", samples: SampleType::U8, mapping: None, spacing: None };
}

/// Reads a file or a folder of slices whole, and returns the volume and what is known of its origin.
///
/// The format is recognised by the content, and by the name only if the content is inconclusive. Axes become (Z, Y, X)
/// with X fastest, whatever the order of the format. Nothing beyond what the header promises is decoded, and a file that
/// is read without an error held all of it.
///
/// ```
/// use hlacdb_volume::{Endian, RawLayout, ReadOptions, SampleType, read};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("block.raw");
/// # std::fs::write(&path, [7; 9 * 5 * 4])?;
/// let layout = RawLayout::new([9, 5, 4], SampleType::U8, Endian::Little);
/// let (volume, source) = read(&path, &ReadOptions::new().raw(layout))?;
/// assert_eq!((volume.shape(), source.format), ([9, 5, 4], "raw"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ReadError`] with the path, the format, and what was wrong.
pub fn read(path: &Path, options: &ReadOptions) -> Result<(Volume, VolumeSource), ReadError> {
    VolumeFile::open(path, options)?.read()
}

/// An open file whose header has been read and checked.
///
/// ```
/// use hlacdb_volume::{ReadOptions, VolumeFile};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("scan.npy");
/// # hlacdb_volume::npy::NpyWriter::create(&path, &[40, 30, 20])?.finish_with(&vec![7_u8; 24_000])?;
/// let mut file = VolumeFile::open(&path, &ReadOptions::new())?;
/// assert_eq!(file.header().shape, [40, 30, 20]);
/// let block = file.read_block([30, 0, 10], [8, 8, 8])?;
/// assert_eq!(block.shape(), [8, 8, 8]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct VolumeFile {
    path: PathBuf,
    format: &'static FormatInfo,
    reader: Box<dyn VolumeReader>,
    /// Channels of the volume: 1 or 3.
    channels: usize,
    options: ReadOptions,
    /// How samples become levels; `None` if they are taken as they are.
    rescaler: Option<Box<dyn Rescaler>>,
}

/// The memory of a scan that no slab size bounds.
const SCAN: u64 = 64 << 20;

impl VolumeFile {
    /// Opens a file or a folder of slices and reads its header.
    ///
    /// # Errors
    /// [`ReadError`] as by [`read`], for what is wrong with the header.
    pub fn open(path: &Path, options: &ReadOptions) -> Result<Self, ReadError> {
        let format = formats::identify(path, options).map_err(|error| ReadError::new(path, error))?;
        let info = format.info();
        tracing::debug!(format = info.name, path = %path.display(), "reading");
        let reader = format.open(path, options);
        let reader = reader.map_err(|error| ReadError::new(path, error).with_format(info))?;
        Self::from_reader(path, info, reader, options)
    }

    /// The same with a reader of a format that is not in the registry.
    ///
    /// # Errors
    /// [`ReadError`] if the header of the reader promises more than the options allow, has a side of less than 3 voxels,
    /// or another number of channels than 1, 3 or 4.
    pub fn from_reader(
        path: &Path,
        format: &'static FormatInfo,
        reader: Box<dyn VolumeReader>,
        options: &ReadOptions,
    ) -> Result<Self, ReadError> {
        let checked = || {
            let VolumeHeader { shape, channels, .. } = *reader.header();
            samples::within_limit(shape.map(|side| side as u128), options.max_voxels)?;
            if shape.iter().any(|&side| side < MIN_SIDE) {
                return Err(VolumeError::TooSmall { shape });
            }
            kept_channels(channels)
        };
        let channels = checked().map_err(|error| ReadError::new(path, error).with_format(format))?;
        let VolumeHeader { shape, samples, calibration, .. } = *reader.header();
        let count = shape.iter().map(|&side| side as u64).product::<u64>() * channels as u64;
        let rescaler = rescaling::rescaler(samples, count, options.intensity, calibration);
        Ok(Self { path: path.into(), format, reader, channels, options: *options, rescaler })
    }

    /// The format of the file.
    pub fn format(&self) -> &'static FormatInfo {
        self.format
    }

    /// What the header says.
    pub fn header(&self) -> &VolumeHeader {
        self.reader.header()
    }

    /// What it costs to read a part.
    pub fn access(&self) -> Access {
        self.reader.access()
    }

    /// What is known of the origin of the volume. The mapping is known once a block or slab has been read, and before that
    /// if the intensity rule does not depend on the samples.
    pub fn source(&self) -> VolumeSource {
        let known = self.rescaler.as_ref().filter(|rescaler| !rescaler.needs_scan());
        let VolumeHeader { samples, spacing, .. } = *self.header();
        VolumeSource { format: self.format.name, samples, mapping: known.map(|rescaler| rescaler.mapping()), spacing }
    }

    /// Reads the whole volume, in the memory of its samples.
    ///
    /// # Errors
    /// [`ReadError`] as by [`read`](fn@read).
    pub fn read(mut self) -> Result<(Volume, VolumeSource), ReadError> {
        let (volume, mapping) = self.read_whole().map_err(|error| self.failed(error))?;
        Ok((volume, VolumeSource { mapping, ..self.source() }))
    }

    fn read_whole(&mut self) -> Result<(Volume, Option<Mapping>), VolumeError> {
        let header = *self.reader.header();
        self.check_inflated(header.bytes())?;
        let mut bytes = Vec::new();
        self.read_samples(0, header.shape[0], &mut bytes)?;
        let mapping = match &mut self.rescaler {
            Some(rescaler) => {
                let rescaled = rescaling::rescale_all(rescaler.as_mut(), &mut bytes);
                Some(rescaled.map_err(|bad| not_finite(bad, header.shape, self.channels))?)
            }
            None => None,
        };
        bytes.shrink_to_fit();
        Ok((Volume::new(header.shape, self.channels, bytes)?, mapping))
    }

    /// Reads the box of `shape` voxels (Z, Y, X) whose first voxel is at `origin`.
    ///
    /// The voxels are those of the same box of the whole volume. Under [`Intensity::Full`](crate::Intensity::Full) and [`Intensity::Auto`](crate::Intensity::Auto) the first
    /// block scans the whole file for the range of its samples; otherwise only the box is read, so that samples outside it
    /// that are not finite go unnoticed. What a box costs depends on the [`Access`] of the file; under [`Access::Whole`] a
    /// scan takes the memory of all samples.
    ///
    /// # Errors
    /// [`ReadError`] as by [`read`](fn@read), with [`VolumeError::OutsideVolume`] for a box that does not lie inside, and
    /// [`VolumeError::TooSmall`] for one with a side of less than 3 voxels.
    pub fn read_block(&mut self, origin: Shape, shape: Shape) -> Result<Volume, ReadError> {
        self.block(origin, shape).map_err(|error| self.failed(error))
    }

    fn block(&mut self, origin: Shape, shape: Shape) -> Result<Volume, VolumeError> {
        let volume = self.header().shape;
        let inside = |axis: usize| origin[axis].checked_add(shape[axis]).is_some_and(|end| end <= volume[axis]);
        if !(0..3).all(inside) {
            return Err(VolumeError::OutsideVolume { origin, shape, volume });
        }
        if shape.iter().any(|&side| side < MIN_SIDE) {
            return Err(VolumeError::TooSmall { shape });
        }
        self.check_part(self.header().bytes())?;
        let planes = usize::try_from(SCAN / self.header().plane_bytes().max(1)).unwrap_or(usize::MAX).max(1);
        self.scan(planes, &mut Vec::new())?;
        let mut voxels = Vec::new();
        self.reader.read_block(origin, shape, &mut voxels)?;
        self.drop_alpha(&mut voxels);
        if let Some(rescaler) = &mut self.rescaler {
            let place = |bad| not_finite(bad, shape, self.channels);
            rescaler.apply(&mut voxels, 0).map_err(|bad| shifted(place(bad), origin))?;
        }
        Volume::new(shape, self.channels, voxels)
    }

    /// Scans the file until it is known how samples become levels, `planes` planes at a time.
    fn scan(&mut self, planes: usize, buffer: &mut Vec<u8>) -> Result<(), VolumeError> {
        let [depth, height, width] = self.header().shape;
        // Where any planes cost as much as all of them, all are read at once.
        let planes = if self.access() == Access::Whole { depth } else { planes };
        while self.rescaler.as_ref().is_some_and(|rescaler| rescaler.needs_scan()) {
            for first in (0..depth).step_by(planes.max(1)) {
                self.read_samples(first, planes.min(depth - first), buffer)?;
                let before = (first * height * width * self.channels) as u64;
                if let Some(rescaler) = &mut self.rescaler {
                    let scanned = rescaler.scan(buffer, before);
                    scanned.map_err(|bad| not_finite(bad, [depth, height, width], self.channels))?;
                }
            }
            if let Some(rescaler) = &mut self.rescaler {
                rescaler.end_scan();
            }
        }
        Ok(())
    }

    /// Replaces the buffer by the samples of some planes, little-endian and without an alpha.
    fn read_samples(&mut self, first: usize, planes: usize, buffer: &mut Vec<u8>) -> Result<(), VolumeError> {
        buffer.clear();
        self.reader.read_planes(first..first + planes, buffer)?;
        let expected = u128::from(self.header().plane_bytes()) * planes as u128;
        if buffer.len() as u128 != expected {
            return Err(VolumeError::Length { expected, found: buffer.len() as u64 });
        }
        self.drop_alpha(buffer);
        Ok(())
    }

    fn drop_alpha(&self, bytes: &mut Vec<u8>) {
        if self.header().channels == 4 {
            drop_alpha(bytes, self.header().samples);
        }
    }

    /// Checks the memory of samples that are decoded all at once.
    fn check_inflated(&self, bytes: u64) -> Result<(), VolumeError> {
        match self.reader.compressed_bytes() {
            Some(length) => check_inflated(bytes.into(), length, self.options.max_inflated),
            None => Ok(()),
        }
    }

    /// As [`check_inflated`](Self::check_inflated), where a part takes the memory of the whole.
    fn check_part(&self, bytes: u64) -> Result<(), VolumeError> {
        if self.access() == Access::Whole { self.check_inflated(bytes) } else { Ok(()) }
    }

    fn failed(&self, error: VolumeError) -> ReadError {
        ReadError::new(&self.path, error).with_format(self.format)
    }
}

/// An error of a sample in a block, by its place in the volume.
fn shifted(error: VolumeError, origin: Shape) -> VolumeError {
    match error {
        VolumeError::NotFinite { value, position } => {
            VolumeError::NotFinite { value, position: [0, 1, 2].map(|axis| position[axis] + origin[axis]) }
        }
        other => other,
    }
}

impl fmt::Debug for VolumeFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut debug = f.debug_struct("VolumeFile");
        debug.field("path", &self.path).field("format", &self.format.name).field("header", self.header());
        debug.finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Folder, encode, gzip, samples, volume};
    use crate::{Endian, SampleType};

    fn nrrd() -> Vec<u8> {
        let header = b"NRRD0001\ntype: uchar\ndimension: 3\nsizes: 5 4 3\nencoding: raw\n\n";
        [&header[..], &encode(&samples(), SampleType::U8, Endian::Little)].concat()
    }

    #[test]
    fn content_goes_before_the_name() {
        let folder = Folder::new();
        for name in ["a.nrrd", "a.npy", "a.nii.gz", "a.xyz", "a", "a.mha", ".hidden"] {
            let (found, source) = folder.read(name, nrrd()).unwrap();
            assert_eq!((found, source.format), (volume(), "nrrd"), "{name}");
        }
    }

    #[cfg_attr(not(all(feature = "gzip", feature = "npz")), ignore = "needs gzip and npz")]
    #[test]
    fn the_name_decides_if_the_content_is_inconclusive() {
        let folder = Folder::new();
        for (name, expected) in [
            ("a.npy", "a NumPy array begins with"),
            ("a.NPZ", "the zip archive cannot be decoded"),
            ("a.nrrd", "a NRRD begins with"),
            ("a.mha", "every line of it should be `Key = value`"),
            ("a.nii", "a NIfTI header begins with"),
            ("a.txt", "the file format is not recognised: the file begins with \"some tex\""),
        ] {
            let error = folder.read(name, b"some text\n\n").unwrap_err().to_string();
            assert!(error.contains(expected), "{name}: {error}");
        }
        let empty = folder.read("empty", b"").unwrap_err().to_string();
        assert!(empty.contains("the file is empty"), "{empty}");
        assert!(matches!(folder.read("a.gz", gzip(b"no NIfTI")), Err(VolumeError::UnknownFormat { .. })));
    }

    #[test]
    fn an_error_names_the_file_and_its_causes() {
        let folder = Folder::new();
        let error = read(&folder.path().join("none\n.npy"), &ReadOptions::default()).unwrap_err();
        assert!(error.to_string().ends_with("none\\n.npy: opening the file failed"), "{error}");
        let cause = std::error::Error::source(&error).unwrap();
        assert!(cause.downcast_ref::<std::io::Error>().is_some(), "{cause}");
    }

    #[test]
    fn the_limit_is_that_of_the_options() {
        let folder = Folder::new();
        let path = folder.write("a.nrrd", nrrd());
        let limited = |max_voxels| read(&path, &ReadOptions::new().max_voxels(max_voxels));
        assert!(limited(60).is_ok());
        let error = limited(59).unwrap_err().error;
        assert!(matches!(error, VolumeError::TooLarge { voxels: 60, limit: 59 }), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_devices_are_refused_without_waiting() {
        let folder = Folder::new();
        let pipe = folder.path().join("pipe.npy");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        if made.is_ok_and(|status| status.success()) {
            let error = read(&pipe, &ReadOptions::default()).unwrap_err().error;
            assert!(matches!(error, VolumeError::NotAFile), "{error}");
        }
        let error = read(Path::new("/dev/zero"), &ReadOptions::default()).unwrap_err().error;
        assert!(matches!(error, VolumeError::NotAFile), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_name_that_is_not_utf_8_is_a_name() {
        use std::os::unix::ffi::OsStrExt;
        let folder = Folder::new();
        let odd = std::ffi::OsStr::from_bytes(b"odd\xff.nhdr");
        let path = folder.path().join(odd);
        std::fs::write(&path, nrrd()).unwrap();
        assert_eq!(read(&path, &ReadOptions::default()).unwrap().0, volume());
        let error = read(&path.with_extension("none"), &ReadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("odd\\xff.none"), "{error}");
    }

    /// Each feature is off in some build: the error names it, and the registry keeps the format.
    #[test]
    fn formats_that_are_compiled_out_say_so() {
        let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
        for (path, name, feature) in [
            (fixtures.join("volumes/u8_stored.npz"), "npz", cfg!(feature = "npz")),
            (fixtures.join("pictures/plain.tif"), "tiff", cfg!(feature = "tiff")),
            (fixtures.join("pictures/png"), "images", cfg!(feature = "images")),
            (fixtures.join("volumes/u8_pynrrd_bzip2.nrrd"), "bzip2", cfg!(feature = "bzip2")),
            (fixtures.join("volumes/u8_nifti1_gz.nii.gz"), "gzip", cfg!(feature = "gzip")),
        ] {
            match read(&path, &ReadOptions::new()) {
                Ok(_) => assert!(feature, "{name}"),
                Err(error) => {
                    assert!(!feature, "{error}");
                    assert!(error.to_string().contains(&format!("lacks the feature `{name}`")), "{error}");
                }
            }
        }
        assert!(["tiff", "npz", "vox"].into_iter().all(|name| crate::formats::find(name).is_some()));
    }
}
