//! The mappings of the views, each over a whole volume at once.

use std::borrow::Cow;

use crate::voxels::Shape;

/// The number of voxels of each level.
fn histogram(voxels: &[u8]) -> [u64; 256] {
    // With four tables, a run of equal voxels does not wait for a single counter.
    let mut tables = [[0_u32; 256]; 4];
    let mut total = [0_u64; 256];
    // Parts too short to overflow a counter.
    for part in voxels.chunks(1 << 30) {
        let (quads, rest) = part.as_chunks::<4>();
        for quad in quads {
            for (table, &voxel) in tables.iter_mut().zip(quad) {
                table[usize::from(voxel)] += 1;
            }
        }
        for &voxel in rest {
            tables[0][usize::from(voxel)] += 1;
        }
        for table in &mut tables {
            for (sum, count) in total.iter_mut().zip(table) {
                *sum += u64::from(std::mem::take(count));
            }
        }
    }
    total
}

/// Each voxel replaced by its entry in a table.
fn look_up(voxels: &[u8], table: &[u8; 256]) -> Vec<u8> {
    voxels.iter().map(|&voxel| table[usize::from(voxel)]).collect()
}

/// `stretch@1`; borrowed if nothing changes.
pub(super) fn stretch(voxels: &[u8]) -> Cow<'_, [u8]> {
    let n = voxels.len() as u128;
    let histogram = histogram(voxels);
    // The lowest level at which `percent` of the voxels are reached.
    let level = |percent: u128| {
        let mut reached = 0;
        let at = histogram.iter().position(|&count| {
            reached += u128::from(count);
            100 * reached >= percent * n
        });
        at.unwrap_or(0) as i32
    };
    let low = level(1);
    let high = level(99).max(low + 1);
    if (low, high) == (0, 255) {
        return Cow::Borrowed(voxels);
    }
    let width = high - low;
    let map = |v: i32| (510 * (v - low) + width).div_euclid(2 * width).clamp(0, 255) as u8;
    Cow::Owned(look_up(voxels, &std::array::from_fn(|v| map(v as i32))))
}

/// `rank` of the given voxels: the mean rank of a level among all voxels, scaled to 0..=255.
pub(super) fn rank(voxels: &[u8]) -> Vec<u8> {
    let n = voxels.len() as u128;
    let mut below_or_at = 0;
    let table = histogram(voxels).map(|count| {
        let count = u128::from(count);
        below_or_at += count;
        ((255 * (2 * below_or_at - count) + n) / (2 * n).max(1)) as u8
    });
    look_up(voxels, &table)
}

/// The rounded means of blocks of `SIDE` (2 or 4) voxels a side; the remainder at the far borders is dropped.
pub(super) fn block_average<const SIDE: usize>(shape: Shape, voxels: &[u8]) -> Vec<u8> {
    let [depth, height, width] = shape.map(|length| length / SIDE);
    let mut averages = Vec::with_capacity(depth * height * width);
    // Columns first (16 values of 255 fit a u16), so that the long loop runs over neighbours in memory.
    let mut columns = vec![0_u16; width * SIDE];
    let volume = SIDE.pow(3) as u16;
    for z in 0..depth {
        for y in 0..height {
            columns.fill(0);
            for dz in 0..SIDE {
                for dy in 0..SIDE {
                    let start = ((z * SIDE + dz) * shape[1] + y * SIDE + dy) * shape[2];
                    for (sum, &voxel) in columns.iter_mut().zip(&voxels[start..start + width * SIDE]) {
                        *sum += u16::from(voxel);
                    }
                }
            }
            let (blocks, _) = columns.as_chunks::<SIDE>();
            averages.extend(blocks.iter().map(|block| ((block.iter().sum::<u16>() + volume / 2) / volume) as u8));
        }
    }
    averages
}

/// For each voxel, `27 v` minus the sum over its 3x3x3 neighbourhood, borders replicated.
///
/// A difference is at most 26 * 255 = 6630 either way, a sum 27 * 255 = 6885: both fit an `i16`.
pub(super) struct Contrast {
    differences: Vec<i16>,
}

impl Contrast {
    pub(super) fn of(shape: Shape, voxels: &[u8]) -> Self {
        let [depth, height, width] = shape;
        let plane = height * width;
        let mut differences = vec![0_i16; voxels.len()];
        // Sums over 3x3 in the planes z - 1, z, z + 1; slot p % 3 holds plane p.
        let mut sums = [const { Vec::new() }; 3].map(|_: Vec<i16>| vec![0_i16; plane]);
        let mut rows = vec![0_i16; plane];
        let mut fill =
            |z: usize, into: &mut [i16]| plane_sums([height, width], &voxels[z * plane..][..plane], &mut rows, into);
        fill(0, &mut sums[0]);
        for z in 0..depth {
            if z + 1 < depth {
                fill(z + 1, &mut sums[(z + 1) % 3]);
            }
            let (above, below) = (&sums[z.saturating_sub(1) % 3], &sums[(z + 1).min(depth - 1) % 3]);
            let out = &mut differences[z * plane..][..plane];
            let inputs = voxels[z * plane..][..plane].iter().zip(above).zip(&sums[z % 3]).zip(below);
            for (difference, (((&voxel, a), b), c)) in out.iter_mut().zip(inputs) {
                *difference = 27 * i16::from(voxel) - (a + b + c);
            }
        }
        Self { differences }
    }

    /// `sign`: 255 where the difference is positive, else 0.
    pub(super) fn signs(&self) -> Vec<u8> {
        self.differences.iter().map(|&d| if d > 0 { 255 } else { 0 }).collect()
    }

    /// `detail`: 128 + 42 differences in units of their standard deviation, rounded half away from zero, clamped.
    pub(super) fn detail(&self) -> Vec<u8> {
        /// A power of two above the range of all differences, so that a masked index needs no bounds check.
        const ENTRIES: usize = 1 << 14;
        let deviation = self.deviation();
        if deviation == 0.0 {
            return vec![128; self.differences.len()];
        }
        let low = self.differences.iter().fold(0, |low, &d| d.min(low));
        let high = self.differences.iter().fold(0, |high, &d| d.max(high));
        // Adding a half and truncating rounds positive values half away from zero; negative ones are clamped to 0 anyway.
        let map = |d: i16| ((128.0 + 42.0 * f64::from(d) / deviation + 0.5) as i32).clamp(0, 255) as u8;
        let mut table = [0; ENTRIES];
        table.iter_mut().zip(low..=high).for_each(|(entry, d)| *entry = map(d));
        self.differences.iter().map(|&d| table[(d - low) as usize % ENTRIES]).collect()
    }

    /// The standard deviation of the differences, from their exact sums.
    fn deviation(&self) -> f64 {
        let (mut sum, mut squares) = (0_i64, 0_u64);
        let mut count = |part: &[i16]| {
            // 64 squares of at most 6630 stay below 2^32.
            sum += i64::from(part.iter().map(|&d| i32::from(d)).sum::<i32>());
            squares += u64::from(part.iter().map(|&d| (i32::from(d) * i32::from(d)) as u32).sum::<u32>());
        };
        let (parts, rest) = self.differences.as_chunks::<64>();
        parts.iter().for_each(|part| count(part));
        count(rest);
        let n = self.differences.len() as f64;
        let mean = sum as f64 / n;
        (squares as f64 / n - mean * mean).max(0.0).sqrt()
    }
}

/// The sums over 3 x 3 voxels of one plane, borders replicated.
fn plane_sums([height, width]: [usize; 2], voxels: &[u8], rows: &mut [i16], sums: &mut [i16]) {
    for (row, out) in voxels.chunks_exact(width).zip(rows.chunks_exact_mut(width)) {
        let value = |x: usize| i16::from(row[x]);
        out[0] = 2 * value(0) + value(1);
        out[width - 1] = value(width - 2) + 2 * value(width - 1);
        let near = row.iter().zip(&row[1..]).zip(&row[2..]);
        for (sum, ((&a, &b), &c)) in out[1..].iter_mut().zip(near) {
            *sum = i16::from(a) + i16::from(b) + i16::from(c);
        }
    }
    for y in 0..height {
        let row = |y: usize| &rows[y * width..][..width];
        let inputs = row(y.saturating_sub(1)).iter().zip(row(y)).zip(row((y + 1).min(height - 1)));
        for (sum, ((a, b), c)) in sums[y * width..][..width].iter_mut().zip(inputs) {
            *sum = a + b + c;
        }
    }
}
