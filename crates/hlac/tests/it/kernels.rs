//! Every kernel that this CPU runs gives the bits of the scalar reference, whatever the volume.

use std::io::Write;
use std::sync::Once;

use hlac::MASKS;
use hlac::kernels::{self, Kernel};
use proptest::prelude::*;

use crate::support::{Content, assert_equal, content, shape, volume};

/// The kernels under test. Those that cannot run here are reported by name.
fn tested() -> impl Iterator<Item = Kernel> {
    static REPORT: Once = Once::new();
    REPORT.call_once(|| {
        let skipped = Kernel::ALL.into_iter().filter(|kernel| !kernel.is_available());
        for kernel in skipped {
            // Unlike `eprintln!`, this is shown for tests that pass, too.
            let _ = writeln!(std::io::stderr(), "skipped: the kernel {kernel} does not run on this CPU");
        }
    });
    kernels::available().filter(|&kernel| kernel != Kernel::Scalar)
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(40))]

    #[test]
    fn every_kernel_equals_the_reference(shape in shape(3, 12_000), content in content(), seed: u64) {
        let volume = volume(shape, content, seed);
        let voxels = volume.as_voxels();
        let expected = Kernel::Scalar.octants(voxels);
        for kernel in tested() {
            assert_equal(&kernel.octants(voxels), &expected, kernel.name());
        }
        assert_equal(&hlac::extract(voxels), &expected, "extract");
        assert_equal(&hlac::extract_parallel(voxels), &expected, "extract_parallel");
    }

    #[test]
    fn counting_bits_equals_the_reference(shape in shape(3, 12_000), seed: u64) {
        let volume = volume(shape, Content::Binary, seed);
        let expected = Kernel::Scalar.octants(volume.as_voxels());
        assert_equal(&Kernel::octants_by_counting(volume.as_voxels()), &expected, "octants_by_counting");
    }
}

/// 128 rows of 255 fill a 32-bit lane to 2^31 - 8 388 608: one more row overflows it. The chunks of this volume have 16
/// planes of 32 rows, so that their blocks are full; and the totals exceed 2^32.
#[test]
fn full_lanes_do_not_overflow() {
    let volume = volume([66, 130, 36], Content::Full, 0);
    let windows = (64 * 128 * 34) as u64;
    for kernel in tested() {
        let octants = kernel.octants(volume.as_voxels());
        let total = octants.total();
        assert_eq!(total.windows, windows, "{kernel}");
        for (mask, &value) in MASKS.iter().zip(&total.values) {
            assert_eq!(value, windows * 255_u64.pow(mask.order() as u32), "{kernel}: {}", mask.letters());
        }
        assert!(octants.octants().iter().all(|octant| octant.values[250] > 1 << 32), "{kernel}");
    }
}

/// The kernel that this build must have on any CPU of its architecture, and the choice among those available.
#[test]
fn the_active_kernel_is_available() {
    assert!(Kernel::Scalar.is_available() && Kernel::Portable.is_available());
    assert!(kernels::active().is_available());
    assert_ne!(kernels::active(), Kernel::Scalar, "the reference is never the fastest");
    #[cfg(target_arch = "aarch64")]
    assert_eq!(kernels::active(), Kernel::Neon);
}
