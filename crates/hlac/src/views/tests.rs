//! The views against a plain implementation of their definitions, voxel by voxel.

use proptest::prelude::*;

use super::*;
use crate::kernels::Kernel;
use crate::voxels::Shape;

/// A voxel by its position, borders replicated.
fn clamped(shape: Shape, voxels: &[u8], position: [i64; 3]) -> i64 {
    let [z, y, x] = [0, 1, 2].map(|axis| position[axis].clamp(0, shape[axis] as i64 - 1) as usize);
    i64::from(voxels[(z * shape[1] + y) * shape[2] + x])
}

fn positions(shape: Shape) -> impl Iterator<Item = [i64; 3]> {
    let [depth, height, width] = shape.map(|side| side as i64);
    (0..depth).flat_map(move |z| (0..height).flat_map(move |y| (0..width).map(move |x| [z, y, x])))
}

fn from_fn(shape: Shape, mut voxel: impl FnMut(usize, usize, usize) -> u8) -> VoxelBuf {
    let voxels = positions(shape).map(|position| {
        let [z, y, x] = position.map(|at| at as usize);
        voxel(z, y, x)
    });
    VoxelBuf::new(voxels.collect(), shape).unwrap()
}

fn plain_stretch(voxels: &[u8]) -> Vec<u8> {
    let n = voxels.len();
    let reached = |level: i64| voxels.iter().filter(|&&v| i64::from(v) <= level).count();
    let low = (0..256).find(|&level| 100 * reached(level) >= n).unwrap();
    let high = (0..256).find(|&level| 100 * reached(level) >= 99 * n).unwrap().max(low + 1);
    let map = |v: i64| (510 * (v - low) + high - low).div_euclid(2 * (high - low)).clamp(0, 255);
    voxels.iter().map(|&v| map(i64::from(v)) as u8).collect()
}

fn plain_average(shape: Shape, voxels: &[u8], side: i64) -> Vec<u8> {
    let cube = side.pow(3);
    let mean = |[z, y, x]: [i64; 3]| {
        let inside = positions([side as usize; 3]);
        let sum: i64 = inside.map(|[a, b, c]| clamped(shape, voxels, [z * side + a, y * side + b, x * side + c])).sum();
        ((sum + cube / 2) / cube) as u8
    };
    positions(shape.map(|length| length / side as usize)).map(mean).collect()
}

fn plain_differences(shape: Shape, voxels: &[u8]) -> Vec<i64> {
    let difference = |[z, y, x]: [i64; 3]| {
        let near = positions([3, 3, 3]).map(|[a, b, c]| clamped(shape, voxels, [z + a - 1, y + b - 1, x + c - 1]));
        27 * clamped(shape, voxels, [z, y, x]) - near.sum::<i64>()
    };
    positions(shape).map(difference).collect()
}

fn plain_detail(differences: &[i64]) -> Vec<u8> {
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<i64>() as f64 / n;
    let square = differences.iter().map(|d| d * d).sum::<i64>() as f64 / n;
    let deviation = (square - mean * mean).max(0.0).sqrt();
    let map = |&d: &i64| match deviation {
        0.0 => 128,
        _ => (128.0 + 42.0 * d as f64 / deviation).round().clamp(0.0, 255.0) as u8,
    };
    differences.iter().map(map).collect()
}

fn plain_rank(voxels: &[u8]) -> Vec<u8> {
    let n = voxels.len();
    let rank = |&v: &u8| {
        let at_most = voxels.iter().filter(|&&other| other <= v).count();
        let equal = voxels.iter().filter(|&&other| other == v).count();
        ((255 * (2 * at_most - equal) + n) / (2 * n)) as u8
    };
    voxels.iter().map(rank).collect()
}

fn plain(volume: Voxels<'_>, view: View) -> Option<Vec<u8>> {
    let scaled = |scale: ViewScale| {
        let shape = scale.shape_of(volume.shape())?;
        let stretched = plain_stretch(volume.as_slice());
        let side = scale.side() as i64;
        Some((shape, if side == 1 { stretched } else { plain_average(volume.shape(), &stretched, side) }))
    };
    Some(match view {
        View::Full => volume.as_slice().to_vec(),
        View::Stretch(scale) => scaled(scale)?.1,
        View::Sign(scale) => {
            let (shape, voxels) = scaled(scale)?;
            plain_differences(shape, &voxels).iter().map(|&d| if d > 0 { 255 } else { 0 }).collect()
        }
        View::Detail => {
            let (shape, voxels) = scaled(ViewScale::One)?;
            plain_detail(&plain_differences(shape, &voxels))
        }
        View::Rank(ViewScale::One) => plain_rank(volume.as_slice()),
        View::Rank(scale) => plain_rank(&scaled(scale)?.1),
    })
}

/// Volumes of several kinds: noise, noise over part of the range, few levels, a smooth gradient, a constant.
fn volumes(largest: Shape) -> impl Strategy<Value = VoxelBuf> {
    let shape = (3..=largest[0], 3..=largest[1], 3..=largest[2]);
    (shape, 0..5_u8, any::<u8>(), any::<u64>()).prop_map(|((z, y, x), kind, level, seed)| {
        let mut state = seed | 1;
        let mut noise = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 32) as u8
        };
        let voxel = |z: usize, y: usize, x: usize| match kind {
            0 => noise(),
            1 => level.saturating_add(noise() % 16),
            2 => (noise() % 3).wrapping_mul(level),
            3 => ((z * 7 + y * 5 + x * 3) as u8).wrapping_add(noise() % 4),
            _ => level,
        };
        from_fn([z, y, x], voxel)
    })
}

proptest! {
    #![proptest_config(hlacdb_testing::cases(48))]

    #[test]
    fn views_follow_their_definitions(volume in volumes([14, 13, 18])) {
        for view in View::ALL {
            let applied = view.apply(volume.as_voxels());
            prop_assert_eq!(applied.as_ref().map(VoxelBuf::shape), view.shape_of(volume.shape()));
            prop_assert_eq!(applied.map(VoxelBuf::into_vec), plain(volume.as_voxels(), view), "{}", view);
        }
    }

    #[test]
    fn descriptions_are_the_sums_of_the_mapped_copies(volume in volumes([12, 9, 80])) {
        let voxels = volume.as_voxels();
        let described = describe(voxels, &View::ALL);
        let copies: Vec<_> = View::ALL.iter().filter_map(|&view| Some((view, view.apply(voxels)?))).collect();
        prop_assert_eq!(described.len(), copies.len());
        for ((view, sums), (mapped_view, copy)) in described.iter().zip(&copies) {
            prop_assert_eq!(view, mapped_view);
            prop_assert!(*sums == Kernel::Scalar.octants(copy.as_voxels()), "{}", view);
        }
    }
}

#[test]
fn names_and_codes_do_not_change() {
    let named: Vec<_> = View::ALL.iter().map(|view| format!("{}={view}", view.code())).collect();
    assert_eq!(
        named.join(" "),
        "0=full@1 1=stretch@1 2=stretch@2 3=stretch@4 4=sign@1 5=sign@2 6=sign@4 7=detail@1 8=rank@1 9=rank@2 10=rank@4"
    );
    for view in View::ALL {
        assert_eq!((view.name().parse(), View::from_code(view.code())), (Ok(view), Some(view)));
    }
    assert!("stretch@3".parse::<View>().is_err() && View::from_code(11).is_none());
    assert!(View::ALL.is_sorted());
}

#[test]
fn small_volumes_have_the_views_of_scale_one_only() {
    let volume = from_fn([7, 20, 20], |z, y, x| (z * y + x) as u8);
    let views: Vec<_> = describe(volume.as_voxels(), &View::ALL).into_iter().map(|(view, _)| view.name()).collect();
    assert_eq!(views, ["full@1", "stretch@1", "sign@1", "detail@1", "rank@1"]);
}
