//! The widest vectors of the machine for code that says nothing of vectors.
//!
//! What is inlined into [`with_wide_vectors`] is compiled twice: for the least machine, and for AVX2. Rust neither reorders nor
//! contracts floating-point arithmetic, so both give the same bits.

/// Does `work`, with 256-bit vectors where the machine has them. Mark `#[inline(always)]` what they should be used in.
#[inline(always)]
pub(super) fn with_wide_vectors<T>(work: impl FnOnce() -> T) -> T {
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
