//! The hit-sum, the other reading of the paper.

use crate::{MASK_COUNT, MASKS, Voxels};

/// 251 exact hit-sums, the other reading of the paper.
///
/// The paper says: "251 mask patterns are used to test if the voxels exist at the mask position. When each mask pattern
/// hits the voxels, the color intensity value of the voxels are added to the 3D HLAC features." Taken literally, a mask
/// *hits* a window if all of its cells are occupied (not 0), and a hit adds the intensities of its cells:
///
/// ```text
///   hit-sum(mask) = sum over the windows in which every cell of the mask is > 0 of (I(c1) + I(c2) + I(c3))
/// ```
///
/// [`Sums`](crate::Sums) multiply the intensities instead, which is the standard definition of HLAC. The two types differ
/// because their moments are normalised differently.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HitSums {
    /// The number of windows: (Z-2)(Y-2)(X-2).
    pub windows: u64,
    /// For each mask, in the order of [`MASKS`], the number of windows in which none of its cells is 0.
    pub hits: [u64; MASK_COUNT],
    /// For each mask, the sum over those windows of the intensities at its cells.
    pub values: [u64; MASK_COUNT],
}

impl HitSums {
    /// The moments: `hit-sum / (windows * 255 * cells)`, each in [0, 1]; all 0 if there is no window.
    pub fn moments(&self) -> [f64; MASK_COUNT] {
        let mut moments = [0.0; MASK_COUNT];
        if self.windows > 0 {
            for ((moment, &sum), mask) in moments.iter_mut().zip(&self.values).zip(&MASKS) {
                *moment = sum as f64 / (self.windows as f64 * 255.0 * mask.order() as f64);
            }
        }
        moments
    }
}

/// The hit-sums of a volume.
pub fn extract_hit_sum(volume: Voxels<'_>) -> HitSums {
    let (shape, voxels) = (volume.shape(), volume.as_slice());
    let windows = shape.map(|side| side - 2);
    let mut sums = HitSums {
        windows: windows.iter().map(|&n| n as u64).product(),
        hits: [0; MASK_COUNT],
        values: [0; MASK_COUNT],
    };
    for z in 0..windows[0] {
        for y in 0..windows[1] {
            let row = |cell: u8| {
                let [dz, dy, dx] = [cell / 9, cell / 3 % 3, cell % 3].map(usize::from);
                let start = ((z + dz) * shape[1] + y + dy) * shape[2] + dx;
                &voxels[start..start + windows[2]]
            };
            for (index, mask) in MASKS.iter().enumerate() {
                let (hits, value) = match *mask.cells() {
                    [a] => row_sums([row(a)]),
                    [a, b] => row_sums([row(a), row(b)]),
                    [a, b, c] => row_sums([row(a), row(b), row(c)]),
                    _ => (0, 0),
                };
                sums.hits[index] += hits;
                sums.values[index] += value;
            }
        }
    }
    sums
}

/// The number of hits and the sum of their intensities along one row of windows; `rows[i][x]` is the `i`-th cell of window
/// `x`.
fn row_sums<const CELLS: usize>(rows: [&[u8]; CELLS]) -> (u64, u64) {
    // Blocks short enough for 16-bit lanes: 85 x 3 x 255 < 2^16. The compiler vectorises the inner loop.
    const BLOCK: usize = 85;
    let (mut hits, mut value) = (0, 0);
    let length = rows[0].len();
    for start in (0..length).step_by(BLOCK) {
        let rows = rows.map(|row| &row[start..length.min(start + BLOCK)]);
        let (mut block_hits, mut block_value) = (0_u16, 0_u16);
        for x in 0..rows[0].len() {
            let cells = rows.map(|row| row[x]);
            let hit = u16::from(cells.iter().all(|&cell| cell != 0));
            block_hits += hit;
            block_value += hit * cells.iter().map(|&cell| u16::from(cell)).sum::<u16>();
        }
        hits += u64::from(block_hits);
        value += u64::from(block_value);
    }
    (hits, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hit_needs_every_cell_and_adds_the_intensities() {
        // One window; only cells a, k and l are occupied.
        let mut voxels = vec![0; 27];
        (voxels[0], voxels[10], voxels[11]) = (255, 255, 7);
        let sums = extract_hit_sum(Voxels::new(&voxels, [3, 3, 3]).unwrap());
        for (index, mask) in MASKS.iter().enumerate() {
            let expected = match mask.letters().as_str() {
                "a" => (1, 255),
                "ak" => (1, 510),
                "akl" => (1, 517),
                _ => (0, 0),
            };
            assert_eq!((sums.hits[index], sums.values[index]), expected, "{}", mask.letters());
        }
    }

    #[test]
    fn long_rows_of_255_do_not_overflow() {
        let sums = extract_hit_sum(Voxels::new(&[255; 3600], [3, 4, 300]).unwrap());
        assert_eq!((sums.windows, sums.hits[250], sums.values[250]), (596, 596, 596 * 765));
    }
}
