//! The loops that make exact sums, one file per instruction set.
//!
//! The kernel is chosen once, at run time, from what the CPU has ([`active`]); the environment variable
//! [`VARIABLE`] forces another one. All give the same bits.

use std::sync::OnceLock;

use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::hlac::OctantSums;
use crate::volume::Shape;

pub mod scalar;
mod slab;

pub(super) use slab::Slab;

/// The environment variable that forces a kernel by its [`Kernel::name`].
pub const VARIABLE: &str = "HLACDB_KERNEL";

/// An implementation of the exact sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Kernel {
    /// The reference: window by window.
    Scalar,
}

impl Kernel {
    /// Every kernel of this build, the slowest first, whether the CPU has it or not.
    pub const ALL: &'static [Self] = &[Self::Scalar];

    /// The name that [`VARIABLE`] takes and `--version` shows.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
        }
    }

    /// Whether this CPU runs it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
        }
    }

    /// The exact octant sums of a grey volume of `shape` (every side at least 3; X fastest).
    ///
    /// # Panics
    /// Where a side is under 3, `voxels` is not as long as the shape says, or the kernel is not available.
    pub fn octants(self, shape: Shape, voxels: &[u8]) -> OctantSums {
        self.slab(&Slab::whole(shape, 1, voxels))
    }

    fn slab(self, slab: &Slab<'_>) -> OctantSums {
        match self {
            Self::Scalar => scalar::slab(slab),
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
    /// The kernel is part of this build but the CPU lacks the instructions.
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
    choose().unwrap_or_else(|_| fastest())
}

/// The kernels that this CPU runs, the slowest first.
pub fn available() -> impl Iterator<Item = Kernel> {
    Kernel::ALL.iter().copied().filter(|kernel| kernel.is_available())
}

/// The octant sums of a grey volume of `shape`, by the active kernel; volumes of 0 and 255 only go the way of
/// [`octants_binary`] by themselves.
///
/// # Panics
/// Where a side is under 3 or `voxels` is not as long as the shape says.
pub fn octants(shape: Shape, voxels: &[u8]) -> OctantSums {
    active().octants(shape, voxels)
}

/// The octant sums of a volume in which every voxel that is not 0 counts as 255.
///
/// # Panics
/// Where a side is under 3 or `voxels` is not as long as the shape says.
pub fn octants_binary(shape: Shape, voxels: &[u8]) -> OctantSums {
    let voxels: Vec<u8> = voxels.iter().map(|&voxel| if voxel == 0 { 0 } else { 255 }).collect();
    octants(shape, &voxels)
}

/// What a slab adds to the octant sums of its volume, by the active kernel, on this thread.
pub(super) fn sums(slab: &Slab<'_>) -> OctantSums {
    active().slab(slab)
}

/// [`sums`], by the threads of the current rayon pool.
pub(super) fn sums_in_pool(slab: &Slab<'_>) -> OctantSums {
    let planes = slab.windows.len().div_ceil(4 * rayon::current_num_threads()).max(8);
    let starts: Vec<usize> = slab.windows.clone().step_by(planes).collect();
    starts.into_par_iter().map(|start| sums(&slab.part(start..slab.windows.end.min(start + planes)))).reduce(
        OctantSums::zero,
        |mut total, part| {
            total += &part;
            total
        },
    )
}

fn fastest() -> Kernel {
    available().last().unwrap_or(Kernel::Scalar)
}

fn named(name: Option<&std::ffi::OsStr>) -> Result<Kernel, KernelError> {
    let Some(name) = name else { return Ok(fastest()) };
    let names = || available().map(Kernel::name).collect::<Vec<_>>().join(", ");
    match Kernel::ALL.iter().find(|kernel| name == kernel.name()) {
        None => Err(KernelError::Unknown {
            name: name.display().to_string().escape_debug().to_string(),
            available: names(),
        }),
        Some(kernel) if !kernel.is_available() => Err(KernelError::Unavailable { kernel: *kernel, available: names() }),
        Some(kernel) => Ok(*kernel),
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
    }
}
