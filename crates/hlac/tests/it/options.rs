//! Spacing, regions and random windows; and what is rejected.

use hlac::{ExtractError, Extraction, MASKS, MaskSpacing, SlabExtractor, Voxels};
use proptest::prelude::*;

use crate::support::{Content, content, shape, volume};

/// The definition itself, with spacing and a region: for each octant, the windows and the sum of each mask. Without a region
/// every voxel is inside.
fn by_definition(volume: Voxels<'_>, spacing: usize, region: Option<Voxels<'_>>) -> ([[u64; 251]; 8], [[u64; 251]; 8]) {
    let shape = volume.shape();
    let grid = shape.map(|side| side - 2 * spacing);
    let (mut windows, mut sums) = ([[0; 251]; 8], [[0; 251]; 8]);
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
                        windows[octant][index] += 1;
                        let intensity = |cell| u64::from(volume.as_slice()[at(cell)]);
                        sums[octant][index] += mask.offsets().map(intensity).product::<u64>();
                    }
                }
            }
        }
    }
    (windows, sums)
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(40))]

    #[test]
    fn spacing_and_regions_equal_the_definition(
        shape in shape(9, 6_000),
        (content, inside) in (content(), content()),
        (spacing, parallel) in (0..MaskSpacing::ALL.len(), any::<bool>()),
        seed: u64,
    ) {
        let (spacing, volume) = (MaskSpacing::ALL[spacing], volume(shape, content, seed));
        let region = self::volume(shape, inside, seed ^ 0x55aa);
        let (voxels, region) = (volume.as_voxels(), region.as_voxels());
        let extraction = Extraction::new().spacing(spacing).parallel(parallel);
        let (windows, sums) = by_definition(voxels, spacing.voxels(), None);
        for (octant, found) in extraction.sums(voxels).unwrap().octants().iter().enumerate() {
            prop_assert_eq!(found.windows, windows[octant][0]);
            prop_assert_eq!(found.values, sums[octant]);
        }
        let (windows, sums) = by_definition(voxels, spacing.voxels(), Some(region));
        for (octant, found) in extraction.sums_in(voxels, region).unwrap().octants().iter().enumerate() {
            prop_assert_eq!(found.windows, windows[octant]);
            prop_assert_eq!(found.values, sums[octant]);
        }
    }
}

#[test]
fn volumes_without_windows_and_regions_of_another_shape_are_rejected() {
    let volume = volume([8, 9, 10], Content::Random, 1);
    let error = Extraction::new().spacing(MaskSpacing::Four).sums(volume.as_voxels()).unwrap_err();
    assert_eq!(error, ExtractError::TooSmall { shape: [8, 9, 10], spacing: 4, needed: 9 });
    assert_eq!(error.hint(), Some("take a smaller spacing"));
    let region = self::volume([8, 9, 11], Content::Random, 1);
    let error = Extraction::new().sums_in(volume.as_voxels(), region.as_voxels()).unwrap_err();
    assert_eq!(error, ExtractError::RegionShape { volume: [8, 9, 10], region: [8, 9, 11] });
    assert_eq!(SlabExtractor::new([3, 2, 3]).unwrap_err().hint(), None, "no smaller spacing exists");
    let huge = [1 << 30, 1 << 30, 1 << 30];
    assert_eq!(Extraction::new().slabs(huge).unwrap_err(), ExtractError::TooLarge { shape: huge });
    assert!(Extraction::new().region_slabs(huge).is_err());
}

#[test]
fn random_windows_are_reproducible() {
    let volume = volume([20, 30, 40], Content::Random, 7);
    let sampled = |windows, seed| hlac::extract_sampled(volume.as_voxels(), windows, seed).unwrap();
    let sums = sampled(1000, 42);
    assert_eq!(sums, sampled(1000, 42));
    assert_ne!(sums, sampled(1000, 43));
    assert_eq!(sums.windows, 1000);
    let exact = hlac::extract(volume.as_voxels()).total().moments();
    let available = 18 * 28 * 38;
    let most = sampled(available, 1).moments();
    assert!(exact.iter().zip(&most).all(|(a, b)| (a - b).abs() < 0.02));
    let error = hlac::extract_sampled(volume.as_voxels(), available + 1, 1);
    assert_eq!(error, Err(ExtractError::TooManyWindows { requested: available + 1, available }));
}
