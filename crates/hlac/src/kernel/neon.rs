//! NEON: 8 words in a register, 32 registers.
//!
//! `smlal` adds four products to four lanes, so that a multiplication is two instructions, and the words of a register
//! meet four apart: a group is the whole register. `sadalp` widens the sums in one instruction.

use std::arch::aarch64::*;
use std::arch::is_aarch64_feature_detected;

use super::body;
use super::lanes::Lanes;
use super::slab::Slab;
use super::tiles::Wide;
use crate::OctantSums;

/// Whether this CPU runs [`sums`].
pub(super) fn is_available() -> bool {
    is_aarch64_feature_detected!("neon")
}

/// NEON, one product per multiplication.
///
/// # Safety
/// The CPU must have NEON ([`is_available`]).
#[target_feature(enable = "neon")]
pub(super) unsafe fn sums(slab: &Slab<'_>) -> OctantSums {
    // SAFETY: this function has the instructions of `Neon` enabled.
    unsafe { body::sums::<Neon, Wide, false>(slab) }
}

/// Registers of a CPU with NEON.
#[derive(Clone, Copy)]
pub(super) struct Neon(int16x8_t);

impl Lanes for Neon {
    const WORDS: usize = 8;
    const GROUP: usize = 8;

    #[inline(always)]
    unsafe fn zero() -> Self {
        // SAFETY: the caller promises NEON, here and below.
        Self(unsafe { vdupq_n_s16(0) })
    }
    #[inline(always)]
    unsafe fn splat(word: i16) -> Self {
        // SAFETY: as above.
        Self(unsafe { vdupq_n_s16(word) })
    }
    #[inline(always)]
    unsafe fn load(from: *const i16) -> Self {
        // SAFETY: as above; the caller promises 8 readable words.
        Self(unsafe { vld1q_s16(from) })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut i16) {
        // SAFETY: as above; the caller promises 8 writable words.
        unsafe { vst1q_s16(to, self.0) }
    }
    #[inline(always)]
    unsafe fn widen(from: *const u8) -> Self {
        // SAFETY: as above; the caller promises 8 readable bytes.
        Self(unsafe { vreinterpretq_s16_u16(vmovl_u8(vld1_u8(from))) })
    }
    #[inline(always)]
    unsafe fn and(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { vandq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn xor(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { veorq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn add_words(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { vaddq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn subtract_words(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { vsubq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn multiply_words(self, other: Self) -> Self {
        // SAFETY: as above.
        Self(unsafe { vmulq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: as above.
        let sum = unsafe { vaddq_s32(vreinterpretq_s32_s16(self.0), vreinterpretq_s32_s16(other.0)) };
        // SAFETY: as above.
        Self(unsafe { vreinterpretq_s16_s32(sum) })
    }
    #[inline(always)]
    unsafe fn subtract(self, other: Self) -> Self {
        // SAFETY: as above.
        let difference = unsafe { vsubq_s32(vreinterpretq_s32_s16(self.0), vreinterpretq_s32_s16(other.0)) };
        // SAFETY: as above.
        Self(unsafe { vreinterpretq_s16_s32(difference) })
    }
    #[inline(always)]
    unsafe fn add_widened(self, sums: Self) -> Self {
        // SAFETY: as above.
        let total = unsafe { vpadalq_s32(vreinterpretq_s64_s16(self.0), vreinterpretq_s32_s16(sums.0)) };
        // SAFETY: as above.
        Self(unsafe { vreinterpretq_s16_s64(total) })
    }
    #[inline(always)]
    unsafe fn multiply_add(self, a: Self, b: Self) -> Self {
        // SAFETY: as above.
        unsafe {
            let sum = vmlal_s16(vreinterpretq_s32_s16(self.0), vget_low_s16(a.0), vget_low_s16(b.0));
            Self(vreinterpretq_s16_s32(vmlal_high_s16(sum, a.0, b.0)))
        }
    }
}
