//! Fixtures, generated volumes, and comparison.

use std::path::PathBuf;

use hlac::{MASKS, OctantSums, VoxelBuf};
use proptest::prelude::*;
use serde_json::Value;

/// A file of `tests/fixtures`.
pub(crate) fn fixture(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// A JSON fixture.
pub(crate) fn json(name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(fixture(name)).unwrap()).unwrap()
}

/// A volume of the fixtures: `.npy` version 1, `u8`, C order.
pub(crate) fn npy(name: &str) -> VoxelBuf {
    let bytes = std::fs::read(fixture(name)).unwrap();
    let (magic, rest) = bytes.split_at(10);
    assert_eq!(magic[..8], *b"\x93NUMPY\x01\x00", "{name}");
    let (header, voxels) = rest.split_at(usize::from(u16::from_le_bytes([magic[8], magic[9]])));
    let header = std::str::from_utf8(header).unwrap();
    assert!(header.contains("'descr': '|u1'") && header.contains("'fortran_order': False"), "{name}: {header}");
    let shape = header.split_once('(').unwrap().1.split_once(')').unwrap().0;
    let sides: Vec<usize> = shape.split(',').map(|side| side.trim().parse().unwrap()).collect();
    VoxelBuf::new(voxels.to_vec(), sides.try_into().unwrap()).unwrap()
}

/// The integers of a JSON array.
pub(crate) fn integers(value: &Value) -> Vec<u64> {
    value.as_array().unwrap().iter().map(|number| number.as_u64().unwrap()).collect()
}

/// What the voxels of a generated volume are like.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Content {
    Full,
    Random,
    Sparse,
    Bright,
    Binary,
}

pub(crate) fn volume(shape: [usize; 3], content: Content, seed: u64) -> VoxelBuf {
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

pub(crate) fn content() -> impl Strategy<Value = Content> {
    prop_oneof![
        Just(Content::Full),
        Just(Content::Random),
        Just(Content::Sparse),
        Just(Content::Bright),
        Just(Content::Binary)
    ]
}

/// Thin, long and odd shapes of up to `most` voxels.
pub(crate) fn shape(least: usize, most: usize) -> impl Strategy<Value = [usize; 3]> {
    let side = move || prop_oneof![3 => least..least + 6, 2 => least..40, 1 => least..135];
    (side(), side(), side())
        .prop_map(|(z, y, x)| [z, y, x])
        .prop_filter("few enough voxels for the reference", move |shape| shape.iter().product::<usize>() <= most)
}

pub(crate) fn assert_equal(found: &OctantSums, expected: &OctantSums, what: &str) {
    for (octant, (found, expected)) in found.octants().iter().zip(expected.octants()).enumerate() {
        assert_eq!(found.windows, expected.windows, "{what}: windows of octant {octant}");
        for (mask, (found, expected)) in found.values.iter().zip(&expected.values).enumerate() {
            assert_eq!(found, expected, "{what}: mask {} in octant {octant}", MASKS[mask].letters());
        }
    }
}
