//! What the caller says before a file is read.

use crate::{Endian, Intensity, SampleType, Shape};

/// How samples without a header lie in a file: X fastest, one channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawLayout {
    /// Axis lengths (Z, Y, X).
    pub shape: Shape,
    /// The type of the samples.
    pub samples: SampleType,
    /// Their byte order.
    pub endian: Endian,
    /// Bytes before the first sample.
    pub offset: u64,
}

/// A text that names no sample type.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{found}` is not a sample type: expected u8, i8, u16, i16, u32, i32, u64, i64, f16, f32 or f64, optionally followed by `le` (the default) or `be`, as in u16be"
)]
pub struct RawTypeError {
    /// The text.
    pub found: String,
}

impl RawLayout {
    /// The layout of samples that begin with the file.
    pub const fn new(shape: Shape, samples: SampleType, endian: Endian) -> Self {
        Self { shape, samples, endian, offset: 0 }
    }

    /// The same after `offset` bytes that are no samples.
    #[must_use]
    pub const fn offset(self, offset: u64) -> Self {
        Self { offset, ..self }
    }

    /// The type and byte order that a text such as `u8`, `u16`, `u16le` or `f32be` names; little-endian where it
    /// says nothing.
    ///
    /// ```
    /// use hlacdb_volume::{Endian, RawLayout, SampleType};
    /// assert_eq!(RawLayout::parse_type("u16be"), Ok((SampleType::U16, Endian::Big)));
    /// ```
    ///
    /// # Errors
    /// [`RawTypeError`] for any other text.
    pub fn parse_type(text: &str) -> Result<(SampleType, Endian), RawTypeError> {
        let (name, endian) = match (text.strip_suffix("le"), text.strip_suffix("be")) {
            (Some(name), _) => (name, Endian::Little),
            (_, Some(name)) => (name, Endian::Big),
            _ => (text, Endian::Little),
        };
        let ty = SampleType::from_name(name).ok_or_else(|| RawTypeError { found: text.into() })?;
        Ok((ty, endian))
    }
}

/// How files are read: the intensity rule, the limits, and the layout of files without a header.
///
/// ```
/// use hlacdb_volume::{Endian, Intensity, RawLayout, ReadOptions, SampleType};
/// let options = ReadOptions::new()
///     .intensity(Intensity::Window { lo: -1000.0, hi: 2000.0 })
///     .max_voxels(512 * 512 * 512)
///     .raw(RawLayout::new([64, 64, 64], SampleType::I16, Endian::Little));
/// assert_eq!(options.max_inflated, ReadOptions::MAX_INFLATED);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ReadOptions {
    /// How samples deeper than 8 bits become 256 levels. Default: [`Intensity::Full`].
    pub intensity: Intensity,
    /// The most voxels that a header may promise. Default: [`MAX_VOXELS`](Self::MAX_VOXELS).
    pub max_voxels: u64,
    /// Decompression limit: the samples of a compressed file that is read whole may take at most
    /// `max(max_inflated, 16 * file size)` bytes. Default: [`MAX_INFLATED`](Self::MAX_INFLATED).
    ///
    /// Ordinary scans shrink to no less than a sixteenth, so the limit only meets files that are almost empty or made to
    /// exhaust memory.
    pub max_inflated: u64,
    /// The layout of files that hold samples and nothing else. Default: `None`, the format of such files is unknown.
    pub raw: Option<RawLayout>,
}

impl ReadOptions {
    /// The default of [`max_voxels`](Self::max_voxels): 2^32.
    pub const MAX_VOXELS: u64 = 1 << 32;
    /// The default of [`max_inflated`](Self::max_inflated): 2^32 bytes.
    pub const MAX_INFLATED: u64 = 1 << 32;

    /// The defaults.
    pub const fn new() -> Self {
        Self { intensity: Intensity::Full, max_voxels: Self::MAX_VOXELS, max_inflated: Self::MAX_INFLATED, raw: None }
    }

    /// Sets how samples deeper than 8 bits become 256 levels.
    #[must_use]
    pub const fn intensity(self, intensity: Intensity) -> Self {
        Self { intensity, ..self }
    }

    /// Sets the most voxels that a header may promise.
    #[must_use]
    pub const fn max_voxels(self, voxels: u64) -> Self {
        Self { max_voxels: voxels, ..self }
    }

    /// Sets the decompression limit in bytes.
    #[must_use]
    pub const fn max_inflated(self, bytes: u64) -> Self {
        Self { max_inflated: bytes, ..self }
    }

    /// Sets the layout of files that hold samples and nothing else: files named `.raw`, `.bin` or `.dat`, and files whose
    /// format is not recognised.
    #[must_use]
    pub const fn raw(self, layout: RawLayout) -> Self {
        Self { raw: Some(layout), ..self }
    }
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self::new()
    }
}
