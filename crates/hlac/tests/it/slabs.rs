//! A volume given in slabs has the sums of the whole.

use hlac::{ExtractError, Extraction, MaskSpacing, RegionSlabExtractor, SlabExtractor};
use proptest::prelude::*;

use crate::support::{Content, assert_equal, content, shape, volume};

/// Cuts planes into slabs whose thickness cycles through `cuts`.
fn slabs<'a>(voxels: &'a [u8], plane: usize, cuts: &'a [usize]) -> impl Iterator<Item = &'a [u8]> {
    let (mut rest, mut cuts) = (voxels, cuts.iter().cycle());
    std::iter::from_fn(move || {
        let length = rest.len().min(cuts.next()? * plane);
        let (slab, after) = rest.split_at(length);
        rest = after;
        (!slab.is_empty()).then_some(slab)
    })
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(40))]

    #[test]
    fn slabs_equal_the_whole(
        shape in shape(9, 12_000),
        content in content(),
        cuts in prop::collection::vec(1..9_usize, 1..5),
        (spacing, parallel) in (0..MaskSpacing::ALL.len(), any::<bool>()),
        seed: u64,
    ) {
        let volume = volume(shape, content, seed);
        let extraction = Extraction::new().spacing(MaskSpacing::ALL[spacing]).parallel(parallel);
        let mut extractor = extraction.slabs(shape).unwrap();
        for slab in slabs(volume.as_voxels().as_slice(), shape[1] * shape[2], &cuts) {
            extractor.push(slab).unwrap();
        }
        let expected = extraction.parallel(false).sums(volume.as_voxels()).unwrap();
        assert_equal(&extractor.finish().unwrap(), &expected, "slabs");
    }

    #[test]
    fn slabs_of_thin_volumes_equal_the_whole(
        shape in shape(3, 12_000),
        cuts in prop::collection::vec(1..9_usize, 1..5),
        seed: u64,
    ) {
        let volume = volume(shape, Content::Random, seed);
        let mut extractor = SlabExtractor::new(shape).unwrap();
        for slab in slabs(volume.as_voxels().as_slice(), shape[1] * shape[2], &cuts) {
            extractor.push(slab).unwrap();
        }
        assert_equal(&extractor.finish().unwrap(), &hlac::extract(volume.as_voxels()), "slabs");
    }

    #[test]
    fn slabs_of_a_region_equal_the_whole(
        shape in shape(9, 12_000),
        cuts in prop::collection::vec(1..9_usize, 1..5),
        spacing in 0..MaskSpacing::ALL.len(),
        seed: u64,
    ) {
        let (volume, region) = (volume(shape, Content::Random, seed), volume(shape, Content::Sparse, seed ^ 0x55aa));
        let (voxels, region) = (volume.as_voxels(), region.as_voxels());
        let extraction = Extraction::new().spacing(MaskSpacing::ALL[spacing]);
        let mut extractor = extraction.region_slabs(shape).unwrap();
        let plane = shape[1] * shape[2];
        for (slab, inside) in slabs(voxels.as_slice(), plane, &cuts).zip(slabs(region.as_slice(), plane, &cuts)) {
            extractor.push(slab, inside).unwrap();
        }
        prop_assert!(extractor.finish().unwrap() == extraction.sums_in(voxels, region).unwrap());
    }
}

#[test]
fn planes_that_do_not_make_up_the_volume_are_rejected() {
    let shape = [8, 9, 10];
    let mut extractor = SlabExtractor::new(shape).unwrap();
    let ragged = extractor.push(&[0; 91]).unwrap_err();
    assert_eq!(ragged, ExtractError::Planes { shape, expected: 180, found: 91 });
    extractor.push(&[0; 90]).unwrap();
    let beyond = extractor.push(&[0; 720]).unwrap_err();
    assert_eq!(beyond, ExtractError::Planes { shape, expected: 720, found: 810 });
    assert_eq!(extractor.finish(), Err(ExtractError::Planes { shape, expected: 720, found: 90 }));
    let mut extractor = RegionSlabExtractor::new(shape).unwrap();
    assert_eq!(
        extractor.push(&[0; 180], &[0; 90]),
        Err(ExtractError::Planes { shape, expected: 180, found: 90 }),
        "volume and region differ"
    );
    assert!(extractor.finish().is_err());
}
