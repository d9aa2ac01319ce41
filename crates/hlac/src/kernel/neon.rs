//! NEON: 8 words in a register, 32 registers.
//!
//! `smlal` adds four products to four lanes, so a multiply-add is two instructions, and words four apart share a lane: a
//! group is the whole register. `sadalp` widens the sums in one instruction.

use std::arch::aarch64::*;

use super::Input;
use super::body;
use super::lanes::Lanes;
use super::tiles::Wide;
use crate::OctantSums;

/// NEON, one product per multiplication.
///
/// # Safety
/// The CPU must have NEON.
#[target_feature(enable = "neon")]
pub(super) unsafe fn sums(input: &Input<'_>) -> OctantSums {
    // SAFETY: NEON is enabled for this function, and the caller checked that the CPU has it.
    unsafe { body::sums::<Neon, Wide, false>(input) }
}

/// Registers of a CPU with NEON.
#[derive(Clone, Copy)]
pub(super) struct Neon(int16x8_t);

impl Lanes for Neon {
    const WORDS: usize = 8;
    const GROUP: usize = 8;

    #[inline(always)]
    unsafe fn zero() -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vdupq_n_s16(0) })
    }
    #[inline(always)]
    unsafe fn splat(word: i16) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vdupq_n_s16(word) })
    }
    #[inline(always)]
    unsafe fn load(from: *const i16) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON and there are 8 readable words.
        Self(unsafe { vld1q_s16(from) })
    }
    #[inline(always)]
    unsafe fn store(self, to: *mut i16) {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON and there are 8 writable words.
        unsafe { vst1q_s16(to, self.0) }
    }
    #[inline(always)]
    unsafe fn widen(from: *const u8) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON and there are 8 readable bytes.
        Self(unsafe { vreinterpretq_s16_u16(vmovl_u8(vld1_u8(from))) })
    }
    #[inline(always)]
    unsafe fn and(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vandq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn xor(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { veorq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn add_words(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vaddq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn subtract_words(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vsubq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn multiply_words(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vmulq_s16(self.0, other.0) })
    }
    #[inline(always)]
    unsafe fn add(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        let sum = unsafe { vaddq_s32(vreinterpretq_s32_s16(self.0), vreinterpretq_s32_s16(other.0)) };
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vreinterpretq_s16_s32(sum) })
    }
    #[inline(always)]
    unsafe fn subtract(self, other: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        let difference = unsafe { vsubq_s32(vreinterpretq_s32_s16(self.0), vreinterpretq_s32_s16(other.0)) };
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vreinterpretq_s16_s32(difference) })
    }
    #[inline(always)]
    unsafe fn add_widened(self, sums: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        let total = unsafe { vpadalq_s32(vreinterpretq_s64_s16(self.0), vreinterpretq_s32_s16(sums.0)) };
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        Self(unsafe { vreinterpretq_s16_s64(total) })
    }
    #[inline(always)]
    unsafe fn multiply_add(self, a: Self, b: Self) -> Self {
        // SAFETY: by the contract of `Lanes`, the CPU has NEON.
        unsafe {
            let sum = vmlal_s16(vreinterpretq_s32_s16(self.0), vget_low_s16(a.0), vget_low_s16(b.0));
            Self(vreinterpretq_s16_s32(vmlal_high_s16(sum, a.0, b.0)))
        }
    }
}
