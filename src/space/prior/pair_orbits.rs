//! [`PairOrbits`]: which covariances are equal if no direction is preferred.

use crate::hlac::MASK_COUNT;
use crate::hlac::orbits::symmetries;
use crate::space::linalg::Matrix;
use crate::space::scatter::Scatter;

/// The orbits of unordered pairs of masks under the symmetries of the cube.
pub(super) struct PairOrbits {
    /// The orbit of each pair: the upper triangle, row by row.
    orbit_of: Vec<u32>,
    pub(super) count: usize,
}

impl PairOrbits {
    pub(super) fn new() -> Self {
        const UNKNOWN: u32 = u32::MAX;
        let symmetries = symmetries();
        let mut orbit_of = vec![UNKNOWN; Scatter::length(MASK_COUNT)];
        let mut count = 0;
        for (at, [i, j]) in Self::pairs().enumerate() {
            if orbit_of[at] == UNKNOWN {
                for symmetry in &symmetries {
                    orbit_of[Self::place(usize::from(symmetry[i]), usize::from(symmetry[j]))] = count;
                }
                count += 1;
            }
        }
        Self { orbit_of, count: count as usize }
    }

    fn pairs() -> impl Iterator<Item = [usize; 2]> {
        (0..MASK_COUNT).flat_map(|i| (i..MASK_COUNT).map(move |j| [i, j]))
    }

    /// The index of a pair in the upper triangle.
    fn place(i: usize, j: usize) -> usize {
        let (i, j) = (i.min(j), i.max(j));
        i * MASK_COUNT - i * (i + 1) / 2 + j
    }

    /// The mean of a symmetric matrix over each orbit.
    #[cfg(any(test, feature = "unstable-internals"))]
    pub(super) fn average(&self, matrix: &Matrix) -> Vec<f64> {
        let mut sums = vec![(0.0, 0.0); self.count];
        for (&orbit, [i, j]) in self.orbit_of.iter().zip(Self::pairs()) {
            let (sum, count) = &mut sums[orbit as usize];
            *sum += matrix[(i, j)];
            *count += 1.0;
        }
        sums.into_iter().map(|(sum, count)| sum / count).collect()
    }

    /// The matrix whose elements are the values of their orbits.
    pub(super) fn spread(&self, values: &[f64]) -> Matrix {
        Matrix::from_fn(MASK_COUNT, MASK_COUNT, |i, j| values[self.orbit_of[Self::place(i, j)] as usize])
    }
}
