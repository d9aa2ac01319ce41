//! AVX-512: 32 words in a register, 32 registers.
//!
//! [`Vnni`] multiplies and adds in one instruction, `vpdpwssd`. LLVM (rustc 1.95) rewrites its intrinsic into
//! `vpmaddwd` and `vpaddd` where its cost model favours them, which takes 1.56 times as long. One instruction of inline
//! assembly prevents that; `benches/check_vnni.sh` counts the instructions in the binary. [`Plain`] is for CPUs without
//! VNNI.

use std::arch::asm;
use std::arch::x86_64::*;

use super::Input;
use super::body;
use super::lanes::Lanes;
use super::tiles::Wide;
use crate::OctantSums;

/// AVX-512 F and BW.
///
/// # Safety
/// The CPU must have these instructions.
#[target_feature(enable = "avx512f,avx512bw")]
pub(super) unsafe fn plain(input: &Input<'_>) -> OctantSums {
    // SAFETY: the instructions of `Plain` are enabled for this function, and the caller checked that the CPU has them.
    unsafe { body::sums::<Plain, Wide, false>(input) }
}

/// AVX-512 F, BW and VNNI, one product per multiplication.
///
/// # Safety
/// The CPU must have these instructions.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) unsafe fn vnni(input: &Input<'_>) -> OctantSums {
    // SAFETY: the instructions of `Vnni` are enabled for this function, and the caller checked that the CPU has them.
    unsafe { body::sums::<Vnni, Wide, false>(input) }
}

/// AVX-512 F, BW and VNNI, two products per multiplication where that pays.
///
/// # Safety
/// The CPU must have these instructions.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) unsafe fn vnni_folded(input: &Input<'_>) -> OctantSums {
    // SAFETY: the instructions of `Vnni` are enabled for this function, and the caller checked that the CPU has them.
    unsafe { body::sums::<Vnni, Wide, true>(input) }
}

macro_rules! implement {
    ($name:ident, $multiply_add:ident) => {
        impl Lanes for $name {
            const WORDS: usize = 32;
            const GROUP: usize = 4;

            #[inline(always)]
            unsafe fn zero() -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_setzero_si512() })
            }
            #[inline(always)]
            unsafe fn splat(word: i16) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_set1_epi16(word) })
            }
            #[inline(always)]
            unsafe fn load(from: *const i16) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW and there are 32 readable, aligned words.
                Self(unsafe { _mm512_load_si512(from.cast()) })
            }
            #[inline(always)]
            unsafe fn store(self, to: *mut i16) {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW and there are 32 writable, aligned words.
                unsafe { _mm512_store_si512(to.cast(), self.0) }
            }
            #[inline(always)]
            unsafe fn widen(from: *const u8) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW and there are 32 readable bytes.
                Self(unsafe { _mm512_cvtepu8_epi16(_mm256_loadu_si256(from.cast())) })
            }
            #[inline(always)]
            unsafe fn and(self, other: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_and_si512(self.0, other.0) })
            }
            #[inline(always)]
            unsafe fn xor(self, other: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_xor_si512(self.0, other.0) })
            }
            #[inline(always)]
            unsafe fn add_words(self, other: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_add_epi16(self.0, other.0) })
            }
            #[inline(always)]
            unsafe fn subtract_words(self, other: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_sub_epi16(self.0, other.0) })
            }
            #[inline(always)]
            unsafe fn multiply_words(self, other: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_mullo_epi16(self.0, other.0) })
            }
            #[inline(always)]
            unsafe fn add(self, other: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_add_epi32(self.0, other.0) })
            }
            #[inline(always)]
            unsafe fn subtract(self, other: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                Self(unsafe { _mm512_sub_epi32(self.0, other.0) })
            }
            #[inline(always)]
            unsafe fn add_widened(self, sums: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has AVX-512 F and BW.
                unsafe {
                    let even = _mm512_srai_epi64::<32>(_mm512_slli_epi64::<32>(sums.0));
                    let odd = _mm512_srai_epi64::<32>(sums.0);
                    Self(_mm512_add_epi64(_mm512_add_epi64(self.0, even), odd))
                }
            }
            #[inline(always)]
            unsafe fn multiply_add(self, a: Self, b: Self) -> Self {
                // SAFETY: by the contract of `Lanes`, the CPU has the instructions of this type.
                Self(unsafe { $multiply_add(self.0, a.0, b.0) })
            }
        }
    };
}

/// Registers of a CPU with VNNI.
#[derive(Clone, Copy)]
pub(super) struct Vnni(__m512i);

implement!(Vnni, multiply_add_vnni);

#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn multiply_add_vnni(mut sum: __m512i, a: __m512i, b: __m512i) -> __m512i {
    // SAFETY: the instruction is enabled for this function, and reads and writes only these three registers.
    unsafe {
        asm!("vpdpwssd {sum}, {a}, {b}", sum = inout(zmm_reg) sum, a = in(zmm_reg) a, b = in(zmm_reg) b,
             options(nomem, nostack, preserves_flags));
    }
    sum
}

/// Registers of a CPU without VNNI.
#[derive(Clone, Copy)]
pub(super) struct Plain(__m512i);

implement!(Plain, multiply_add_plain);

#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn multiply_add_plain(sum: __m512i, a: __m512i, b: __m512i) -> __m512i {
    _mm512_add_epi32(sum, _mm512_madd_epi16(a, b))
}
