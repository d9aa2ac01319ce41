//! Every kernel that this CPU has gives the bits of the scalar reference, whatever the volume.

use hlacdb::hlac::kernel::{self, Kernel};
use hlacdb::hlac::{
    self, ExtractError, Extraction, MASKS, MaskSpacing, OctantSums, SlabExtractor, VoxelBuf, Voxels, kernel::scalar,
};
use proptest::prelude::*;

/// What the voxels of a test volume are like.
#[derive(Clone, Copy, Debug)]
enum Content {
    Full,
    Random,
    Sparse,
    Bright,
    Binary,
}

fn volume(shape: [usize; 3], content: Content, seed: u64) -> VoxelBuf {
    let mut state = seed | 1;
    let voxel = |_| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        let byte = (state >> 24) as u8;
        match content {
            Content::Full => 255,
            Content::Random => byte,
            Content::Sparse => byte.saturating_sub(224) * 8,
            Content::Bright => 255 - byte / 64,
            Content::Binary => byte / 128 * 255,
        }
    };
    VoxelBuf::new((0..shape.iter().product::<usize>()).map(voxel).collect(), shape).unwrap()
}

fn content() -> impl Strategy<Value = Content> {
    prop_oneof![
        Just(Content::Full),
        Just(Content::Random),
        Just(Content::Sparse),
        Just(Content::Bright),
        Just(Content::Binary)
    ]
}

/// Thin, long and odd shapes of up to `most` voxels.
fn shape(least: usize, most: usize) -> impl Strategy<Value = [usize; 3]> {
    let side = move || prop_oneof![3 => least..least + 6, 2 => least..40, 1 => least..135];
    (side(), side(), side())
        .prop_map(|(z, y, x)| [z, y, x])
        .prop_filter("few enough voxels for the reference", move |shape| shape.iter().product::<usize>() <= most)
}

/// The definition itself, with spacing and a region; `None` for a region is everywhere.
fn by_definition(volume: Voxels<'_>, spacing: usize, region: Option<Voxels<'_>>) -> ([Vec<u64>; 8], [Vec<u64>; 8]) {
    let shape = volume.shape();
    let grid = shape.map(|side| side - 2 * spacing);
    let (mut counts, mut sums) = ([const { Vec::new() }; 8], [const { Vec::new() }; 8]);
    (counts.iter_mut().chain(&mut sums)).for_each(|values| *values = vec![0; MASKS.len()]);
    for z in 0..grid[0] {
        for y in 0..grid[1] {
            for x in 0..grid[2] {
                let upper = |axis: usize, at: usize| usize::from(at >= grid[axis] / 2);
                let octant = 4 * upper(0, z) + 2 * upper(1, y) + upper(2, x);
                for (index, mask) in MASKS.iter().enumerate() {
                    let at = |[dz, dy, dx]: [usize; 3]| {
                        ((z + spacing * dz) * shape[1] + y + spacing * dy) * shape[2] + x + spacing * dx
                    };
                    if mask.offsets().all(|cell| region.is_none_or(|region| region.as_slice()[at(cell)] != 0)) {
                        counts[octant][index] += 1;
                        sums[octant][index] +=
                            mask.offsets().map(|cell| u64::from(volume.as_slice()[at(cell)])).product::<u64>();
                    }
                }
            }
        }
    }
    (counts, sums)
}

fn assert_equal(found: &OctantSums, expected: &OctantSums, what: &str) {
    for (octant, (found, expected)) in found.0.iter().zip(expected.0.iter()).enumerate() {
        assert_eq!(found.windows, expected.windows, "{what}: windows of octant {octant}");
        for (mask, (found, expected)) in found.values.iter().zip(&expected.values).enumerate() {
            assert_eq!(found, expected, "{what}: mask {} in octant {octant}", MASKS[mask].letters());
        }
    }
}

/// The kernels under test; those of this build that the CPU lacks are named on stderr, not passed over in silence.
fn kernels() -> impl Iterator<Item = Kernel> {
    for kernel in Kernel::ALL.into_iter().filter(|kernel| !kernel.is_available()) {
        eprintln!("skipped: this CPU or build has no {kernel}");
    }
    kernel::available().filter(|&kernel| kernel != Kernel::Scalar)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    #[test]
    fn every_kernel_equals_the_reference(shape in shape(3, 12_000), content in content(), seed: u64) {
        let volume = volume(shape, content, seed);
        let expected = scalar::octants(shape, volume.as_voxels().as_slice());
        for kernel in kernels() {
            assert_equal(&kernel.octants(shape, volume.as_voxels().as_slice()), &expected, kernel.name());
        }
        assert_equal(&hlac::extract(volume.as_voxels()), &expected, "extract");
        assert_equal(&hlac::extract_parallel(volume.as_voxels()), &expected, "extract_parallel");
    }

    #[test]
    fn bits_equal_the_reference(shape in shape(3, 12_000), seed: u64) {
        let volume = volume(shape, Content::Binary, seed);
        let expected = scalar::octants(shape, volume.as_voxels().as_slice());
        assert_equal(&kernel::octants_binary(shape, volume.as_voxels().as_slice()), &expected, "octants_binary");
    }

    #[test]
    fn spacing_and_regions_equal_the_definition(
        shape in shape(9, 6_000),
        (content, inside) in (content(), content()),
        (spacing, parallel) in (0..3_usize, any::<bool>()),
        seed: u64,
    ) {
        let (spacing, volume) = (MaskSpacing::ALL[spacing], volume(shape, content, seed));
        let region = self::volume(shape, inside, seed ^ 0x55aa);
        let extraction = Extraction::new().spacing(spacing).parallel(parallel);
        let (volume, region) = (volume.as_voxels(), region.as_voxels());
        let (counts, sums) = by_definition(volume, spacing.voxels(), None);
        let found = extraction.sums(volume).unwrap();
        for octant in 0..8 {
            prop_assert_eq!(found.0[octant].windows, counts[octant][0]);
            prop_assert_eq!(found.0[octant].values.to_vec(), &sums[octant][..]);
        }
        let (counts, sums) = by_definition(volume, spacing.voxels(), Some(region));
        let found = extraction.sums_in(volume, region).unwrap();
        for octant in 0..8 {
            prop_assert_eq!(found.0[octant].windows.to_vec(), &counts[octant][..]);
            prop_assert_eq!(found.0[octant].values.to_vec(), &sums[octant][..]);
        }
    }

    #[test]
    fn slabs_equal_the_whole(shape in shape(3, 12_000), cuts in prop::collection::vec(1..9_usize, 1..5), seed: u64) {
        let volume = volume(shape, Content::Random, seed);
        let mut slabs = SlabExtractor::new(shape).unwrap();
        let (mut planes, mut cuts) = (volume.as_voxels().as_slice(), cuts.into_iter().cycle());
        while !planes.is_empty() {
            let (slab, rest) = planes.split_at(planes.len().min(cuts.next().unwrap() * shape[1] * shape[2]));
            slabs.push(slab).unwrap();
            planes = rest;
        }
        assert_equal(&slabs.finish().unwrap(), &hlac::extract(volume.as_voxels()), "slabs");
    }
}

/// 128 rows of 255 fill a 32-bit lane to 2^31 - 8 388 608: one more row overflows it. The chunks of this volume have 16
/// planes of 32 rows, so that their blocks are full; and the totals grow past 2^32.
#[test]
fn full_lanes_do_not_overflow() {
    let shape = [66, 130, 36];
    let volume = volume(shape, Content::Full, 0);
    let windows = (64 * 128 * 34) as u64;
    for kernel in kernels() {
        let octants = kernel.octants(shape, volume.as_voxels().as_slice());
        let total = octants.total();
        assert_eq!(total.windows, windows, "{kernel}");
        for (mask, &value) in MASKS.iter().zip(&total.values) {
            assert_eq!(value, windows * 255_u64.pow(mask.order() as u32), "{kernel}: {}", mask.letters());
        }
        assert!(octants.0.iter().all(|octant| octant.values[250] > 1 << 32), "{kernel}");
    }
}

#[test]
fn what_is_no_volume_of_windows_is_refused() {
    let volume = volume([8, 9, 10], Content::Random, 1);
    let error = Extraction::new().spacing(MaskSpacing::Four).sums(volume.as_voxels()).unwrap_err();
    assert_eq!(error, ExtractError::TooSmall { shape: [8, 9, 10], spacing: 4, needed: 9 });
    let region = self::volume([8, 9, 11], Content::Random, 1);
    assert!(matches!(
        Extraction::new().sums_in(volume.as_voxels(), region.as_voxels()),
        Err(ExtractError::RegionShape { volume: [8, 9, 10], region: [8, 9, 11] })
    ));
    assert!(SlabExtractor::new([3, 2, 3]).is_err());
    let mut slabs = SlabExtractor::new([8, 9, 10]).unwrap();
    let ragged = slabs.push(&[0; 91]).unwrap_err();
    assert_eq!(ragged, ExtractError::Planes { shape: [8, 9, 10], expected: 180, found: 91 });
    slabs.push(&[0; 90]).unwrap();
    assert!(slabs.push(&[0; 720]).is_err());
    assert_eq!(slabs.finish(), Err(ExtractError::Planes { shape: [8, 9, 10], expected: 720, found: 90 }));
}

#[test]
fn random_windows_are_the_same_everywhere() {
    let volume = volume([20, 30, 40], Content::Random, 7);
    let sampled = |windows, seed| hlac::extract_sampled(volume.as_voxels(), windows, seed).unwrap();
    let sums = sampled(1000, 42);
    assert_eq!(sums, sampled(1000, 42));
    assert_ne!(sums, sampled(1000, 43));
    assert_eq!(sums.windows, 1000);
    let exact = hlac::extract(volume.as_voxels()).total().moments();
    let there = 18 * 28 * 38;
    let most = sampled(there, 1).moments();
    assert!(exact.iter().zip(&most).all(|(a, b)| (a - b).abs() < 0.02));
    let more = hlac::extract_sampled(volume.as_voxels(), there + 1, 1);
    assert_eq!(
        more,
        Err(ExtractError::TooManyWindows { requested: there + 1, available: there }),
        "all of them are exact and cheaper"
    );
}
