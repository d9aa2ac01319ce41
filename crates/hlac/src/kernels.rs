//! Kernels: the implementations of the exact sums, one per instruction set.
//!
//! [`active`] says which one this process uses: the fastest that the CPU runs, chosen once, unless [`select`] came first.
//! Every kernel gives the same bits, so the choice changes the speed and nothing else.

use std::fmt;
use std::sync::OnceLock;

/// An implementation of the exact sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Kernel {
    /// The reference, window by window.
    Scalar,
    /// The algorithm of the vector kernels in plain Rust, for CPUs without one of them.
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
    /// Every kernel, roughly the slowest first, whether or not this build and CPU run it.
    pub const ALL: [Self; 7] =
        [Self::Scalar, Self::Portable, Self::Neon, Self::Avx2, Self::Avx512, Self::Avx512Vnni, Self::Avx512VnniFolded];

    /// The name, e.g. `avx512-vnni`.
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

    /// Whether this build contains the kernel and this CPU runs it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar | Self::Portable => true,
            #[cfg(target_arch = "aarch64")]
            Self::Neon => std::arch::is_aarch64_feature_detected!("neon"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512Vnni | Self::Avx512VnniFolded => {
                Self::Avx512.is_available() && is_x86_feature_detected!("avx512vnni")
            }
            _ => false,
        }
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Why [`select`] did not choose a kernel.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KernelError {
    /// No kernel has this name.
    #[error("there is no kernel {name:?}; this CPU runs {}", available_names())]
    Unknown {
        /// The name given.
        name: String,
    },
    /// This build does not contain the kernel, or this CPU lacks its instructions.
    #[error("the kernel {kernel} does not run on this CPU, which runs {}", available_names())]
    Unavailable {
        /// The kernel named.
        kernel: Kernel,
    },
    /// Another kernel is in use already.
    #[error("the kernel {active} is in use already")]
    InUse {
        /// The kernel in use.
        active: Kernel,
    },
}

/// The kernel of this process, set by the first call of [`active`] or [`select`].
static ACTIVE: OnceLock<Kernel> = OnceLock::new();

/// The kernel in use.
pub fn active() -> Kernel {
    *ACTIVE.get_or_init(fastest)
}

/// The kernels that this CPU runs, roughly the slowest first.
pub fn available() -> impl Iterator<Item = Kernel> {
    Kernel::ALL.into_iter().filter(|kernel| kernel.is_available())
}

/// Makes [`active`] the kernel of this name for the rest of the process, in place of the fastest.
///
/// Programs call this before anything else of this crate, to rule a kernel out on a CPU where it misbehaves.
///
/// # Errors
/// - [`KernelError::Unknown`] if no kernel has this name.
/// - [`KernelError::Unavailable`] if this CPU does not run it.
/// - [`KernelError::InUse`] if another kernel is in use already.
pub fn select(name: &str) -> Result<Kernel, KernelError> {
    let kernel = named(name)?;
    match *ACTIVE.get_or_init(|| kernel) {
        active if active == kernel => Ok(kernel),
        active => Err(KernelError::InUse { active }),
    }
}

/// The fastest kernel of this CPU.
///
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

fn named(name: &str) -> Result<Kernel, KernelError> {
    match Kernel::ALL.into_iter().find(|kernel| kernel.name() == name) {
        Some(kernel) if kernel.is_available() => Ok(kernel),
        Some(kernel) => Err(KernelError::Unavailable { kernel }),
        None => Err(KernelError::Unknown { name: name.to_owned() }),
    }
}

fn available_names() -> String {
    available().map(Kernel::name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_kernels_are_resolved_or_rejected() {
        assert_eq!(named("scalar"), Ok(Kernel::Scalar));
        let error = named("mmx").unwrap_err().to_string();
        assert!(error.starts_with("there is no kernel \"mmx\"; this CPU runs scalar, portable"), "{error}");
        for kernel in Kernel::ALL {
            let expected = if kernel.is_available() { Ok(kernel) } else { Err(KernelError::Unavailable { kernel }) };
            assert_eq!(named(kernel.name()), expected);
        }
        // No build contains the kernels of two architectures.
        assert!(available().count() < Kernel::ALL.len());
    }

    #[test]
    fn a_kernel_in_use_cannot_be_replaced() {
        let kernel = active();
        assert_eq!(select(kernel.name()), Ok(kernel));
        let other = available().find(|&other| other != kernel).unwrap();
        assert_eq!(select(other.name()), Err(KernelError::InUse { active: kernel }));
        assert_eq!(active(), kernel);
    }
}
