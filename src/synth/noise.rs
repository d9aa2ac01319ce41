//! Lattice noise with the same bits on every CPU: Perlin's gradient noise, value noise, and Worley's cellular noise.
//!
//! A *lattice* is a grid of integer points with a seed and a period along each axis; a hash of point and seed gives
//! each point its gradient, value or feature point. Noise repeats after the period of its lattice, so a volume that is a
//! whole number of periods wide tiles without a seam in all three directions.
//!
//! Everything is `f32` computed with + - * and an explicit floor, in a fixed order: no fused multiply-add, no platform
//! library. Distances are squared; the caller takes roots. Sources: Perlin, "Improving noise" (2002), for the fade and the
//! twelve gradients; Worley, "A cellular texture basis function" (1996).

use super::field::Field;
use crate::volume::Shape;

/// Perlin's gradients (x, y, z): the midpoints of the twelve edges of a cube.
const GRADIENTS: [[f32; 3]; 12] = [
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [1.0, -1.0, 0.0],
    [-1.0, -1.0, 0.0],
    [1.0, 0.0, 1.0],
    [-1.0, 0.0, 1.0],
    [1.0, 0.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, 1.0, 1.0],
    [0.0, -1.0, 1.0],
    [0.0, 1.0, -1.0],
    [0.0, -1.0, -1.0],
];

/// The period of a lattice that need not tile: longer than any volume.
pub(crate) const WIDE: u32 = 1 << 16;

/// A hash of a lattice point: every bit of seed and point changes every bit of the result with probability near 1/2.
pub(crate) fn hash(seed: u32, x: u32, y: u32, z: u32) -> u32 {
    let mut h = seed
        .wrapping_add(x.wrapping_mul(0x9E37_79B1))
        .rotate_left(13)
        .wrapping_add(y.wrapping_mul(0x85EB_CA77))
        .rotate_left(13)
        .wrapping_add(z.wrapping_mul(0xC2B2_AE3D));
    h = (h ^ (h >> 16)).wrapping_mul(0x21F0_AAAD);
    h = (h ^ (h >> 15)).wrapping_mul(0xD35A_2D97);
    h ^ (h >> 15)
}

/// The upper 24 bits of a hash as a number in [0, 1).
pub(crate) fn unit(hash: u32) -> f32 {
    (hash >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The floor of `v` and the rest in [0, 1). `|v|` must be under 2^31.
pub(crate) fn floor(v: f32) -> (i32, f32) {
    let truncated = v as i32;
    let whole = truncated - i32::from((truncated as f32) > v);
    (whole, v - whole as f32)
}

/// Perlin's fade: 6 t^5 - 15 t^4 + 10 t^3, flat to the second derivative at 0 and 1.
pub(crate) fn fade(t: f32) -> f32 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// Linear interpolation from `a` at t = 0 to `b` at t = 1.
pub(crate) fn lerp(t: f32, a: f32, b: f32) -> f32 {
    a + t * (b - a)
}

fn gradient(hash: u32) -> [f32; 3] {
    GRADIENTS[((u64::from(hash) * GRADIENTS.len() as u64) >> 32) as usize]
}

/// The positions of a volume's voxels on a lattice: voxel i of an axis is at `origin + i * step`, in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid {
    /// Axis lengths (Z, Y, X) of the volume.
    pub(crate) shape: Shape,
    /// Cells per voxel along (Z, Y, X), at most 1: more would alias.
    pub(crate) step: [f64; 3],
    /// The cell position of the first voxel, (Z, Y, X).
    pub(crate) origin: [f64; 3],
}

/// A periodic lattice with a seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lattice {
    /// Lattices with different seeds have unrelated noise.
    pub(crate) seed: u32,
    /// The number of cells after which the noise repeats along (X, Y, Z), at least 1.
    pub(crate) period: [u32; 3],
}

impl Lattice {
    /// A lattice that does not repeat within any volume.
    pub(crate) fn wide(seed: u32) -> Self {
        Self { seed, period: [WIDE; 3] }
    }

    /// The wrapped lattice indices of a cell and of the next one along an axis.
    fn wrap(&self, axis: usize, cell: i32) -> [u32; 2] {
        let period = self.period[axis];
        let low =
            if (cell as u32) < period { cell as u32 } else { i64::from(cell).rem_euclid(i64::from(period)) as u32 };
        [low, if low + 1 == period { 0 } else { low + 1 }]
    }

    /// The hashes of the eight corners of the cell around `p` (x fastest), and the position within the cell.
    fn corners(&self, p: [f32; 3]) -> ([u32; 8], [f32; 3]) {
        let [(ix, fx), (iy, fy), (iz, fz)] = p.map(floor);
        let (x, y, z) = (self.wrap(0, ix), self.wrap(1, iy), self.wrap(2, iz));
        let corners = std::array::from_fn(|i| hash(self.seed, x[i & 1], y[(i >> 1) & 1], z[i >> 2]));
        (corners, [fx, fy, fz])
    }

    /// Perlin's noise at a point (x, y, z) in cells: about -1 to 1, and 0 at every lattice point.
    pub(crate) fn perlin(&self, p: [f32; 3]) -> f32 {
        let (corners, f) = self.corners(p);
        let mut dots = [0.0; 8];
        for (i, (dot, corner)) in dots.iter_mut().zip(corners).enumerate() {
            let g = gradient(corner);
            let shift = [i & 1, (i >> 1) & 1, i >> 2].map(|bit| bit as f32);
            *dot = g[0] * (f[0] - shift[0]) + (g[1] * (f[1] - shift[1]) + g[2] * (f[2] - shift[2]));
        }
        trilinear(dots, f)
    }

    /// Value noise at a point (x, y, z) in cells: a random value from -1 to 1 at every lattice point, faded between them.
    pub(crate) fn value(&self, p: [f32; 3]) -> f32 {
        let (corners, f) = self.corners(p);
        trilinear(corners.map(|corner| 2.0 * unit(corner) - 1.0), f)
    }

    /// Calls `paint(noise, voxel)` with Perlin's noise at every voxel of a grid, in memory order.
    ///
    /// This is [`Lattice::perlin`] up to rounding, ten times as fast: along a row, the four gradients of a lattice column
    /// reduce to one linear function `a + b x`, so that a voxel costs two of them and an interpolation.
    pub(crate) fn perlin_grid(&self, grid: &Grid, field: &mut Field, paint: impl Fn(f32, &mut f32)) {
        let [nz, ny, nx] = grid.shape;
        debug_assert_eq!(field.shape(), grid.shape);
        let xs = GridAxis::new(grid, 2, nx);
        let (ys, zs) = (GridAxis::new(grid, 1, ny), GridAxis::new(grid, 0, nz));
        let columns: Vec<u32> = (0..xs.columns()).map(|k| self.wrap(0, xs.first + k as i32)[0]).collect();
        let mut gradients = vec![[[0.0; 3]; 4]; columns.len()];
        let mut lines = vec![(0.0, 0.0); columns.len()];
        let mut rows = field.values_mut().chunks_exact_mut(nx);
        for z in 0..nz {
            let mut cell = None;
            for (y, row) in (0..ny).zip(&mut rows) {
                if cell != Some(ys.cell[y]) {
                    cell = Some(ys.cell[y]);
                    let (y, z) =
                        (self.wrap(1, ys.first + ys.cell[y] as i32), self.wrap(2, zs.first + zs.cell[z] as i32));
                    for (gradients, &x) in gradients.iter_mut().zip(&columns) {
                        *gradients = std::array::from_fn(|i| gradient(hash(self.seed, x, y[i & 1], z[i >> 1])));
                    }
                }
                let (fy, fz) = (ys.place[y], zs.place[z]);
                for ((a, b), g) in lines.iter_mut().zip(&gradients) {
                    let mix =
                        |v: [f32; 4]| lerp(zs.fade[z], lerp(ys.fade[y], v[0], v[1]), lerp(ys.fade[y], v[2], v[3]));
                    let rest = |i: usize| g[i][1] * (fy - (i & 1) as f32) + g[i][2] * (fz - (i >> 1) as f32);
                    *a = mix([rest(0), rest(1), rest(2), rest(3)]);
                    *b = mix([g[0][0], g[1][0], g[2][0], g[3][0]]);
                }
                for (x, voxel) in row.iter_mut().enumerate() {
                    let (k, f) = (xs.cell[x], xs.place[x]);
                    let (left, right) = (lines[k], lines[k + 1]);
                    paint(lerp(xs.fade[x], left.0 + left.1 * f, right.0 + right.1 * (f - 1.0)), voxel);
                }
            }
        }
    }
}

/// One axis of a grid, computed once: for every voxel its cell (counted from `first`), its position in the cell, and the
/// fade of that position.
struct GridAxis {
    first: i32,
    cell: Vec<usize>,
    place: Vec<f32>,
    fade: Vec<f32>,
}

impl GridAxis {
    fn new(grid: &Grid, axis: usize, length: usize) -> Self {
        let position = |i: usize| grid.origin[axis] + i as f64 * grid.step[axis];
        // f64::floor is exact on every platform.
        let first = position(0).floor();
        let cells = (0..length).map(|i| position(i).floor());
        let place: Vec<f32> = (0..length).map(|i| (position(i) - position(i).floor()) as f32).collect();
        Self {
            first: first as i32,
            cell: cells.map(|cell| (cell - first) as usize).collect(),
            fade: place.iter().copied().map(fade).collect(),
            place,
        }
    }

    /// The number of lattice columns that the axis touches.
    fn columns(&self) -> usize {
        self.cell.last().map_or(0, |last| last + 2)
    }
}

/// Interpolates eight corner values (x fastest) at the position `f` of a cell, faded along each axis.
fn trilinear(v: [f32; 8], f: [f32; 3]) -> f32 {
    let [x, y, z] = f.map(fade);
    let near = lerp(y, lerp(x, v[0], v[1]), lerp(x, v[2], v[3]));
    let far = lerp(y, lerp(x, v[4], v[5]), lerp(x, v[6], v[7]));
    lerp(z, near, far)
}

/// The distances to the nearest feature points of a cellular lattice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Nearest {
    /// Squared distance to the nearest feature point, in cells.
    pub(crate) first: f32,
    /// Squared distance to the second nearest.
    pub(crate) second: f32,
    /// The hash that identifies the nearest feature point.
    pub(crate) cell: u32,
}

/// Worley's cellular noise: one feature point in every cell of a periodic lattice.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    lattice: Lattice,
    /// Each cell's feature point: its position within the cell (x, y, z) and its hash; x fastest.
    points: Vec<([f32; 3], u32)>,
}

impl Cells {
    /// A period that is longer than volumes at usual scales, and cheap.
    pub(crate) const WIDE: [u32; 3] = [32; 3];

    /// Cells whose feature points are at most `jitter / 2` cells from the centre along each axis (`jitter` from 0 to 1).
    /// Periods (X, Y, Z) are clamped to 1..=128 cells.
    pub(crate) fn new(seed: u32, period: [u32; 3], jitter: f32) -> Self {
        let period = period.map(|cells| cells.clamp(1, 128));
        let lattice = Lattice { seed, period };
        let mut points = Vec::with_capacity(period.iter().map(|&n| n as usize).product());
        for z in 0..period[2] {
            for y in 0..period[1] {
                for x in 0..period[0] {
                    let name = hash(seed, x, y, z);
                    let place = [1, 2, 3].map(|salt| 0.5 + jitter * (unit(hash(name, salt, 0, 0)) - 0.5));
                    points.push((place, name));
                }
            }
        }
        Self { lattice, points }
    }

    /// The two feature points nearest to (x, y, z) in cells, among the 27 cells around it, which nearly always hold both.
    pub(crate) fn nearest(&self, p: [f32; 3]) -> Nearest {
        let [(ix, fx), (iy, fy), (iz, fz)] = p.map(floor);
        let around = |axis: usize, cell: i32| {
            let ([below, at], [_, above]) = (self.lattice.wrap(axis, cell - 1), self.lattice.wrap(axis, cell));
            [below, at, above].map(|cell| cell as usize)
        };
        let (xs, ys, zs) = (around(0, ix), around(1, iy), around(2, iz));
        let [nx, ny, _] = self.lattice.period.map(|n| n as usize);
        let mut nearest = Nearest { first: f32::MAX, second: f32::MAX, cell: 0 };
        for (dz, z) in zs.iter().enumerate() {
            for (dy, y) in ys.iter().enumerate() {
                let row = &self.points[(z * ny + y) * nx..][..nx];
                for (dx, &x) in xs.iter().enumerate() {
                    let (place, name) = row[x];
                    let [px, py, pz] = [
                        place[0] + (dx as f32 - 1.0) - fx,
                        place[1] + (dy as f32 - 1.0) - fy,
                        place[2] + (dz as f32 - 1.0) - fz,
                    ];
                    nearest.offer(px * px + py * py + pz * pz, name);
                }
            }
        }
        nearest
    }
}

impl Nearest {
    /// Takes another feature point into account.
    fn offer(&mut self, distance: f32, name: u32) {
        if distance < self.first {
            (self.second, self.first, self.cell) = (self.first, distance, name);
        } else if distance < self.second {
            self.second = distance;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn painted(lattice: &Lattice, grid: &Grid) -> Field {
        let mut field = Field::constant(grid.shape, 0.0);
        lattice.perlin_grid(grid, &mut field, |noise, voxel| *voxel = noise);
        field
    }

    #[test]
    fn grid_and_point_give_the_same_noise() {
        let lattice = Lattice { seed: 9, period: [3, 5, 7] };
        let grid = Grid { shape: [11, 12, 13], step: [0.3, 0.77, 1.0], origin: [-2.4, 0.1, 6.25] };
        let field = painted(&lattice, &grid);
        let mut found = field.values().iter();
        for z in 0..11 {
            for y in 0..12 {
                for x in 0..13 {
                    let p = [6.25 + x as f32, 0.1 + 0.77 * y as f32, -2.4 + 0.3 * z as f32];
                    let (found, expected) = (*found.next().unwrap(), lattice.perlin(p));
                    assert!((found - expected).abs() < 1e-4, "{found} {expected} at {p:?}");
                }
            }
        }
    }

    #[test]
    fn perlin_is_zero_on_the_lattice_and_stays_in_range() {
        let lattice = Lattice::wide(1);
        assert_eq!(lattice.perlin([4.0, -3.0, 0.0]), 0.0);
        let grid = Grid { shape: [48, 48, 48], step: [0.37; 3], origin: [0.1; 3] };
        let (low, high) = painted(&lattice, &grid).range();
        assert!((-1.04..-0.7).contains(&low) && (0.7..1.04).contains(&high), "{low} {high}");
    }

    #[test]
    fn noise_tiles_to_the_bit() {
        let (lattice, side) = (Lattice { seed: 5, period: [4; 3] }, 16);
        let twice = Grid { shape: [2 * side; 3], step: [0.25; 3], origin: [0.0; 3] };
        let field = painted(&lattice, &twice);
        let at = |z: usize, y: usize, x: usize| field.values()[(z * 2 * side + y) * 2 * side + x].to_bits();
        for (z, y, x) in [(0, 0, 0), (3, 7, 15), (15, 1, 8), (9, 14, 2)] {
            assert_eq!(at(z, y, x), at(z + side, y + side, x + side));
            assert_eq!(at(z, y, x), at(z, y + side, x));
        }
        let value = |p| lattice.value(p);
        assert_eq!(value([0.5, 1.25, 3.75]), value([4.5, -2.75, 3.75]));
    }

    #[test]
    fn nearest_agrees_with_a_search_of_all_points() {
        let (period, axes) = ([3_u32, 4, 5], [0, 1, 2]);
        // With little jitter, the two nearest points are certainly among the 27 cells.
        let cells = Cells::new(7, period, 0.2);
        for i in 0..100 {
            let p = [0.17 * i as f32 - 9.0, 0.13 * i as f32, 5.0 - 0.19 * i as f32];
            let mut distances = Vec::new();
            for (index, (place, name)) in cells.points.iter().enumerate() {
                let cell = [index % 3, index / 3 % 4, index / 12];
                // The nearest periodic image of the feature point, axis by axis.
                let gap = |k: usize| {
                    let (gap, period) = (place[k] + cell[k] as f32 - p[k], period[k] as f32);
                    gap - period * (gap / period).round()
                };
                distances.push((axes.map(|k| gap(k) * gap(k)).iter().sum::<f32>(), *name));
            }
            distances.sort_by(|a, b| a.0.total_cmp(&b.0));
            let nearest = cells.nearest(p);
            assert!((nearest.first - distances[0].0).abs() < 1e-4, "{nearest:?} {:?}", distances[0]);
            assert!((nearest.second - distances[1].0).abs() < 1e-4, "{nearest:?} {:?}", distances[1]);
            assert_eq!(nearest.cell, distances[0].1);
        }
    }

    #[test]
    fn floor_rounds_down() {
        assert_eq!(floor(-0.25), (-1, 0.75));
        assert_eq!(floor(-2.0), (-2, 0.0));
        assert_eq!(floor(3.5), (3, 0.5));
    }
}
