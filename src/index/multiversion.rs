//! Functions compiled for two instruction sets, and prefetching.
//!
//! Code inlined into [`multiversioned`] is compiled twice: for the baseline of the target and for AVX2; which of the two
//! runs is decided at run time. Rust neither reorders nor contracts floating-point arithmetic, so both give the same
//! bits.
//!
//! This file and the kernels of `hlac` are the only places with unsafe code.

/// Runs `work`, with 256-bit vectors where the CPU has AVX2. Functions that should use them must be
/// `#[inline(always)]`.
#[inline(always)]
pub(super) fn multiversioned<T>(work: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the CPU has AVX2, as the line above has checked.
        #[allow(unsafe_code, reason = "the compiler cannot know the features of the CPU")]
        return unsafe { with_avx2(work) };
    }
    work()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<T>(work: impl FnOnce() -> T) -> T {
    work()
}

/// Prefetches memory that will be read soon. Does nothing on other CPUs than x86-64.
#[inline(always)]
pub(super) fn prefetch<T>(values: &[T]) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        /// Bytes of a cache line.
        const LINE: usize = 64;
        let first = values.as_ptr().cast::<i8>();
        for offset in (0..size_of_val(values)).step_by(LINE) {
            // SAFETY: `offset` lies within `values`. A prefetch is a hint: it reads nothing and cannot fault.
            #[allow(unsafe_code, reason = "the instruction takes a pointer")]
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(first.add(offset));
            }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = values;
}
