//! The loops that make exact sums, one file per instruction set.
//!
//! The kernel is chosen once, at run time, from what the CPU has ([`active`]); the environment variable
//! [`VARIABLE`] forces another one. All give the same bits.
//!
//! # How
//! The sum of a mask `{a, b, c}` is the sum of (product of the *pair* a, b) times (the *third* c). 237 + 13 masks share
//! some 40 pairs; `plan.rs` says which pair serves which masks, in *tiles* whose sums fit the registers. Products
//! of pairs are 16 bits wide; less 32 768 they are signed words, multiplied with the third and added in pairs to
//! 32-bit lanes by one instruction; what was taken away is 32 768 times the sum of the thirds, which costs next to
//! nothing. 128 rows fit a 32-bit lane whatever the voxels are; then it is added to 64-bit lanes, which never overflow.
//! Windows are cut at the octants' borders, and those of an upper half in X begin with a lane of their own, so
//! that octants cost nothing. Lanes without a window are 0 in every third: no code for edges, exact for every shape.
//!
//! *Folding* halves multiplications (Winograd, 1968): with `p`, `q` pairs and `c`, `d` thirds of two neighbouring rows,
//! `p c + q d = (p + d) (q + c) - p q - c d`, and the sums of `p q` and `c d` serve all masks of a pair or a third.
//! `p + d` fits a signed word, as 255^2 + 255 < 2^16; the sums are made modulo 2^32, and exact because their true
//! value fits. It pays where additions have ports of their own: AMD's CPUs add four vectors while they multiply two.
//!
//! # What was tried, on a Zen 4 (3.69 GHz; all with octants, 64^3)
//! - Won: folding 3 of 4 products, 0.68 to 0.59 ms: all of them would bind the adders, none the multipliers.
//! - Won: `vpdpwssd` by assembly that keeps its place in the program: LLVM then spills no sums; 0.69 to 0.60 ms.
//! - Won: 64-bit totals of neighbouring lanes in place of upper and lower halves: half the stores, no drains to come.
//! - Won: 16 tiles of 16 sums rather than 13 of 19: more multiplications of pairs, but hardly a spill; 0.61 to 0.59 ms.
//! - Lost: blocks that fit the first-level cache (20 KB for 38): 0.61 ms; twice the flushes cost more than L2.
//! - Open: 256^3 takes 49 ms where 64^3 scales to 41: registers of windows go through the whole volume one after another, and
//!   packing waits for memory. Totals for every register of a row would let neighbours share their cache lines.
//! - Lost on paper: sharing a pair's product among its anchors. It saves 3 % of the multiplications at most, and its
//!   rows and lanes would need masks; Karatsuba over rows (3 products for 4) needs 17-bit sums of pairs.

use std::sync::OnceLock;

use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::OctantSums;
use crate::voxels::Shape;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod binary;
mod block;
mod body;
mod lanes;
#[cfg(target_arch = "aarch64")]
mod neon;
mod plan;
pub mod scalar;
mod slab;
mod tiles;
pub(super) mod windows;

pub(super) use slab::Slab;

/// The environment variable that forces a kernel by its [`Kernel::name`].
pub const VARIABLE: &str = "HLACDB_KERNEL";

/// An implementation of the exact sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kernel {
    /// The reference: window by window.
    Scalar,
    /// The body of the vector kernels in plain Rust, for CPUs without one of theirs.
    Portable,
    /// Arm's NEON.
    Neon,
    /// AVX2.
    Avx2,
    /// AVX-512 F and BW.
    Avx512,
    /// AVX-512 with VNNI, one product per multiplication: for Intel's CPUs.
    Avx512Vnni,
    /// AVX-512 with VNNI, mostly two products per multiplication: for AMD's CPUs.
    Avx512VnniFolded,
}

impl Kernel {
    /// Every kernel, roughly the slowest first, whether this build and CPU have it or not.
    pub const ALL: [Self; 7] =
        [Self::Scalar, Self::Portable, Self::Neon, Self::Avx2, Self::Avx512, Self::Avx512Vnni, Self::Avx512VnniFolded];

    /// The name that [`VARIABLE`] takes and `--version` shows.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Portable => "portable",
            Self::Neon => "neon",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Avx512Vnni => "avx512-vnni",
            Self::Avx512VnniFolded => "avx512-vnni-folded",
        }
    }

    /// Whether this build has it and this CPU runs it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar | Self::Portable => true,
            #[cfg(target_arch = "aarch64")]
            Self::Neon => neon::is_available(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2::is_available(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512::has_plain(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512Vnni | Self::Avx512VnniFolded => avx512::has_vnni(),
            #[allow(unreachable_patterns)] // Unreachable where a build has them all.
            _ => false,
        }
    }

    /// The exact octant sums of a grey volume of `shape` (every side at least 3; X fastest), by this kernel.
    ///
    /// # Panics
    /// Where a side is under 3, `voxels` is not as long as the shape says, or the kernel is not available.
    pub fn octants(self, shape: Shape, voxels: &[u8]) -> OctantSums {
        self.slab(&Slab::whole(shape, 1, voxels))
    }

    /// What a slab adds to the octant sums of its volume.
    pub(super) fn slab(self, slab: &Slab<'_>) -> OctantSums {
        assert!(self.is_available(), "the kernel {self} is not available here");
        match self {
            Self::Scalar => scalar::slab(slab),
            #[cfg(target_arch = "aarch64")]
            // SAFETY: the CPU was just found to have the instructions, here and below.
            Self::Neon => unsafe { neon::sums(slab) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: the CPU was just found to have the instructions, here and below.
            Self::Avx2 => unsafe { avx2::sums(slab) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx512 => unsafe { avx512::plain(slab) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx512Vnni => unsafe { avx512::vnni(slab) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: as above.
            Self::Avx512VnniFolded => unsafe { avx512::vnni_folded(slab) },
            // SAFETY: plain Rust runs everywhere.
            _ => unsafe { body::sums::<lanes::Portable<4>, tiles::Wide, true>(slab) },
        }
    }
}

impl std::fmt::Display for Kernel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// [`VARIABLE`] names no kernel that runs here.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KernelError {
    /// No kernel has this name.
    #[error("{VARIABLE} is {name}, which is no kernel; kernels of this CPU: {available}: unset it or take one of them")]
    Unknown {
        /// The name found, escaped.
        name: String,
        /// The names that would do.
        available: String,
    },
    /// There is such a kernel, but this build or CPU lacks the instructions.
    #[error(
        "{VARIABLE} is {kernel}, which this CPU does not run; kernels of this CPU: {available}: unset it or take one of them"
    )]
    Unavailable {
        /// The kernel that was asked for.
        kernel: Kernel,
        /// The names that would do.
        available: String,
    },
}

/// The kernel that [`VARIABLE`] names, or else the fastest that this CPU runs. Made once; later changes of the
/// environment are not seen.
///
/// Programs call this first and show the error; the library's own functions take the fastest when it fails.
///
/// # Errors
/// [`KernelError`] where the variable names no kernel, or one that this CPU does not run.
pub fn choose() -> Result<Kernel, KernelError> {
    static CHOICE: OnceLock<Result<Kernel, KernelError>> = OnceLock::new();
    CHOICE.get_or_init(|| named(std::env::var_os(VARIABLE).as_deref())).clone()
}

/// The kernel in use: [`choose`], or the fastest available where that fails.
pub fn active() -> Kernel {
    static ACTIVE: OnceLock<Kernel> = OnceLock::new();
    *ACTIVE.get_or_init(|| choose().unwrap_or_else(|_| fastest()))
}

/// The kernels that this CPU runs, roughly the slowest first.
pub fn available() -> impl Iterator<Item = Kernel> {
    Kernel::ALL.into_iter().filter(|kernel| kernel.is_available())
}

/// The octant sums of a grey volume of `shape`, by the active kernel; volumes of 0 and 255 only go the way of
/// [`octants_binary`] by themselves, 1.2 to 1.5 times as fast.
///
/// # Panics
/// Where a side is under 3 or `voxels` is not as long as the shape says.
pub fn octants(shape: Shape, voxels: &[u8]) -> OctantSums {
    sums(&Slab::whole(shape, 1, voxels))
}

/// The octant sums of a volume in which every voxel that is not 0 counts as 255, by counting bits.
///
/// # Panics
/// Where a side is under 3 or `voxels` is not as long as the shape says.
pub fn octants_binary(shape: Shape, voxels: &[u8]) -> OctantSums {
    binary::sums(&Slab::whole(shape, 1, voxels))
}

/// What a slab adds to the octant sums of its volume, on this thread.
pub(super) fn sums(slab: &Slab<'_>) -> OctantSums {
    if binary::is_binary(slab.voxels) { binary::sums(slab) } else { active().slab(slab) }
}

/// [`sums`], by the threads of the current rayon pool.
pub(super) fn sums_in_pool(slab: &Slab<'_>) -> OctantSums {
    let planes = slab.windows.len().div_ceil(4 * rayon::current_num_threads()).max(16);
    let starts: Vec<usize> = slab.windows.clone().step_by(planes).collect();
    starts.into_par_iter().map(|start| sums(&slab.part(start..slab.windows.end.min(start + planes)))).reduce(
        OctantSums::zero,
        |mut total, part| {
            total += &part;
            total
        },
    )
}

/// Folding wins where vectors are added on ports that do not multiply: on AMD's CPUs, not on Intel's, whose 512-bit
/// registers have two ports for both.
fn fastest() -> Kernel {
    let suits = |kernel: &Kernel| *kernel != Kernel::Avx512VnniFolded || !is_intel();
    available().filter(suits).last().unwrap_or(Kernel::Portable)
}

#[cfg(target_arch = "x86_64")]
fn is_intel() -> bool {
    let id = std::arch::x86_64::__cpuid(0);
    [id.ebx, id.edx, id.ecx].map(u32::to_le_bytes).concat() == b"GenuineIntel"
}

#[cfg(not(target_arch = "x86_64"))]
fn is_intel() -> bool {
    false
}

fn named(name: Option<&std::ffi::OsStr>) -> Result<Kernel, KernelError> {
    let Some(name) = name else { return Ok(fastest()) };
    let names = || available().map(Kernel::name).collect::<Vec<_>>().join(", ");
    match Kernel::ALL.into_iter().find(|kernel| name == kernel.name()) {
        None => {
            let name = name.display().to_string().escape_debug().to_string();
            Err(KernelError::Unknown { name, available: names() })
        }
        Some(kernel) if !kernel.is_available() => Err(KernelError::Unavailable { kernel, available: names() }),
        Some(kernel) => Ok(kernel),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kernel_is_named_or_refused_in_a_sentence() {
        assert_eq!(named(None), Ok(fastest()));
        assert_eq!(named(Some("scalar".as_ref())), Ok(Kernel::Scalar));
        let error = named(Some("mmx".as_ref())).unwrap_err().to_string();
        assert!(error.starts_with("HLACDB_KERNEL is mmx, which is no kernel; kernels of this CPU: scalar"), "{error}");
        let Some(missing) = Kernel::ALL.into_iter().find(|kernel| !kernel.is_available()) else { return };
        let error = named(Some(missing.name().as_ref())).unwrap_err();
        assert!(matches!(error, KernelError::Unavailable { .. }), "{error}");
    }
}
