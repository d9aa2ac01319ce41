//! [`Samples`]: what a reader has decoded, and how it becomes a [`Volume`].
//!
//! The bytes are never widened: the range is found and the levels are written by passing over the bytes as the file
//! stored them, and the voxels end up at the front of the same allocation. So the largest memory a volume takes is what
//! its samples take.
//!
//! Invariant of what comes out: every sample was finite, `u8` samples are untouched, and the mapping that is returned
//! reproduces the levels.

use std::fmt;
use std::str::FromStr;

use half::f16;

use super::{Intensity, Mapping, Shape, Volume, VolumeError};

/// The type of the samples in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SampleType {
    /// Unsigned, 8 bits.
    U8,
    /// Signed, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Signed, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Signed, 32 bits.
    I32,
    /// Unsigned, 64 bits.
    U64,
    /// Signed, 64 bits.
    I64,
    /// Floating point, 16 bits (IEEE 754 binary16).
    F16,
    /// Floating point, 32 bits.
    F32,
    /// Floating point, 64 bits.
    F64,
}

impl SampleType {
    /// Every type.
    pub const ALL: [Self; 11] = [
        Self::U8,
        Self::I8,
        Self::U16,
        Self::I16,
        Self::U32,
        Self::I32,
        Self::U64,
        Self::I64,
        Self::F16,
        Self::F32,
        Self::F64,
    ];

    /// The name, as Rust writes the type: `u8`, `i16`, `f32`, ...
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::F16 => "f16",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// Bytes of one sample.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 | Self::F16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

impl fmt::Display for SampleType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for SampleType {
    type Err = ();

    /// The type of that [`name`](Self::name).
    fn from_str(name: &str) -> Result<Self, ()> {
        Self::ALL.into_iter().find(|ty| ty.name() == name).ok_or(())
    }
}

/// Which byte of a sample comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Endian {
    /// The lowest.
    Little,
    /// The highest.
    Big,
}

impl Endian {
    /// The byte order of this machine.
    pub const NATIVE: Self = if cfg!(target_endian = "big") { Self::Big } else { Self::Little };
}

/// The number of voxels that these axis lengths promise, checked before memory is taken for them.
///
/// # Errors
/// [`VolumeError::TooLarge`] where it is over the limit.
pub(super) fn within_limit(lengths: [u128; 3], limit: u64) -> Result<u128, VolumeError> {
    let voxels = lengths.into_iter().fold(1_u128, u128::saturating_mul);
    if voxels > u128::from(limit) { Err(VolumeError::TooLarge { voxels, limit }) } else { Ok(voxels) }
}

/// Decoded samples: X fastest, channels interleaved.
#[derive(Debug, Clone)]
pub struct Samples {
    /// Axis lengths (Z, Y, X).
    pub shape: Shape,
    /// Samples per voxel: 1 (grey), 3 (RGB) or 4 (RGB and an alpha that is dropped).
    pub channels: usize,
    /// The type of each sample.
    pub ty: SampleType,
    /// The byte order of each sample.
    pub endian: Endian,
    /// `Z * Y * X * channels * ty.size()` bytes.
    pub bytes: Vec<u8>,
}

/// A linear scaling from stored samples to the file's own units: `slope * stored + intercept`.
///
/// Invariant: the slope is finite and not zero, the intercept is finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scaling {
    slope: f64,
    intercept: f64,
}

impl Scaling {
    /// Stored samples are the units.
    pub const IDENTITY: Self = Self { slope: 1.0, intercept: 0.0 };

    /// The scaling by these numbers; `None` where they are no invertible linear map.
    pub fn new(slope: f64, intercept: f64) -> Option<Self> {
        (slope.is_finite() && slope != 0.0 && intercept.is_finite()).then_some(Self { slope, intercept })
    }

    fn unit(self, stored: f64) -> f64 {
        self.slope * stored + self.intercept
    }

    fn stored(self, unit: f64) -> f64 {
        (unit - self.intercept) / self.slope
    }
}

impl Samples {
    /// The volume of these samples, and how they became 256 levels (`None` for `u8`, which is taken as it is).
    ///
    /// # Errors
    /// [`VolumeError::Length`] where the bytes do not fit shape and channels, [`VolumeError::NotFinite`] with the first
    /// bad voxel, [`VolumeError::Unsupported`] for other than 1, 3 or 4 channels, [`VolumeError::TooSmall`].
    pub fn into_volume(self, intensity: Intensity) -> Result<(Volume, Option<Mapping>), VolumeError> {
        self.into_volume_scaled(intensity, Scaling::IDENTITY)
    }

    /// As [`into_volume`](Self::into_volume), where the file's units are a linear map of the stored samples: a window is
    /// given and the mapping is recorded in units. (`u8` is taken as it is, scaled or not.)
    ///
    /// The window is taken back to stored samples and the levels are computed there, so that a positive scaling changes
    /// no level under [`Intensity::Full`] and [`Intensity::Auto`], not even by rounding; a negative one turns them round.
    ///
    /// # Errors
    /// As [`into_volume`](Self::into_volume).
    pub fn into_volume_scaled(
        mut self,
        intensity: Intensity,
        scaling: Scaling,
    ) -> Result<(Volume, Option<Mapping>), VolumeError> {
        let kept = match self.channels {
            1 => 1,
            3 | 4 => 3,
            other => {
                return Err(VolumeError::Unsupported {
                    what: format!("a volume of {other} channels"),
                    supported: "1 channel (grey), 3 (RGB) or 4 (RGB and alpha)".into(),
                });
            }
        };
        let samples = self.shape.iter().map(|&side| side as u128).product::<u128>() * self.channels as u128;
        let expected = samples * self.ty.size() as u128;
        if expected != self.bytes.len() as u128 {
            return Err(VolumeError::Length { expected, found: self.bytes.len() as u64 });
        }
        self.drop_alpha();
        let mapping = match self.ty {
            SampleType::U8 => None,
            SampleType::I8 => Some(self.levels::<i8, 1>(intensity, scaling)?),
            SampleType::U16 => Some(self.levels::<u16, 2>(intensity, scaling)?),
            SampleType::I16 => Some(self.levels::<i16, 2>(intensity, scaling)?),
            SampleType::U32 => Some(self.levels::<u32, 4>(intensity, scaling)?),
            SampleType::I32 => Some(self.levels::<i32, 4>(intensity, scaling)?),
            SampleType::U64 => Some(self.levels::<u64, 8>(intensity, scaling)?),
            SampleType::I64 => Some(self.levels::<i64, 8>(intensity, scaling)?),
            SampleType::F16 => Some(self.levels::<f16, 2>(intensity, scaling)?),
            SampleType::F32 => Some(self.levels::<f32, 4>(intensity, scaling)?),
            SampleType::F64 => Some(self.levels::<f64, 8>(intensity, scaling)?),
        };
        self.bytes.shrink_to_fit();
        Ok((Volume::new(self.shape, kept, self.bytes)?, mapping))
    }

    /// Moves the colours of RGBA samples together, in place.
    fn drop_alpha(&mut self) {
        if self.channels != 4 {
            return;
        }
        let (from, to) = (4 * self.ty.size(), 3 * self.ty.size());
        let voxels = self.bytes.len() / from;
        for voxel in 0..voxels {
            self.bytes.copy_within(voxel * from..voxel * from + to, voxel * to);
        }
        self.bytes.truncate(voxels * to);
        self.channels = 3;
    }

    /// Writes the level of every sample to the front of the bytes.
    fn levels<T: Sample<N>, const N: usize>(
        &mut self,
        intensity: Intensity,
        scaling: Scaling,
    ) -> Result<Mapping, VolumeError> {
        if self.endian == Endian::Big {
            self.bytes.as_chunks_mut::<N>().0.iter_mut().for_each(|bytes| bytes.reverse());
            self.endian = Endian::Little;
        }
        let (low, high) = self.range::<T, N>()?;
        let (low, high) = if intensity == Intensity::Auto { self.percentiles::<T, N>() } else { (low, high) };
        // The range in stored samples, the recorded one in units.
        let ((from, to), (lo, hi)) = match intensity {
            Intensity::Window { lo, hi } => ((scaling.stored(lo), scaling.stored(hi)), (lo, hi)),
            Intensity::Full | Intensity::Auto => {
                let (from, to) = if scaling.slope > 0.0 { (low, high) } else { (high, low) };
                ((from, to), (scaling.unit(from), scaling.unit(to)))
            }
        };
        self.write_levels::<T, N>(&Levels::new(from, to));
        Ok(Mapping { rule: intensity, lo, hi })
    }

    /// The samples, in the order of the file; their bytes must be little-endian.
    fn iter<T: Sample<N>, const N: usize>(&self) -> impl Iterator<Item = T> {
        self.bytes.as_chunks::<N>().0.iter().map(|&bytes| T::from_le(bytes))
    }

    /// The lowest and the highest sample, all of them having been found finite.
    fn range<T: Sample<N>, const N: usize>(&self) -> Result<(f64, f64), VolumeError> {
        let (mut low, mut high) = (u64::MAX, 0);
        let mut finite = true;
        for sample in self.iter::<T, N>() {
            let key = sample.key();
            (low, high) = (low.min(key), high.max(key));
            finite &= sample.is_finite();
        }
        if finite { Ok((T::of_key(low), T::of_key(high))) } else { Err(self.first_bad::<T, N>()) }
    }

    fn first_bad<T: Sample<N>, const N: usize>(&self) -> VolumeError {
        let bad = self.iter::<T, N>().enumerate().find(|(_, sample)| !sample.is_finite());
        let (index, value) = bad.map_or((0, f64::NAN), |(index, sample)| (index, T::of_key(sample.key())));
        let voxel = index / self.channels;
        let [_, height, width] = self.shape;
        VolumeError::NotFinite { value, position: [voxel / width / height, voxel / width % height, voxel % width] }
    }

    /// The samples at the ranks that [`Intensity::Auto`] names.
    ///
    /// Radix selection: the samples' keys, which order as the samples do, are counted by 16 bits at a time, from the
    /// highest; one pass over the bytes per 16 bits, and 65 536 counters of memory, whatever the volume's size.
    fn percentiles<T: Sample<N>, const N: usize>(&self) -> (f64, f64) {
        let count = (self.bytes.len() / N) as u64;
        let ranks = [count.div_ceil(1000), (u128::from(count) * 999).div_ceil(1000) as u64];
        let [lo, hi] = ranks.map(|rank| T::of_key(self.ranked::<T, N>(rank)));
        (lo, hi)
    }

    /// The key of the sample at a rank, counted from 1.
    fn ranked<T: Sample<N>, const N: usize>(&self, mut rank: u64) -> u64 {
        const DIGIT: u32 = 16;
        let mut counts = vec![0_u64; 1 << DIGIT];
        let mut prefix = 0;
        let mut shift = (8 * N as u32).next_multiple_of(DIGIT);
        while shift > 0 {
            let above = shift;
            shift -= DIGIT;
            counts.fill(0);
            for key in self.iter::<T, N>().map(Sample::key) {
                if key.checked_shr(above).unwrap_or(0) == prefix {
                    counts[(key >> shift) as usize & ((1 << DIGIT) - 1)] += 1;
                }
            }
            let mut digit = 0;
            for (value, &count) in counts.iter().enumerate() {
                digit = value as u64;
                if rank <= count {
                    break;
                }
                rank -= count;
            }
            prefix = prefix << DIGIT | digit;
        }
        prefix
    }

    /// In place: sample `i` begins at byte `i * N`, which is not before byte `i`, where its level goes.
    fn write_levels<T: Sample<N>, const N: usize>(&mut self, levels: &Levels) {
        let count = self.bytes.len() / N;
        // Of few possible samples each is mapped once: a division per sample is what costs.
        let table: Vec<u8> = if N <= 2 && count >= 1 << 16 {
            (0..1_u64 << (8 * N)).map(|key| levels.of(T::of_key(key))).collect()
        } else {
            Vec::new()
        };
        for index in 0..count {
            let Some(&bytes) = self.bytes[index * N..].first_chunk::<N>() else { break };
            let sample = T::from_le(bytes);
            self.bytes[index] = match table.get(sample.key() as usize) {
                Some(&level) => level,
                None => levels.of(T::of_key(sample.key())),
            };
        }
        self.bytes.truncate(count);
    }
}

/// The map from stored samples to levels: `lo` becomes 0, `hi` becomes 255 (`hi` may be the lower one).
struct Levels {
    lo: f64,
    range: f64,
    /// Halves numbers whose difference, times 255, would leave the range of `f64`; else 1.
    shrink: f64,
}

impl Levels {
    fn new(lo: f64, hi: f64) -> Self {
        let shrink = if (255.0 * (hi - lo)).is_finite() { 1.0 } else { 1.0 / 1024.0 };
        Self { lo: lo * shrink, range: hi * shrink - lo * shrink, shrink }
    }

    fn of(&self, sample: f64) -> u8 {
        if self.range == 0.0 {
            return 0;
        }
        let level = 255.0 * (sample * self.shrink - self.lo) / self.range;
        level.round().clamp(0.0, 255.0) as u8
    }
}

/// A type of sample of `N` bytes.
trait Sample<const N: usize>: Copy {
    fn from_le(bytes: [u8; N]) -> Self;
    /// A number that orders as the samples do (zeros by their sign), in the low `8 N` bits.
    fn key(self) -> u64;
    /// The value of the sample of that key.
    fn of_key(key: u64) -> f64;
    fn is_finite(self) -> bool;
}

macro_rules! unsigned {
    ($ty:ty, $size:literal) => {
        impl Sample<$size> for $ty {
            fn from_le(bytes: [u8; $size]) -> Self {
                Self::from_le_bytes(bytes)
            }
            fn key(self) -> u64 {
                u64::from(self)
            }
            fn of_key(key: u64) -> f64 {
                key as f64
            }
            fn is_finite(self) -> bool {
                true
            }
        }
    };
}

/// Signed integers order as unsigned ones do once the sign bit is turned over.
macro_rules! signed {
    ($ty:ty, $bits:ty, $size:literal) => {
        impl Sample<$size> for $ty {
            fn from_le(bytes: [u8; $size]) -> Self {
                Self::from_le_bytes(bytes)
            }
            fn key(self) -> u64 {
                u64::from(self as $bits ^ (1 << (<$bits>::BITS - 1)))
            }
            fn of_key(key: u64) -> f64 {
                (key as $bits ^ (1 << (<$bits>::BITS - 1))) as $ty as f64
            }
            fn is_finite(self) -> bool {
                true
            }
        }
    };
}

/// Floating-point numbers order as their bits do once the sign bit, or of negative ones every bit, is turned over.
macro_rules! float {
    ($ty:ty, $bits:ty, $size:literal) => {
        impl Sample<$size> for $ty {
            fn from_le(bytes: [u8; $size]) -> Self {
                Self::from_le_bytes(bytes)
            }
            fn key(self) -> u64 {
                const SIGN: $bits = 1 << (<$bits>::BITS - 1);
                let bits = self.to_bits();
                u64::from(if bits & SIGN == 0 { bits | SIGN } else { !bits })
            }
            fn of_key(key: u64) -> f64 {
                const SIGN: $bits = 1 << (<$bits>::BITS - 1);
                let bits = key as $bits;
                // The sum makes -0 the 0 that it equals.
                f64::from(<$ty>::from_bits(if bits & SIGN == 0 { !bits } else { bits & !SIGN })) + 0.0
            }
            fn is_finite(self) -> bool {
                <$ty>::is_finite(self)
            }
        }
    };
}

unsigned!(u16, 2);
unsigned!(u32, 4);
unsigned!(u64, 8);
signed!(i8, u8, 1);
signed!(i16, u16, 2);
signed!(i32, u32, 4);
signed!(i64, u64, 8);
float!(f16, u16, 2);
float!(f32, u32, 4);
float!(f64, u64, 8);
