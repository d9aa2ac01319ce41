//! From deep samples to 256 levels, in place.
//!
//! The bytes are never widened: the range is found and the levels are written by passing over the bytes as they are
//! stored, whatever their type, all at once or piece by piece ([`Passes`]) where a volume is larger than memory. A *key* is a whole number that orders as the samples of a type do; ranges and ranks are
//! found among keys, so that one selection serves integers and floats.

use std::marker::PhantomData;

use half::f16;

use super::{Endian, Intensity, Mapping, SampleType};

/// A linear scaling from stored samples to the file's own units: `slope * stored + intercept`.
///
/// Invariant: the slope is finite and not zero, the intercept is finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scaling {
    slope: f64,
    intercept: f64,
}

impl Scaling {
    /// Stored samples are the units.
    pub(super) const IDENTITY: Self = Self { slope: 1.0, intercept: 0.0 };

    /// The scaling by these numbers; `None` where they are no invertible linear map.
    pub(super) fn new(slope: f64, intercept: f64) -> Option<Self> {
        (slope.is_finite() && slope != 0.0 && intercept.is_finite()).then_some(Self { slope, intercept })
    }

    fn unit(self, stored: f64) -> f64 {
        self.slope * stored + self.intercept
    }

    fn stored(self, unit: f64) -> f64 {
        (unit - self.intercept) / self.slope
    }
}

/// The first sample that is NaN or infinite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct NotFinite {
    /// How many samples come before it.
    pub(super) index: u64,
    pub(super) value: f64,
}

/// Writes the level of every sample to the front of the bytes and cuts off the rest; `u8` samples are left as they are.
pub(super) fn write(
    bytes: &mut Vec<u8>,
    ty: SampleType,
    endian: Endian,
    intensity: Intensity,
    scaling: Scaling,
) -> Result<Option<Mapping>, NotFinite> {
    let samples = bytes.len() / ty.size();
    let Some(mut passes) = passes(ty, samples as u64, intensity, scaling) else { return Ok(None) };
    make_little(bytes, ty, endian);
    while passes.surveys() {
        passes.survey(bytes, 0)?;
        passes.end_survey();
    }
    passes.write(bytes, 0)?;
    Ok(Some(passes.mapping()))
}

/// Brings samples into the byte order that [`Passes`] take.
pub(super) fn make_little(bytes: &mut [u8], ty: SampleType, endian: Endian) {
    if endian == Endian::Big {
        match ty.size() {
            1 => {}
            2 => bytes.as_chunks_mut::<2>().0.iter_mut().for_each(|bytes| bytes.reverse()),
            4 => bytes.as_chunks_mut::<4>().0.iter_mut().for_each(|bytes| bytes.reverse()),
            _ => bytes.as_chunks_mut::<8>().0.iter_mut().for_each(|bytes| bytes.reverse()),
        }
    }
}

/// How the samples of a volume become levels while they pass by in pieces, the whole of them being one piece or many:
/// as often as [`surveys`](Self::surveys) says so to be looked at, then once to be replaced.
///
/// Pieces are little-endian and come in order; `before` is the number of samples that came before a piece.
pub(super) trait Passes: Send {
    /// Whether the samples are to pass (once more) before levels can be written.
    fn surveys(&self) -> bool;
    /// Looks at the next piece of a survey.
    fn survey(&mut self, piece: &[u8], before: u64) -> Result<(), NotFinite>;
    /// Draws the conclusions of a survey that all samples have passed.
    fn end_survey(&mut self);
    /// Writes the level of every sample to the front of a piece and cuts off the rest.
    fn write(&mut self, piece: &mut Vec<u8>, before: u64) -> Result<(), NotFinite>;
    /// The mapping, once no survey is left.
    fn mapping(&self) -> Mapping;
}

/// The passes over `samples` samples of a type; `None` for `u8`, which is taken as it is.
pub(super) fn passes(ty: SampleType, samples: u64, intensity: Intensity, scaling: Scaling) -> Option<Box<dyn Passes>> {
    Some(match ty {
        SampleType::U8 => return None,
        SampleType::I8 => Box::new(Typed::<i8, 1>::new(samples, intensity, scaling)),
        SampleType::U16 => Box::new(Typed::<u16, 2>::new(samples, intensity, scaling)),
        SampleType::I16 => Box::new(Typed::<i16, 2>::new(samples, intensity, scaling)),
        SampleType::U32 => Box::new(Typed::<u32, 4>::new(samples, intensity, scaling)),
        SampleType::I32 => Box::new(Typed::<i32, 4>::new(samples, intensity, scaling)),
        SampleType::U64 => Box::new(Typed::<u64, 8>::new(samples, intensity, scaling)),
        SampleType::I64 => Box::new(Typed::<i64, 8>::new(samples, intensity, scaling)),
        SampleType::F16 => Box::new(Typed::<f16, 2>::new(samples, intensity, scaling)),
        SampleType::F32 => Box::new(Typed::<f32, 4>::new(samples, intensity, scaling)),
        SampleType::F64 => Box::new(Typed::<f64, 8>::new(samples, intensity, scaling)),
    })
}

/// [`Passes`] over samples of one type.
struct Typed<T, const N: usize> {
    intensity: Intensity,
    scaling: Scaling,
    samples: u64,
    /// Whether a pass has found every sample finite.
    finite: bool,
    stage: Stage,
    of: PhantomData<T>,
}

/// What the next pass is for.
enum Stage {
    /// Finding the lowest and the highest key.
    Range { low: u64, high: u64 },
    /// Finding the keys at two ranks.
    Ranks([Selection; 2]),
    /// Writing.
    Levels { levels: Levels, table: Vec<u8>, mapping: Mapping },
}

impl<T: Sample<N>, const N: usize> Typed<T, N> {
    fn new(samples: u64, intensity: Intensity, scaling: Scaling) -> Self {
        let of = PhantomData;
        let mut passes =
            Self { intensity, scaling, samples, finite: false, stage: Stage::Range { low: u64::MAX, high: 0 }, of };
        match intensity {
            Intensity::Full => {}
            Intensity::Auto => {
                let rank = |thousandths: u128| (u128::from(samples) * thousandths).div_ceil(1000) as u64;
                passes.stage = Stage::Ranks([1, 999].map(|thousandths| Selection::new(rank(thousandths), N)));
            }
            Intensity::Window { lo, hi } => {
                passes.settle(Levels::new(scaling.stored(lo), scaling.stored(hi)), lo, hi);
            }
            Intensity::NonZero => passes.settle(Levels::NonZero(scaling), 0.0, 0.0),
        }
        passes
    }

    /// Levels from the stored samples `low` to `high`.
    fn settle_between(&mut self, low: u64, high: u64) {
        let (low, high) = (T::of_key(low), T::of_key(high));
        let (from, to) = if self.scaling.slope > 0.0 { (low, high) } else { (high, low) };
        self.settle(Levels::new(from, to), self.scaling.unit(from), self.scaling.unit(to));
    }

    /// Of few possible samples each is mapped once: a division per sample is what costs.
    fn settle(&mut self, levels: Levels, lo: f64, hi: f64) {
        let table = if N <= 2 && self.samples >= 1 << 16 {
            (0..1_u64 << (8 * N)).map(|key| levels.of(T::of_key(key))).collect()
        } else {
            Vec::new()
        };
        self.stage = Stage::Levels { levels, table, mapping: Mapping { rule: self.intensity, lo, hi } };
    }

    /// That every sample of a piece is finite, unless a pass before has found so.
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

impl<T: Sample<N>, const N: usize> Passes for Typed<T, N> {
    fn surveys(&self) -> bool {
        !matches!(self.stage, Stage::Levels { .. })
    }

    fn survey(&mut self, piece: &[u8], before: u64) -> Result<(), NotFinite> {
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
            Stage::Levels { .. } => {}
        }
        Ok(())
    }

    fn end_survey(&mut self) {
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
            Stage::Levels { .. } => {}
        }
    }

    /// In place: sample `i` begins at byte `i * N`, which is not before byte `i`, where its level goes.
    fn write(&mut self, piece: &mut Vec<u8>, before: u64) -> Result<(), NotFinite> {
        self.check(piece, before)?;
        let Stage::Levels { levels, table, .. } = &self.stage else { return Ok(()) };
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
            Stage::Levels { mapping, .. } => *mapping,
            _ => Mapping { rule: self.intensity, lo: 0.0, hi: 0.0 },
        }
    }
}

/// The samples of little-endian bytes.
fn samples<T: Sample<N>, const N: usize>(bytes: &[u8]) -> impl Iterator<Item = T> {
    bytes.as_chunks::<N>().0.iter().map(|&bytes| T::from_le(bytes))
}

/// The key of the sample at a rank, counted from 1.
///
/// Radix selection: keys are counted by 16 bits at a time, from the highest. That is one pass over the samples for every
/// 16 bits of one and 65 536 counters of memory, whatever the volume's size.
struct Selection {
    /// The rank among the keys that begin with `prefix`.
    rank: u64,
    /// The bits that are known.
    prefix: u64,
    /// How many bits come after the prefix; a multiple of [`DIGIT`](Self::DIGIT).
    below: u32,
    counts: Vec<u64>,
}

impl Selection {
    const DIGIT: u32 = 16;

    /// At `rank` among keys of `size` bytes.
    fn new(rank: u64, size: usize) -> Self {
        let below = (8 * size as u32).next_multiple_of(Self::DIGIT);
        Self { rank, prefix: 0, below, counts: vec![0; 1 << Self::DIGIT] }
    }

    fn count(&mut self, keys: impl Iterator<Item = u64>) {
        let (prefix, above, shift) = (self.prefix, self.below, self.below - Self::DIGIT);
        for key in keys {
            if key.checked_shr(above).unwrap_or(0) == prefix {
                self.counts[(key >> shift) as usize & ((1 << Self::DIGIT) - 1)] += 1;
            }
        }
    }

    /// Takes in a pass over all samples; the key, once all of its bits are known.
    fn narrow(&mut self) -> Option<u64> {
        let mut digit = 0;
        for (value, &count) in (0..).zip(&self.counts) {
            digit = value;
            if self.rank <= count {
                break;
            }
            self.rank -= count;
        }
        self.prefix = self.prefix << Self::DIGIT | digit;
        self.below -= Self::DIGIT;
        self.counts.fill(0);
        (self.below == 0).then_some(self.prefix)
    }
}

/// The map from stored samples to levels.
enum Levels {
    /// `lo` becomes 0, `hi` becomes 255 (`hi` may be the lower one).
    Line {
        lo: f64,
        range: f64,
        /// Halves numbers whose difference, times 255, would leave the range of `f64`; else 1.
        shrink: f64,
    },
    /// What is 0 in the file's units becomes 0, all else 255.
    NonZero(Scaling),
}

impl Levels {
    fn new(lo: f64, hi: f64) -> Self {
        let shrink = if (255.0 * (hi - lo)).is_finite() { 1.0 } else { 1.0 / 1024.0 };
        Self::Line { lo: lo * shrink, range: hi * shrink - lo * shrink, shrink }
    }

    fn of(&self, sample: f64) -> u8 {
        match *self {
            Self::NonZero(scaling) => {
                if scaling.unit(sample) == 0.0 {
                    0
                } else {
                    255
                }
            }
            Self::Line { range: 0.0, .. } => 0,
            Self::Line { lo, range, shrink } => {
                let level = (255.0 * (sample * shrink - lo) / range).clamp(0.0, 255.0);
                // `round`, without the call that it is on processors of the baseline: of numbers from 0 to 255 both
                // steps are exact.
                let whole = level as u8;
                whole + u8::from(level - f64::from(whole) >= 0.5)
            }
        }
    }
}

/// A type of sample of `N` bytes.
trait Sample<const N: usize>: Copy + Send + 'static {
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{encode, value};

    /// The definition, over a copy of every sample.
    fn reference(samples: &[f64], intensity: Intensity) -> (Vec<u8>, f64, f64) {
        let mut sorted = samples.to_vec();
        sorted.sort_by(f64::total_cmp);
        let rank = |thousandths: usize| sorted[(samples.len() * thousandths).div_ceil(1000) - 1];
        let (lo, hi) = match intensity {
            Intensity::Full => (sorted[0], sorted[sorted.len() - 1]),
            Intensity::Auto => (rank(1), rank(999)),
            Intensity::Window { lo, hi } => (lo, hi),
            Intensity::NonZero => {
                return (samples.iter().map(|&v| if v == 0.0 { 0 } else { 255 }).collect(), 0.0, 0.0);
            }
        };
        let level = |v: &f64| if hi == lo { 0 } else { (255.0 * (v - lo) / (hi - lo)).round().clamp(0.0, 255.0) as u8 };
        (samples.iter().map(level).collect(), lo, hi)
    }

    fn check(samples: &[f64], ty: SampleType, endian: Endian, intensity: Intensity) {
        let mut bytes = encode(samples, ty, endian);
        let stored: Vec<f64> = bytes.chunks(ty.size()).map(|bytes| value(bytes, ty, endian)).collect();
        let (levels, lo, hi) = reference(&stored, intensity);
        let mapping = write(&mut bytes, ty, endian, intensity, Scaling::IDENTITY).unwrap();
        if ty == SampleType::U8 {
            assert_eq!(mapping, None);
            assert_eq!(bytes, encode(samples, ty, endian));
        } else {
            assert_eq!(mapping, Some(Mapping { rule: intensity, lo, hi }), "{ty}");
            assert_eq!(bytes, levels, "{ty} {endian:?} {intensity}");
        }
    }

    fn rules() -> impl Strategy<Value = Intensity> {
        let window = (-300.0..300.0, 0.1..500.0).prop_map(|(lo, wide)| Intensity::Window { lo, hi: lo + wide });
        prop_oneof![Just(Intensity::Full), Just(Intensity::Auto), Just(Intensity::NonZero), window]
    }

    proptest! {
        #[test]
        fn every_type_and_rule_does_what_the_definition_says(
            samples in prop::collection::vec(-400.0..400.0_f64, 1..3000),
            rule in rules(),
        ) {
            for ty in SampleType::ALL {
                for endian in [Endian::Little, Endian::Big] {
                    check(&samples, ty, endian, rule);
                }
            }
        }
    }

    #[test]
    fn a_table_gives_the_same_levels() {
        let samples: Vec<f64> =
            (0..70_000_u32).map(|i| f64::from(i.wrapping_mul(2_654_435_761) % 60_000) - 9.0).collect();
        for ty in [SampleType::I8, SampleType::U16, SampleType::I16, SampleType::F16] {
            check(&samples, ty, Endian::Big, Intensity::Auto);
        }
    }

    #[test]
    fn ranks_at_the_borders_of_thousands() {
        for count in [1, 2, 999, 1000, 1001, 1999, 2000, 2001] {
            let samples: Vec<f64> = (0..count).map(|i| f64::from((i * 7919) % count)).collect();
            check(&samples, SampleType::I32, Endian::Little, Intensity::Auto);
            check(&samples, SampleType::F64, Endian::Little, Intensity::Auto);
        }
    }

    #[test]
    fn extremes_and_constants() {
        let full = |samples: &[f64], ty| {
            let mut bytes = encode(samples, ty, Endian::Little);
            write(&mut bytes, ty, Endian::Little, Intensity::Full, Scaling::IDENTITY).unwrap();
            bytes
        };
        assert_eq!(full(&[f64::MIN, 0.0, f64::MAX], SampleType::F64), [0, 128, 255]);
        assert_eq!(full(&[i64::MIN as f64, -1e18, i64::MAX as f64], SampleType::I64), [0, 114, 255]);
        assert_eq!(full(&[0.0, u64::MAX as f64], SampleType::U64), [0, 255]);
        assert_eq!(full(&[5e-324, 1e-323], SampleType::F64), [0, 255]);
        assert_eq!(full(&[-0.0, 0.0, -0.0], SampleType::F32), [0, 0, 0]);
        assert_eq!(full(&[9.0; 4], SampleType::U16), [0; 4]);
    }

    #[test]
    fn nonzero_loses_no_label_and_is_in_units() {
        let nonzero = |samples: &[f64], ty, scaling| {
            let mut bytes = encode(samples, ty, Endian::Little);
            write(&mut bytes, ty, Endian::Little, Intensity::NonZero, scaling).unwrap();
            bytes
        };
        assert_eq!(nonzero(&[1.0, 0.0, 65_535.0, 2.0], SampleType::U16, Scaling::IDENTITY), [255, 0, 255, 255]);
        assert_eq!(nonzero(&[-0.0, 5e-324, -1e300, 0.0], SampleType::F64, Scaling::IDENTITY), [0, 255, 255, 0]);
        let scaling = Scaling::new(2.0, -4.0).unwrap();
        assert_eq!(nonzero(&[0.0, 2.0, 4.0], SampleType::I32, scaling), [255, 0, 255]);
    }

    #[test]
    fn a_half_is_rounded_away_from_zero() {
        let mut bytes = encode(&[0.0, 1.0, 2.0, 509.0, 510.0], SampleType::U16, Endian::Little);
        let window = Intensity::Window { lo: 0.0, hi: 510.0 };
        write(&mut bytes, SampleType::U16, Endian::Little, window, Scaling::IDENTITY).unwrap();
        assert_eq!(bytes, [0, 1, 1, 255, 255]);
    }

    #[test]
    fn every_level_is_rounded_as_round_does() {
        let levels = Levels::new(0.0, 255.0);
        for half in 0..=510 {
            let exact = f64::from(half) / 2.0;
            for sample in [exact.next_down(), exact, exact.next_up()] {
                assert_eq!(
                    f64::from(levels.of(sample)),
                    (255.0 * sample / 255.0).round().clamp(0.0, 255.0),
                    "{sample:e}"
                );
            }
        }
        assert_eq!([f64::MIN, -0.6, 255.6, f64::MAX].map(|sample| levels.of(sample)), [0, 0, 255, 255]);
    }

    #[test]
    fn scaling_moves_windows_and_turns_round_when_negative() {
        let samples = [0.0, 1.0, 2.0, 3.0, 4.0, 255.0];
        let scaled = |intensity, slope, intercept| {
            let mut bytes = encode(&samples, SampleType::I16, Endian::Little);
            let scaling = Scaling::new(slope, intercept).unwrap();
            let mapping = write(&mut bytes, SampleType::I16, Endian::Little, intensity, scaling).unwrap().unwrap();
            (bytes, mapping.lo, mapping.hi)
        };
        assert_eq!(scaled(Intensity::Full, 0.1, 7.0), (vec![0, 1, 2, 3, 4, 255], 7.0, 32.5));
        assert_eq!(scaled(Intensity::Full, -1.0, 255.0), (vec![255, 254, 253, 252, 251, 0], 0.0, 255.0));
        let window = Intensity::Window { lo: 102.0, hi: 106.0 };
        assert_eq!(scaled(window, 2.0, 100.0), (vec![0, 0, 128, 255, 255, 255], 102.0, 106.0));
        for (slope, intercept) in [(0.0, 1.0), (f64::NAN, 0.0), (f64::INFINITY, 0.0), (1.0, f64::NAN)] {
            assert_eq!(Scaling::new(slope, intercept), None);
        }
    }

    #[test]
    fn the_first_sample_that_is_not_finite_is_found() {
        for ty in [SampleType::F16, SampleType::F32, SampleType::F64] {
            for bad in [f64::INFINITY, f64::NEG_INFINITY] {
                let mut bytes = encode(&[1.0, -2.0, bad, f64::NAN], ty, Endian::Big);
                let found = write(&mut bytes, ty, Endian::Big, Intensity::Full, Scaling::IDENTITY);
                assert_eq!(found, Err(NotFinite { index: 2, value: bad }));
            }
        }
    }
}
