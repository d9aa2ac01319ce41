//! Ranges of parameters, and their limits.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, SeqAccess, Visitor};

/// The numbers from `low` to `high`. In a recipe: a number (fixed) or `[low, high]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterRange {
    /// The lowest number.
    pub low: f64,
    /// The highest number.
    pub high: f64,
}

/// The numbers that a range may contain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterLimits {
    /// The lowest number allowed.
    pub low: f64,
    /// The highest number allowed.
    pub high: f64,
    /// Whether the numbers must be whole.
    pub whole: bool,
}

impl ParameterLimits {
    pub(super) fn contain(&self, range: ParameterRange) -> bool {
        let whole = |v: f64| !self.whole || v == v.trunc();
        // Comparisons with NaN are false, so NaN is not contained.
        self.low <= range.low
            && range.low <= range.high
            && range.high <= self.high
            && whole(range.low)
            && whole(range.high)
    }
}

impl fmt::Display for ParameterRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.low == self.high { write!(f, "{}", self.low) } else { write!(f, "[{}, {}]", self.low, self.high) }
    }
}

impl fmt::Display for ParameterLimits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}{}", self.low, self.high, if self.whole { ", whole numbers" } else { "" })
    }
}

impl<'de> Deserialize<'de> for ParameterRange {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let [low, high] = deserializer.deserialize_any(NumbersVisitor::<2>("a number or [low, high]"))?;
        Ok(Self { low, high })
    }
}

/// Reads `N` numbers, or one number that stands for `N` equal ones.
pub(super) struct NumbersVisitor<const N: usize>(pub(super) &'static str);

impl<'de, const N: usize> Visitor<'de> for NumbersVisitor<N> {
    type Value = [f64; N];

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0)
    }

    fn visit_f64<E>(self, number: f64) -> Result<Self::Value, E> {
        Ok([number; N])
    }

    fn visit_i64<E>(self, number: i64) -> Result<Self::Value, E> {
        Ok([number as f64; N])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Self::Value, A::Error> {
        let mut numbers = [0.0; N];
        for (i, number) in numbers.iter_mut().enumerate() {
            *number = items.next_element()?.ok_or_else(|| serde::de::Error::invalid_length(i, &self))?;
        }
        match items.next_element::<serde::de::IgnoredAny>()? {
            None => Ok(numbers),
            Some(_) => Err(serde::de::Error::invalid_length(N + 1, &self)),
        }
    }
}
