//! [`Sample`]: the types of samples, and the whole numbers that order as they do.

use half::f16;

/// A sample type of `N` bytes.
pub(super) trait Sample<const N: usize>: Copy + Send + 'static {
    fn from_le(bytes: [u8; N]) -> Self;
    /// A number of `8 N` bits that orders as the samples do; of the zeros, the negative one is lower.
    fn key(self) -> u64;
    /// The value of the sample with this key.
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

/// With the sign bit inverted, signed integers order as unsigned ones.
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

/// Floating-point numbers order as their bits do, if the sign bit of positive and every bit of negative ones is inverted.
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
                // The sum turns -0 into 0.
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
