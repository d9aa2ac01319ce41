//! The widest vectors of the machine for code that says nothing of vectors, and reading ahead.
//!
//! What is inlined into [`multiversioned`] is compiled twice: for the least machine, and for AVX2. Rust neither reorders nor
//! contracts floating-point arithmetic, so both give the same bits.

/// Does `work`, with 256-bit vectors where the machine has them. Mark `#[inline(always)]` what they should be used in.
#[inline(always)]
pub(super) fn multiversioned<T>(work: impl FnOnce() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2, as was just asked.
        #[allow(unsafe_code, reason = "the compiler cannot know what the machine has")]
        return unsafe { with_avx2(work) };
    }
    work()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<T>(work: impl FnOnce() -> T) -> T {
    work()
}

/// Asks for memory that will be read soon, where the machine can be asked (x86-64); does nothing else.
#[inline(always)]
pub(super) fn prefetch<T>(values: &[T]) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        /// Bytes that come together.
        const LINE: usize = 64;
        let first = values.as_ptr().cast::<i8>();
        for line in (0..size_of_val(values)).step_by(LINE) {
            // SAFETY: a hint: nothing is read and no address faults; this one lies within `values`.
            #[allow(unsafe_code, reason = "the hint takes a pointer")]
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(first.add(line));
            }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = values;
}
