//! The symmetric eigenproblem: Householder's reduction to tridiagonal form, then implicit QL steps.

use std::ops::Range;

use super::{Matrix, axpy, dot};

/// The eigenvalues and eigenvectors of a symmetric matrix.
pub(crate) struct Eigen {
    /// Ascending.
    pub(crate) values: Vec<f64>,
    /// One eigenvector a row, in the order of `values`. Orthonormal; the sign of each is arbitrary.
    pub(crate) vectors: Matrix,
}

impl Eigen {
    /// Decomposes a symmetric matrix of finite numbers. Eigenvalues are accurate to about 1e-15 of the largest.
    pub(crate) fn of(matrix: Matrix) -> Self {
        let mut reduced = Tridiagonal::of(matrix);
        reduced.diagonalise();
        let mut order: Vec<usize> = (0..reduced.diagonal.len()).collect();
        order.sort_by(|&a, &b| reduced.diagonal[a].total_cmp(&reduced.diagonal[b]));
        Self {
            values: order.iter().map(|&at| reduced.diagonal[at]).collect(),
            vectors: Matrix::from_fn(order.len(), order.len(), |i, j| reduced.vectors[(order[i], j)]),
        }
    }

    /// The symmetric square root of a positive semi-definite matrix. Eigenvalues that rounding made negative count as 0.
    #[cfg(any(test, feature = "unstable-internals"))]
    pub(crate) fn square_root(&self) -> Matrix {
        let size = self.values.len();
        let scaled = Matrix::from_fn(size, size, |i, j| self.vectors[(i, j)] * self.values[i].max(0.0).sqrt());
        self.vectors.transposed().times(&scaled)
    }
}

/// A tridiagonal matrix `vectors A vectors'`, and the orthogonal matrix that makes it of `A`.
struct Tridiagonal {
    diagonal: Vec<f64>,
    /// The element to the right of each diagonal one; the last is 0.
    off_diagonal: Vec<f64>,
    vectors: Matrix,
}

impl Tridiagonal {
    fn of(mut a: Matrix) -> Self {
        let n = a.rows();
        let (mut off_diagonal, mut reflections) = (Vec::with_capacity(n), Vec::with_capacity(n));
        for k in 0..n {
            let (reflection, length) = Reflection::of(&a.row(k)[k + 1..]);
            reflection.apply_to_both_sides(&mut a, k + 1..n);
            off_diagonal.push(length);
            reflections.push(reflection);
        }
        let diagonal = (0..n).map(|k| a[(k, k)]).collect();
        // From the last to the first, so that each reflection meets only rows and columns beyond its own.
        let mut product = Matrix::identity(n);
        for (k, reflection) in reflections.iter().enumerate().rev() {
            reflection.apply_from_the_left(&mut product, k + 1..n);
        }
        Self { diagonal, off_diagonal, vectors: product.transposed() }
    }

    /// Reduces the off-diagonal to 0, one eigenvalue at a time.
    fn diagonalise(&mut self) {
        /// An eigenvalue takes about 3 steps; 30 is the usual limit. The bound ends the loop on numbers that are not
        /// finite.
        const MAX_STEPS: usize = 60;
        let n = self.diagonal.len();
        for first in 0..n {
            for _ in 0..MAX_STEPS {
                let last = (first..n - 1).find(|&at| self.is_split(at)).unwrap_or(n - 1);
                if last == first {
                    break;
                }
                self.step(first, last);
            }
        }
    }

    /// Whether the element right of diagonal element `at` is nothing off_diagonal its neighbours.
    fn is_split(&self, at: usize) -> bool {
        let size = self.diagonal[at].abs() + self.diagonal[at + 1].abs();
        self.off_diagonal[at].abs() <= f64::EPSILON * size
    }

    /// One implicit QL step with Wilkinson's shift on the block from `first` to `last`: a rotation at its end starts a
    /// bulge, and each rotation after it chases the bulge one row up.
    fn step(&mut self, first: usize, last: usize) {
        let (d, e) = (&mut self.diagonal, &mut self.off_diagonal);
        let half = (d[first + 1] - d[first]) / (2.0 * e[first]);
        let shift = d[first] - e[first] / (half + half.signum() * libm::hypot(half, 1.0));
        let (mut sine, mut cosine) = (1.0, 1.0);
        let mut moved = 0.0;
        let mut bulge = d[last] - shift;
        for at in (first..last).rev() {
            let (across, along) = (sine * e[at], cosine * e[at]);
            let length = libm::hypot(across, bulge);
            e[at + 1] = length;
            if length == 0.0 {
                // The block splits here by itself.
                d[at + 1] -= moved;
                e[last] = 0.0;
                return;
            }
            (sine, cosine) = (across / length, bulge / length);
            let rest = d[at + 1] - moved;
            let turned = (d[at] - rest) * sine + 2.0 * cosine * along;
            moved = sine * turned;
            d[at + 1] = rest + moved;
            bulge = cosine * turned - along;
            let (upper, lower) = self.vectors.two_rows(at, at + 1);
            rotate(upper, lower, cosine, sine);
        }
        d[first] -= moved;
        e[first] = bulge;
        e[last] = 0.0;
    }
}

/// Rotates the plane of two rows.
fn rotate(upper: &mut [f64], lower: &mut [f64], cosine: f64, sine: f64) {
    for (upper, lower) in upper.iter_mut().zip(lower) {
        let (a, b) = (*upper, *lower);
        *upper = cosine * a - sine * b;
        *lower = sine * a + cosine * b;
    }
}

/// The Householder reflection `I - factor vector vector'`, which maps a given vector to the first axis.
struct Reflection {
    vector: Vec<f64>,
    factor: f64,
}

impl Reflection {
    /// The reflection for `x`, and the first coordinate of its image; the others are 0.
    fn of(x: &[f64]) -> (Self, f64) {
        let length = dot(x, x).sqrt();
        let mut vector = x.to_vec();
        let (Some(first), true) = (vector.first_mut(), length > 0.0) else {
            return (Self { vector, factor: 0.0 }, 0.0);
        };
        // On the other side of the origin, so that the subtraction does not cancel.
        let target = if *first > 0.0 { -length } else { length };
        *first -= target;
        let factor = -1.0 / (target * *first);
        (Self { vector, factor }, target)
    }

    /// `a <- H a H` on the symmetric block of rows and columns in `range`.
    fn apply_to_both_sides(&self, a: &mut Matrix, range: Range<usize>) {
        let v = &self.vector;
        let mut w: Vec<f64> = range.clone().map(|row| self.factor * dot(&a.row(row)[range.clone()], v)).collect();
        let half = 0.5 * self.factor * dot(&w, v);
        axpy(&mut w, -half, v);
        for (at, row) in range.clone().enumerate() {
            let out = &mut a.row_mut(row)[range.clone()];
            let (of_w, of_v) = (v[at], w[at]);
            for ((out, w), v) in out.iter_mut().zip(&w).zip(v) {
                *out -= of_w * w + of_v * v;
            }
        }
    }

    /// `a <- H a` on the block of rows and columns in `range`.
    fn apply_from_the_left(&self, a: &mut Matrix, range: Range<usize>) {
        let mut along = vec![0.0; range.len()];
        for (&v, row) in self.vector.iter().zip(range.clone()) {
            axpy(&mut along, v, &a.row(row)[range.clone()]);
        }
        for (&v, row) in self.vector.iter().zip(range.clone()) {
            axpy(&mut a.row_mut(row)[range.clone()], -self.factor * v, &along);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn symmetric(n: usize, rank: usize, numbers: &[f64]) -> Matrix {
        let factor = Matrix::from_fn(n, rank, |i, j| numbers[(i * rank + j) % numbers.len()] * 4_f64.powi(-(j as i32)));
        factor.times(&factor.transposed())
    }

    proptest! {
        #![proptest_config(hlacdb_testing::cases(48))]

        #[test]
        fn eigenvectors_rebuild_the_matrix(
            n in 1..24_usize, rank in 1..24_usize, numbers in proptest::collection::vec(-1.0..1.0_f64, 576),
        ) {
            let matrix = symmetric(n, rank, &numbers);
            let Eigen { values, vectors } = Eigen::of(matrix.clone());
            prop_assert!(values.is_sorted());
            let scaled = Matrix::from_fn(n, n, |i, j| values[i] * vectors[(i, j)]);
            let rebuilt = vectors.transposed().times(&scaled);
            let unit = vectors.times(&vectors.transposed());
            let size = values[n - 1].abs().max(1e-300);
            for i in 0..n {
                for j in 0..n {
                    prop_assert!((rebuilt[(i, j)] - matrix[(i, j)]).abs() < 1e-13 * size);
                    prop_assert!((unit[(i, j)] - f64::from(i == j)).abs() < 1e-13);
                }
            }
        }
    }

    #[test]
    fn degenerate_matrices_are_decomposed() {
        assert!(Eigen::of(Matrix::zero(0, 0)).values.is_empty());
        assert_eq!(Eigen::of(Matrix::zero(5, 5)).values, [0.0; 5]);
        let diagonal = Eigen::of(Matrix::from_fn(4, 4, |i, j| if i == j { [3.0, 1.0, 2.0, 1.0][i] } else { 0.0 }));
        assert_eq!(diagonal.values, [1.0, 1.0, 2.0, 3.0]);
        let ones = Eigen::of(Matrix::from_fn(6, 6, |_, _| 1.0));
        assert!((ones.values[5] - 6.0).abs() < 1e-14 && ones.values[..5].iter().all(|value| value.abs() < 1e-14));
    }

    #[test]
    fn the_square_root_squared_is_the_matrix() {
        let matrix = symmetric(9, 5, &[0.3, -0.7, 0.2, 0.9, -0.1, 0.5, 0.4]);
        let root = Eigen::of(matrix.clone()).square_root();
        let square = root.times(&root);
        assert!(square.values().iter().zip(matrix.values()).all(|(a, b)| (a - b).abs() < 1e-14));
    }

    #[test]
    fn a_known_spectrum_is_found() {
        // The path of n nodes: 2 - 2 cos(k pi / (n + 1)).
        let n = 60;
        let path = Matrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => 2.0,
            1 => -1.0,
            _ => 0.0,
        });
        for (k, value) in Eigen::of(path).values.iter().enumerate() {
            let exact = 2.0 - 2.0 * ((k + 1) as f64 * std::f64::consts::PI / (n + 1) as f64).cos();
            assert!((value - exact).abs() < 1e-13, "{k}");
        }
    }
}
