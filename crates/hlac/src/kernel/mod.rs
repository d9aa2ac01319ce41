//! The loops that make exact sums, one file per instruction set; [`crate::kernels`] names them.
//!
//! # Algorithm
//! The sum of a mask `{a, b, c}` is the sum of (product of the *pair* a, b) times (the *third* c). The 237 + 13 masks of
//! three and two cells share some 40 pairs; `plan.rs` says which pair serves which masks, in *tiles* whose sums fit the
//! registers. Products of pairs are 16 bits wide. Less 32 768 they are signed words, so that one instruction multiplies
//! them by the third and adds neighbouring products to 32-bit lanes. The correction, 32 768 times the sum of the thirds,
//! costs next to nothing. A 32-bit lane holds 128 rows of any voxels; after that it is added to 64-bit lanes, which
//! never overflow. Windows are cut at the octants' borders, and those of the upper half in X begin in a group of lanes
//! of their own, so octants cost nothing. Lanes without a window are 0 in every third: every shape is exact without code
//! for edges.
//!
//! *Folding* halves multiplications (Winograd, 1968). With pairs `p`, `q` and thirds `c`, `d` of two neighbouring rows,
//! `p c + q d = (p + d) (q + c) - p q - c d`, and the sums of `p q` and `c d` serve all masks of a pair or a third.
//! `p + d` fits a signed word because 255^2 + 255 < 2^16. The sums wrap modulo 2^32 and are exact because their true
//! value fits. Folding pays where additions have ports of their own: AMD's CPUs add four vectors while they multiply
//! two.
//!
//! # Alternatives measured, on a Zen 4 (3.69 GHz; with octants, 64^3)
//! - Won: folding 3 of 4 products, 0.68 to 0.59 ms. Folding all of them is bound by the adders, folding none by the
//!   multipliers.
//! - Won: `vpdpwssd` by assembly that keeps its place in the program: LLVM then spills no sums; 0.69 to 0.60 ms.
//! - Won: 64-bit totals of neighbouring lanes in place of upper and lower halves: half the stores, no drains later.
//! - Won: 16 tiles of 16 sums rather than 13 of 19: more multiplications of pairs, but hardly a spill; 0.61 to 0.59 ms.
//! - Lost: blocks that fit the first-level cache (20 KB instead of 38): 0.61 ms; twice the flushes cost more than L2.
//! - Open: 256^3 takes 49 ms where 64^3 scales to 41, because registers of windows go through the whole volume one after
//!   another and packing waits for memory. Totals for every register of a row would let neighbours share cache lines.
//! - Lost on paper: sharing a pair's product among its anchors. It saves 3 % of the multiplications at most, and its
//!   rows and lanes would need masks; Karatsuba over rows (3 products for 4) needs 17-bit sums of pairs.

use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::kernels::{self, Kernel};
use crate::{OctantSums, Voxels};

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod binary;
mod block;
mod body;
mod input;
mod lanes;
#[cfg(target_arch = "aarch64")]
mod neon;
mod plan;
mod scalar;
mod tiles;
pub(crate) mod windows;

pub(crate) use binary::sums as binary_sums;
pub(crate) use input::Input;

/// What an input adds to the octant sums of its volume, on this thread.
///
/// Inputs of 0 and 255 only take the way of [`binary_sums`], 1.2 to 1.5 times as fast.
pub(crate) fn sums(input: &Input<'_>) -> OctantSums {
    if binary::is_binary(input.voxels) { binary::sums(input) } else { run(kernels::active(), input) }
}

/// [`sums`], by the threads of the current rayon pool.
pub(crate) fn sums_in_pool(input: &Input<'_>) -> OctantSums {
    let planes = input.windows.len().div_ceil(4 * rayon::current_num_threads()).max(16);
    let starts: Vec<usize> = input.windows.clone().step_by(planes).collect();
    starts.into_par_iter().map(|start| sums(&input.part(start..input.windows.end.min(start + planes)))).reduce(
        OctantSums::zero,
        |mut total, part| {
            total += &part;
            total
        },
    )
}

/// What tests and benchmarks need beside the kernel in use.
impl Kernel {
    /// The octant sums of a volume by this kernel.
    ///
    /// # Panics
    /// If the kernel is not available.
    #[doc(hidden)]
    pub fn octants(self, volume: Voxels<'_>) -> OctantSums {
        run(self, &Input::whole(volume.shape(), 1, volume.as_slice()))
    }

    /// The octant sums of a volume in which every voxel that is not 0 counts as 255, by counting bits. The kernel in use
    /// takes this way for volumes of 0 and 255.
    #[doc(hidden)]
    pub fn octants_by_counting(volume: Voxels<'_>) -> OctantSums {
        binary::sums(&Input::whole(volume.shape(), 1, volume.as_slice()))
    }
}

/// What an input adds to the octant sums of its volume, by a given kernel.
///
/// # Panics
/// If the kernel is not available.
fn run(kernel: Kernel, input: &Input<'_>) -> OctantSums {
    assert!(kernel.is_available(), "the kernel {kernel} does not run on this CPU");
    match kernel {
        Kernel::Scalar => scalar::sums(input),
        #[cfg(target_arch = "aarch64")]
        // SAFETY: the assertion found that the CPU has NEON.
        Kernel::Neon => unsafe { neon::sums(input) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the assertion found that the CPU has AVX2.
        Kernel::Avx2 => unsafe { avx2::sums(input) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the assertion found that the CPU has AVX-512 F and BW.
        Kernel::Avx512 => unsafe { avx512::plain(input) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the assertion found that the CPU has AVX-512 F, BW and VNNI.
        Kernel::Avx512Vnni => unsafe { avx512::vnni(input) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the assertion found that the CPU has AVX-512 F, BW and VNNI.
        Kernel::Avx512VnniFolded => unsafe { avx512::vnni_folded(input) },
        // SAFETY: plain Rust runs on every CPU.
        _ => unsafe { body::sums::<lanes::Portable<4>, tiles::Wide, true>(input) },
    }
}
