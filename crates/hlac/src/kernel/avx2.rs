//! AVX2: 16 words in a register, 16 registers.
//!
//! Thirds are read from memory by the multiplication itself: `vpmaddwd` takes a memory operand, and the CPU does two loads
//! and two multiplications per cycle. Nearly all registers therefore hold sums, a dozen per tile.

use std::arch::x86_64::*;

use super::Input;
use super::body;
use super::lanes::Lanes;
use super::tiles::Narrow;
use crate::OctantSums;

/// AVX2, one product per multiplication.
///
/// # Safety
/// The CPU must have AVX2.
#[target_feature(enable = "avx2")]
pub(super) unsafe fn sums(input: &Input<'_>) -> OctantSums {
    // SAFETY: AVX2 is enabled for this function, and the caller checked that the CPU has it.
    unsafe { body::sums::<Avx2, Narrow, false>(input) }
}

/// Registers of a CPU with AVX2.
#[derive(Clone, Copy)]
pub(super) struct Avx2(__m256i);

impl Lanes for Avx2 {
    const WORDS: usize = 16;
    const GROUP: usize = 4;

    #[inline(always)]
    unsafe fn zero() -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_setzero_si256() })
    }
    #[inline(always)]
    unsafe fn splat(word: i16) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_set1_epi16(word) })
    }
    #[inline(always)]
    unsafe fn load(from: *const i16) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2 and there are 16 readable, aligned words.
        Self(unsafe { _mm256_load_si256(from.cast()) })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut i16) {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2 and there are 16 writable, aligned words.
        unsafe { _mm256_store_si256(to.cast(), self.0) }
    }
    #[inline(always)]
    unsafe fn widen(from: *const u8) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2 and there are 16 readable bytes.
        Self(unsafe { _mm256_cvtepu8_epi16(_mm_loadu_si128(from.cast())) })
    }
    #[inline(always)]
    unsafe fn and(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_and_si256(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn xor(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_xor_si256(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn add_words(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_add_epi16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn subtract_words(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_sub_epi16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn multiply_words(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_mullo_epi16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_add_epi32(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn subtract(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_sub_epi32(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn add_widened(self, sums: Self) -> Self {
        // AVX2 has no arithmetic shift of 64-bit lanes: add 2^31 to every sum, and subtract 2^32 from their total.
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        unsafe {
            let biased = _mm256_xor_si256(sums.0, _mm256_set1_epi32(i32::MIN));
            let even = _mm256_and_si256(biased, _mm256_set1_epi64x(0xffff_ffff));
            let odd = _mm256_srli_epi64::<32>(biased);
            let total = _mm256_sub_epi64(self.0, _mm256_set1_epi64x(1 << 32));
            Self(_mm256_add_epi64(_mm256_add_epi64(total, even), odd))
        }
    }
    #[inline(always)]
    unsafe fn multiply_add(self, a: Self, b: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has AVX2.
        Self(unsafe { _mm256_add_epi32(self.0, _mm256_madd_epi16(a.0, b.0)) })
    }
}
