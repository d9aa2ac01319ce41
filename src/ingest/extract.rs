//! The HLAC sums of files, without a store.
//!
//! Files are described in parallel. A file whose decoded samples are larger than [`ExtractOptions::slab_memory`] is read
//! slab by slab, with the same result.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::{Serialize, Serializer};

use crate::error::Error;
use crate::hlac::{
    self, ExtractError, Extraction, MASK_COUNT, MaskSpacing, RegionSlabExtractor, RegionSums, SlabExtractor, Sums,
    Voxels,
};
use crate::progress::Progress;
use crate::volume::{self, Intensity, ReadError, ReadOptions, Shape, SlabReader, Volume, display_path};

/// The default of [`ExtractVariant::Sampled::windows`].
pub const SAMPLED_WINDOWS: u64 = 10_000;

/// The most memory for reading and describing one slab, however much is allowed (but at least one plane).
const MAX_SLAB_BYTES: u64 = 256 << 20;

/// Which sums [`extract_files`] computes.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ExtractVariant {
    /// The exact sums over all windows: the descriptor that a store keeps.
    Exact {
        /// The distance between the cells of a window.
        spacing: MaskSpacing,
        /// A volume of the same shape: only windows whose cells all lie where it is not 0 count.
        region: Option<PathBuf>,
    },
    /// The sums over random windows, as in the paper.
    Sampled {
        /// How many windows; `None` takes [`SAMPLED_WINDOWS`], or all there are.
        windows: Option<u64>,
        /// The seed of the random windows.
        seed: u64,
    },
    /// Over all windows, the sum of the intensities of a mask's cells where all of them are above 0.
    HitSum,
}

impl Default for ExtractVariant {
    fn default() -> Self {
        Self::Exact { spacing: MaskSpacing::One, region: None }
    }
}

/// How [`extract_files`] reads files and which sums it computes.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ExtractOptions {
    /// How files are read.
    pub reading: ReadOptions,
    /// Which sums are computed.
    pub variant: ExtractVariant,
    /// Files with more bytes of decoded samples are read in slabs of at most this size (at least one plane). Only exact
    /// sums can be computed slab by slab, and only for formats that store samples in the order of Z.
    pub slab_memory: u64,
}

impl ExtractOptions {
    /// The default of [`ExtractOptions::slab_memory`]: 1 GiB.
    pub const SLAB_MEMORY: u64 = 1 << 30;

    /// Exact sums.
    pub fn new() -> Self {
        Self::default()
    }

    /// Reads files like this.
    #[must_use]
    pub fn reading(self, reading: ReadOptions) -> Self {
        Self { reading, ..self }
    }

    /// Computes these sums.
    #[must_use]
    pub fn variant(self, variant: ExtractVariant) -> Self {
        Self { variant, ..self }
    }

    /// Reads files with more bytes of decoded samples in slabs.
    #[must_use]
    pub fn slab_memory(self, bytes: u64) -> Self {
        Self { slab_memory: bytes, ..self }
    }
}

impl Default for ExtractOptions {
    fn default() -> Self {
        let (reading, variant) = (ReadOptions::default(), ExtractVariant::default());
        Self { reading, variant, slab_memory: Self::SLAB_MEMORY }
    }
}

/// The sums of one file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ExtractedFile {
    /// The file, escaped where it is not UTF-8.
    pub path: String,
    /// Axis lengths (Z, Y, X).
    pub shape: Shape,
    /// The file's channels: 1 or 3.
    pub channels: usize,
    /// The number of windows.
    pub windows: u64,
    /// How long the sums took, without reading.
    #[serde(rename = "elapsed_us", serialize_with = "microseconds")]
    pub elapsed: Duration,
    /// The sum of each of the 251 masks.
    pub sums: Vec<u64>,
    /// The moment of each mask, from 0 to 1.
    pub moments: Vec<f64>,
    /// The number of windows of each mask that lie in the region; `None` without a region.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub counts: Option<Vec<u64>>,
}

fn microseconds<S: Serializer>(time: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(u64::try_from(time.as_micros()).unwrap_or(u64::MAX))
}

/// A file without sums.
#[derive(Debug)]
#[non_exhaustive]
pub struct FailedExtraction {
    /// The file.
    pub path: PathBuf,
    /// Why.
    pub error: ExtractFileError,
}

/// Why a file has no sums.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExtractFileError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The sums cannot be computed.
    #[error("{}: {error}", display_path(path))]
    Extract {
        /// The file.
        path: PathBuf,
        /// Why.
        error: ExtractError,
    },
    /// The region has colour.
    #[error("{}: the region has {channels} channels; expected a grey volume", display_path(path))]
    ColorRegion {
        /// The region's file.
        path: PathBuf,
        /// Its channels.
        channels: usize,
    },
}

/// What [`extract_files`] computed.
#[derive(Debug)]
#[non_exhaustive]
pub struct ExtractReport {
    /// The files with sums, in input order.
    pub files: Vec<ExtractedFile>,
    /// The files without sums, in input order.
    pub failed: Vec<FailedExtraction>,
    /// Whether the caller stopped it: some files are neither among `files` nor among `failed`.
    pub cancelled: bool,
}

/// Computes the sums of every file, in parallel. A bad file is reported among [`ExtractReport::failed`].
///
/// # Errors
/// [`ReadError`] where the region cannot be read.
pub fn extract_files(
    paths: &[PathBuf],
    options: &ExtractOptions,
    progress: &dyn Progress,
) -> Result<ExtractReport, Error> {
    let region = match &options.variant {
        ExtractVariant::Exact { region: Some(path), .. } => Some(Region::read(path, &options.reading)?),
        _ => None,
    };
    // Many files occupy the cores by themselves; one file is shared among them.
    let job = Job { options, region, parallel: paths.len() == 1, progress };
    progress.begin("extracting", Some(paths.len() as u64));
    let results: Vec<Result<ExtractedFile, Stop>> = paths
        .par_iter()
        .map(|path| {
            let result = job.extract(path);
            progress.advance(1);
            result
        })
        .collect();
    let mut report = ExtractReport { files: Vec::new(), failed: Vec::new(), cancelled: progress.cancelled() };
    for (path, result) in paths.iter().zip(results) {
        match result {
            Ok(file) => report.files.push(file),
            Err(Stop::Failed(error)) => report.failed.push(FailedExtraction { path: path.clone(), error }),
            Err(Stop::Cancelled) => {}
        }
    }
    Ok(report)
}

/// Why the work on a file ended without sums.
enum Stop {
    Failed(ExtractFileError),
    Cancelled,
}

impl From<ExtractFileError> for Stop {
    fn from(error: ExtractFileError) -> Self {
        Self::Failed(error)
    }
}

impl From<ReadError> for Stop {
    fn from(error: ReadError) -> Self {
        Self::Failed(error.into())
    }
}

/// A volume whose non-zero voxels are the region.
struct Region {
    path: PathBuf,
    volume: Volume,
}

impl Region {
    /// Every voxel that is not 0 becomes 255, whether it was 1 of 65535 or -1.
    fn read(path: &Path, reading: &ReadOptions) -> Result<Self, ReadError> {
        let reading = reading.intensity(Intensity::NonZero);
        Ok(Self { path: path.into(), volume: volume::read(path, &reading)?.0 })
    }
}

/// What all files share.
struct Job<'a> {
    options: &'a ExtractOptions,
    region: Option<Region>,
    parallel: bool,
    progress: &'a dyn Progress,
}

impl Job<'_> {
    fn extract(&self, path: &Path) -> Result<ExtractedFile, Stop> {
        if self.progress.cancelled() {
            return Err(Stop::Cancelled);
        }
        if let Some(Region { path, volume }) = self.region.as_ref().filter(|region| region.volume.channels() != 1) {
            return Err(ExtractFileError::ColorRegion { path: path.clone(), channels: volume.channels() }.into());
        }
        let failed = |error| ExtractFileError::Extract { path: path.into(), error };
        if let ExtractVariant::Exact { spacing, .. } = self.options.variant {
            let reader = SlabReader::open(path, &self.options.reading)?;
            if let Some(reader) = reader.filter(|reader| reader.bytes() > self.options.slab_memory) {
                return self.extract_slabs(path, reader, spacing);
            }
        }
        let (volume, _) = volume::read(path, &self.options.reading)?;
        let start = Instant::now();
        let answer = self.whole(&volume).map_err(failed)?;
        Ok(answer.of_file(path, volume.shape(), volume.channels(), start.elapsed()))
    }

    /// The sums of a volume in memory.
    fn whole(&self, volume: &Volume) -> Result<Answer, ExtractError> {
        let grey = volume.luma();
        let voxels = Voxels::new(grey.voxels(), grey.shape())?;
        Ok(match (&self.options.variant, &self.region) {
            (&ExtractVariant::Exact { spacing, .. }, None) => {
                Answer::of(&self.extraction(spacing).sums(voxels)?.total())
            }
            (&ExtractVariant::Exact { spacing, .. }, Some(region)) => {
                let region = Voxels::new(region.volume.voxels(), region.volume.shape())?;
                let sums = self.extraction(spacing).sums_in(voxels, region)?.total();
                Answer::within(&sums, spacing.windows(volume.shape()))
            }
            (&ExtractVariant::Sampled { windows, seed }, _) => {
                let all = MaskSpacing::One.windows(volume.shape());
                Answer::of(&hlac::extract_sampled(voxels, windows.unwrap_or(all.min(SAMPLED_WINDOWS)), seed)?)
            }
            (ExtractVariant::HitSum, _) => {
                let sums = hlac::extract_hit_sum(voxels);
                Answer { windows: sums.windows, sums: sums.values, moments: sums.moments(), counts: None }
            }
        })
    }

    /// The sums of a volume that is read slab by slab.
    fn extract_slabs(&self, path: &Path, mut reader: SlabReader, spacing: MaskSpacing) -> Result<ExtractedFile, Stop> {
        let failed = |error| ExtractFileError::Extract { path: path.into(), error };
        let mut slabs = self.slabs(reader.shape(), spacing).map_err(failed)?;
        let planes = reader.planes_within(self.options.slab_memory.min(MAX_SLAB_BYTES));
        let mut elapsed = Duration::ZERO;
        while let Some(slab) = reader.read(planes)? {
            if self.progress.cancelled() {
                return Err(Stop::Cancelled);
            }
            let start = Instant::now();
            slabs.push(slab.first, &slab.grey()).map_err(failed)?;
            elapsed += start.elapsed();
        }
        let start = Instant::now();
        let answer = slabs.finish().map_err(failed)?;
        elapsed += start.elapsed();
        Ok(answer.of_file(path, reader.shape(), reader.channels(), elapsed))
    }

    fn extraction(&self, spacing: MaskSpacing) -> Extraction {
        Extraction::new().spacing(spacing).parallel(self.parallel)
    }

    fn slabs(&self, shape: Shape, spacing: MaskSpacing) -> Result<Slabs<'_>, ExtractError> {
        let Some(Region { volume: region, .. }) = &self.region else {
            return Ok(Slabs::All(self.extraction(spacing).slabs(shape)?));
        };
        if region.shape() != shape {
            return Err(ExtractError::RegionShape { volume: shape, region: region.shape() });
        }
        let extractor = self.extraction(spacing).region_slabs(shape)?;
        Ok(Slabs::Within { extractor, region, windows: spacing.windows(shape) })
    }
}

/// The sums of the slabs pushed so far: of the whole volume, or within a region.
enum Slabs<'a> {
    All(SlabExtractor),
    Within { extractor: RegionSlabExtractor, region: &'a Volume, windows: u64 },
}

impl Slabs<'_> {
    /// Adds the next planes; `first` is the Z of the first one.
    fn push(&mut self, first: usize, planes: &[u8]) -> Result<(), ExtractError> {
        match self {
            Self::All(extractor) => extractor.push(planes),
            Self::Within { extractor, region, .. } => {
                let start = first * region.shape()[1] * region.shape()[2];
                extractor.push(planes, region.voxels().get(start..start + planes.len()).unwrap_or_default())
            }
        }
    }

    fn finish(self) -> Result<Answer, ExtractError> {
        Ok(match self {
            Self::All(extractor) => Answer::of(&extractor.finish()?.total()),
            Self::Within { extractor, windows, .. } => Answer::within(&extractor.finish()?.total(), windows),
        })
    }
}

/// The sums of a volume, whichever variant they are of.
struct Answer {
    windows: u64,
    sums: [u64; MASK_COUNT],
    moments: [f64; MASK_COUNT],
    counts: Option<[u64; MASK_COUNT]>,
}

impl Answer {
    fn of(sums: &Sums) -> Self {
        Self { windows: sums.windows, sums: sums.values, moments: sums.moments(), counts: None }
    }

    /// The sums within a region; `windows` counts those of the whole volume.
    fn within(sums: &RegionSums, windows: u64) -> Self {
        Self { windows, sums: sums.values, moments: sums.moments(), counts: Some(sums.windows) }
    }

    fn of_file(&self, path: &Path, shape: Shape, channels: usize, elapsed: Duration) -> ExtractedFile {
        ExtractedFile {
            path: display_path(path),
            shape,
            channels,
            windows: self.windows,
            elapsed,
            sums: self.sums.to_vec(),
            moments: self.moments.to_vec(),
            counts: self.counts.map(|counts| counts.to_vec()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arrays;

    fn files(volumes: &[Volume]) -> (tempfile::TempDir, Vec<PathBuf>) {
        let folder = tempfile::tempdir().unwrap();
        let paths: Vec<PathBuf> = (0..volumes.len()).map(|n| folder.path().join(format!("{n}.npy"))).collect();
        for (path, volume) in paths.iter().zip(volumes) {
            arrays::write_volume(path, volume).unwrap();
        }
        (folder, paths)
    }

    fn noise(shape: Shape, factor: usize) -> Volume {
        Volume::from_fn(shape, |z, y, x| ((z * 31 + y * 17 + x * 7) * factor % 251) as u8).unwrap()
    }

    fn exact(region: Option<&Path>) -> ExtractVariant {
        ExtractVariant::Exact { spacing: MaskSpacing::One, region: region.map(Into::into) }
    }

    #[test]
    fn files_come_in_order_and_bad_ones_are_reported() {
        let volumes = [noise([9, 8, 7], 3), noise([7, 7, 7], 5)];
        let (_folder, mut paths) = files(&volumes);
        paths.insert(1, paths[0].with_file_name("none.npy"));
        let report = extract_files(&paths, &ExtractOptions::new(), &()).unwrap();
        let shapes: Vec<Shape> = report.files.iter().map(|file| file.shape).collect();
        assert_eq!((shapes, report.failed.len(), report.cancelled), (vec![[9, 8, 7], [7, 7, 7]], 1, false));
        assert_eq!(report.failed[0].path, paths[1]);
        assert_eq!(report.files[1].sums, crate::octant_sums(&volumes[1]).total().values);
    }

    #[test]
    fn slabs_give_the_same_sums_with_and_without_a_region() {
        let (_folder, paths) = files(&[noise([20, 9, 8], 3), noise([20, 9, 8], 1)]);
        for region in [None, Some(paths[1].as_path())] {
            let options = ExtractOptions::new().variant(exact(region));
            let whole = extract_files(&paths[..1], &options, &()).unwrap();
            let slabs = extract_files(&paths[..1], &options.clone().slab_memory(200), &()).unwrap();
            let sums = |report: &ExtractReport| (report.files[0].sums.clone(), report.files[0].counts.clone());
            assert_eq!(sums(&whole), sums(&slabs));
            assert_eq!(whole.files[0].counts.is_some(), region.is_some());
        }
    }

    #[test]
    fn a_region_must_be_readable_and_have_the_volumes_shape() {
        let (_folder, paths) = files(&[noise([9, 8, 7], 3), noise([7, 7, 7], 5)]);
        let options = ExtractOptions::new().variant(exact(Some(&paths[1])));
        for slab_memory in [1, u64::MAX] {
            let report = extract_files(&paths[..1], &options.clone().slab_memory(slab_memory), &()).unwrap();
            let error = &report.failed[0].error;
            assert!(
                matches!(error, ExtractFileError::Extract { error: ExtractError::RegionShape { .. }, .. }),
                "{error}"
            );
        }
        let none = paths[0].with_file_name("none.npy");
        assert!(extract_files(&paths, &ExtractOptions::new().variant(exact(Some(&none))), &()).is_err());
    }

    #[test]
    fn a_cancelled_extraction_says_so() {
        struct Cancelled;
        impl Progress for Cancelled {
            fn cancelled(&self) -> bool {
                true
            }
        }
        let (_folder, paths) = files(&[noise([9, 8, 7], 3)]);
        let report = extract_files(&paths, &ExtractOptions::new(), &Cancelled).unwrap();
        assert!(report.cancelled && report.files.is_empty() && report.failed.is_empty());
    }
}
