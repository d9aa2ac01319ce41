//! [`NpyElement`]: the types of values that arrays hold.

use crate::{Endian, SampleType};

mod sealed {
    pub trait Sealed {}
}

/// A number that an array may hold: integers of 8 to 64 bits, `f32` and `f64`.
pub trait NpyElement: Copy + sealed::Sealed {
    /// The type of the values.
    const TYPE: SampleType;

    /// The little-endian bytes of the value.
    fn append_to(self, bytes: &mut Vec<u8>);

    /// The value of `TYPE.size()` bytes in a byte order; 0 of fewer bytes.
    fn from_bytes(bytes: &[u8], endian: Endian) -> Self;
}

macro_rules! element {
    ($($ty:ty => $sample:ident),*) => {$(
        impl sealed::Sealed for $ty {}

        impl NpyElement for $ty {
            const TYPE: SampleType = SampleType::$sample;

            fn append_to(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }

            fn from_bytes(bytes: &[u8], endian: Endian) -> Self {
                let bytes = bytes.first_chunk().copied().unwrap_or_default();
                match endian {
                    Endian::Little => Self::from_le_bytes(bytes),
                    Endian::Big => Self::from_be_bytes(bytes),
                }
            }
        }
    )*};
}

element!(
    u8 => U8, i8 => I8, u16 => U16, i16 => I16, u32 => U32, i32 => I32, u64 => U64, i64 => I64, f32 => F32, f64 => F64
);

/// The type of an array as numpy writes it: `<f4`, `|u1`.
pub(super) fn descr(ty: SampleType) -> &'static str {
    match ty {
        SampleType::U8 => "|u1",
        SampleType::I8 => "|i1",
        SampleType::U16 => "<u2",
        SampleType::I16 => "<i2",
        SampleType::U32 => "<u4",
        SampleType::I32 => "<i4",
        SampleType::U64 => "<u8",
        SampleType::I64 => "<i8",
        SampleType::F16 => "<f2",
        SampleType::F32 => "<f4",
        SampleType::F64 => "<f8",
    }
}

/// The type that `descr` names, its byte order, and whether its values are truth values; `None` for other types than
/// numbers of up to 64 bits.
pub(super) fn parse_descr(descr: &str) -> Option<(SampleType, Endian, bool)> {
    let (endian, code) = match descr.split_at_checked(1)? {
        ("<", code) => (Endian::Little, code),
        (">", code) => (Endian::Big, code),
        ("|" | "=", code) => (Endian::NATIVE, code),
        _ => return None,
    };
    let ty = match code {
        "b1" | "u1" => SampleType::U8,
        "i1" => SampleType::I8,
        "u2" => SampleType::U16,
        "i2" => SampleType::I16,
        "u4" => SampleType::U32,
        "i4" => SampleType::I32,
        "u8" => SampleType::U64,
        "i8" => SampleType::I64,
        "f2" => SampleType::F16,
        "f4" => SampleType::F32,
        "f8" => SampleType::F64,
        _ => return None,
    };
    Some((ty, endian, code == "b1"))
}
