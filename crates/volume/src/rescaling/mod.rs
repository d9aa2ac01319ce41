//! From samples to 256 levels, in place.
//!
//! Samples are not widened: the range is found and the levels are written by passing over the bytes as they are stored,
//! whatever their type, all at once or piece by piece ([`Rescaler`]) for volumes larger than memory. A *key* is a whole
//! number that orders as the samples of a type do. Ranges and ranks are found among keys, so that one selection serves
//! integers and floating-point numbers.

mod calibration;
mod intensity;
mod keys;
mod levels;
mod selection;
#[cfg(test)]
mod tests;

use std::marker::PhantomData;

use half::f16;

use self::keys::Sample;
use self::levels::LevelMap;
use self::selection::Selection;
use crate::samples::make_little;
use crate::{Endian, SampleType};

pub use self::calibration::Calibration;
pub use self::intensity::{Intensity, IntensityError, Mapping};

/// The first sample that is NaN or infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct NotFinite {
    /// How many samples come before it.
    pub(crate) index: u64,
    pub(crate) value: f64,
}

/// Writes the level of every sample to the front of the bytes and cuts off the rest; `u8` samples are left as they are.
pub(crate) fn rescale(
    bytes: &mut Vec<u8>,
    ty: SampleType,
    endian: Endian,
    intensity: Intensity,
    calibration: Calibration,
) -> Result<Option<Mapping>, NotFinite> {
    let samples = bytes.len() / ty.size();
    let Some(mut rescaler) = rescaler(ty, samples as u64, intensity, calibration) else { return Ok(None) };
    make_little(bytes, ty, endian);
    rescale_all(rescaler.as_mut(), bytes).map(Some)
}

/// Scans all samples of a volume as often as needed and writes their levels.
pub(crate) fn rescale_all(rescaler: &mut dyn Rescaler, bytes: &mut Vec<u8>) -> Result<Mapping, NotFinite> {
    while rescaler.needs_scan() {
        rescaler.scan(bytes, 0)?;
        rescaler.end_scan();
    }
    rescaler.apply(bytes, 0)?;
    Ok(rescaler.mapping())
}

/// A two-pass scan of the samples of a volume, in one piece or many: they are scanned as long as
/// [`needs_scan`](Self::needs_scan) says so, then replaced by levels.
///
/// Pieces are little-endian. Those of a scan cover the volume in order; `before` is the number of samples that come before
/// a piece.
pub(crate) trait Rescaler: Send {
    /// Whether all samples must be scanned (once more) before levels can be written.
    fn needs_scan(&self) -> bool;
    /// Takes in the next piece of a scan.
    fn scan(&mut self, piece: &[u8], before: u64) -> Result<(), NotFinite>;
    /// Ends a scan in which all samples were taken in.
    fn end_scan(&mut self);
    /// Writes the level of every sample to the front of a piece and cuts off the rest.
    fn apply(&mut self, piece: &mut Vec<u8>, before: u64) -> Result<(), NotFinite>;
    /// The mapping, once no scan is needed.
    fn mapping(&self) -> Mapping;
}

/// The rescaler of a volume of `samples` samples of a type; `None` for `u8`, which is taken as it is.
pub(crate) fn rescaler(
    ty: SampleType,
    samples: u64,
    intensity: Intensity,
    calibration: Calibration,
) -> Option<Box<dyn Rescaler>> {
    Some(match ty {
        SampleType::U8 => return None,
        SampleType::I8 => Box::new(Typed::<i8, 1>::new(samples, intensity, calibration)),
        SampleType::U16 => Box::new(Typed::<u16, 2>::new(samples, intensity, calibration)),
        SampleType::I16 => Box::new(Typed::<i16, 2>::new(samples, intensity, calibration)),
        SampleType::U32 => Box::new(Typed::<u32, 4>::new(samples, intensity, calibration)),
        SampleType::I32 => Box::new(Typed::<i32, 4>::new(samples, intensity, calibration)),
        SampleType::U64 => Box::new(Typed::<u64, 8>::new(samples, intensity, calibration)),
        SampleType::I64 => Box::new(Typed::<i64, 8>::new(samples, intensity, calibration)),
        SampleType::F16 => Box::new(Typed::<f16, 2>::new(samples, intensity, calibration)),
        SampleType::F32 => Box::new(Typed::<f32, 4>::new(samples, intensity, calibration)),
        SampleType::F64 => Box::new(Typed::<f64, 8>::new(samples, intensity, calibration)),
    })
}

/// The [`Rescaler`] of one sample type.
struct Typed<T, const N: usize> {
    intensity: Intensity,
    calibration: Calibration,
    samples: u64,
    /// Whether a scan has found every sample finite.
    finite: bool,
    stage: Stage,
    of: PhantomData<T>,
}

/// What the next pass over the samples is for.
enum Stage {
    /// Finding the lowest and the highest key.
    Range { low: u64, high: u64 },
    /// Finding the keys at two ranks.
    Ranks([Selection; 2]),
    /// Writing levels. The table, if there is one, holds the level of every key.
    Write { levels: LevelMap, table: Vec<u8>, mapping: Mapping },
}

impl<T: Sample<N>, const N: usize> Typed<T, N> {
    fn new(samples: u64, intensity: Intensity, calibration: Calibration) -> Self {
        let stage = Stage::Range { low: u64::MAX, high: 0 };
        let mut rescaler = Self { intensity, calibration, samples, finite: false, stage, of: PhantomData };
        match intensity {
            Intensity::Full => {}
            Intensity::Auto => {
                let rank = |thousandths: u128| (u128::from(samples) * thousandths).div_ceil(1000) as u64;
                rescaler.stage = Stage::Ranks([1, 999].map(|thousandths| Selection::new(rank(thousandths), N)));
            }
            Intensity::Window { lo, hi } => {
                rescaler.settle(LevelMap::line(calibration.stored(lo), calibration.stored(hi)), lo, hi);
            }
            Intensity::NonZero => rescaler.settle(LevelMap::NonZero(calibration), 0.0, 0.0),
        }
        rescaler
    }

    /// Settles on the levels between two keys.
    fn settle_between(&mut self, low: u64, high: u64) {
        let (low, high) = (T::of_key(low), T::of_key(high));
        let (from, to) = if self.calibration.slope() > 0.0 { (low, high) } else { (high, low) };
        self.settle(LevelMap::line(from, to), self.calibration.unit(from), self.calibration.unit(to));
    }

    /// Settles on a map. In large volumes of small samples every key is mapped once, which saves a division per sample.
    fn settle(&mut self, levels: LevelMap, lo: f64, hi: f64) {
        let table = if N <= 2 && self.samples >= 1 << 16 {
            (0..1_u64 << (8 * N)).map(|key| levels.of(T::of_key(key))).collect()
        } else {
            Vec::new()
        };
        self.stage = Stage::Write { levels, table, mapping: Mapping { rule: self.intensity, lo, hi } };
    }

    /// Checks that every sample of a piece is finite, unless a scan has.
    fn check(&self, piece: &[u8], before: u64) -> Result<(), NotFinite> {
        if self.finite || samples::<T, N>(piece).fold(true, |finite, sample| finite & sample.is_finite()) {
            return Ok(());
        }
        match samples::<T, N>(piece).enumerate().find(|(_, sample)| !sample.is_finite()) {
            Some((index, sample)) => Err(NotFinite { index: before + index as u64, value: T::of_key(sample.key()) }),
            None => Ok(()),
        }
    }
}

impl<T: Sample<N>, const N: usize> Rescaler for Typed<T, N> {
    fn needs_scan(&self) -> bool {
        !matches!(self.stage, Stage::Write { .. })
    }

    fn scan(&mut self, piece: &[u8], before: u64) -> Result<(), NotFinite> {
        self.check(piece, before)?;
        match &mut self.stage {
            Stage::Range { low, high } => {
                for key in samples::<T, N>(piece).map(Sample::key) {
                    (*low, *high) = ((*low).min(key), (*high).max(key));
                }
            }
            Stage::Ranks([low, high]) => {
                low.count(samples::<T, N>(piece).map(Sample::key));
                high.count(samples::<T, N>(piece).map(Sample::key));
            }
            Stage::Write { .. } => {}
        }
        Ok(())
    }

    fn end_scan(&mut self) {
        self.finite = true;
        match &mut self.stage {
            Stage::Range { low, high } => {
                let (low, high) = (*low, *high);
                self.settle_between(low, high);
            }
            Stage::Ranks([low, high]) => {
                if let (Some(low), Some(high)) = (low.narrow(), high.narrow()) {
                    self.settle_between(low, high);
                }
            }
            Stage::Write { .. } => {}
        }
    }

    /// In place: sample `i` begins at byte `i * N`, and its level goes to byte `i`.
    fn apply(&mut self, piece: &mut Vec<u8>, before: u64) -> Result<(), NotFinite> {
        self.check(piece, before)?;
        let Stage::Write { levels, table, .. } = &self.stage else { return Ok(()) };
        let count = piece.len() / N;
        for index in 0..count {
            let Some(&sample) = piece[index * N..].first_chunk::<N>() else { break };
            let key = T::from_le(sample).key();
            let level = table.get(key as usize).copied();
            piece[index] = level.unwrap_or_else(|| levels.of(T::of_key(key)));
        }
        piece.truncate(count);
        Ok(())
    }

    fn mapping(&self) -> Mapping {
        match &self.stage {
            Stage::Write { mapping, .. } => *mapping,
            _ => Mapping { rule: self.intensity, lo: 0.0, hi: 0.0 },
        }
    }
}

/// The samples of little-endian bytes.
fn samples<T: Sample<N>, const N: usize>(bytes: &[u8]) -> impl Iterator<Item = T> {
    bytes.as_chunks::<N>().0.iter().map(|&bytes| T::from_le(bytes))
}
